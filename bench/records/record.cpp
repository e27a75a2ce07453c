#include "bench/records/record.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <system_error>

#include "bench/numbers/statistics.hpp"
#include "bench/settings/json_file.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

enum class Kind { string, number, integer, boolean, object, array, string_or_object };

/// One fixed key. Parents stand before their children; children are looked at only
/// where the parent is not null.
struct Rule {
  const char* pointer;
  Kind kind;
  bool nullable = true;
  int since = 1;  ///< schema
};

constexpr Rule kRules[] = {
    {"/schema", Kind::string, false},
    {"/status", Kind::string, false},
    {"/reason", Kind::string},
    {"/experiment", Kind::string},
    {"/configuration", Kind::string, true, 2},
    {"/implementation", Kind::string, true, 2},
    {"/repetition", Kind::integer, true, 2},
    {"/asked", Kind::object, true, 2},
    {"/dataset", Kind::object},
    {"/dataset/name", Kind::string},
    {"/dataset/source", Kind::string_or_object, true, 2},
    {"/dataset/hash", Kind::string},
    {"/dataset/exact_hash", Kind::string, true, 2},
    {"/dataset/leaf_cells", Kind::integer},
    {"/dataset/stored_cells", Kind::integer},
    {"/dataset/levels", Kind::integer},
    {"/dataset/patches", Kind::integer},
    {"/dataset/field", Kind::string},
    {"/encoding", Kind::string},
    {"/build_parameters", Kind::object},
    {"/filter", Kind::string},
    {"/storage", Kind::string},
    {"/filtering", Kind::string},
    {"/render", Kind::object},
    {"/render/consumer", Kind::string},
    {"/render/mode", Kind::string},
    {"/render/sampling", Kind::string},
    {"/render/step", Kind::number},
    {"/render/integrator", Kind::string},
    {"/render/width", Kind::integer},
    {"/render/height", Kind::integer},
    {"/render/view", Kind::object},
    {"/render/transfer_function", Kind::object},
    {"/memory", Kind::object},
    {"/memory/total_bytes", Kind::integer, false},
    {"/memory/by_role", Kind::object, false},
    {"/memory/by_role/payload", Kind::integer, false},
    {"/memory/by_role/duplicated", Kind::integer, false},
    {"/memory/by_role/topology", Kind::integer, false},
    {"/memory/by_role/padding", Kind::integer, false},
    {"/memory/texels_by_texture", Kind::object},
    {"/memory/texels_per_cell", Kind::number},
    {"/memory/host_peak_bytes", Kind::integer},
    {"/build_seconds", Kind::number},
    {"/upload_seconds", Kind::number},
    {"/process_peak_bytes", Kind::integer, true, 2},
    {"/first_frame_ms", Kind::number},
    {"/frame", Kind::object},
    {"/frame/wall_ms", Kind::object},
    {"/frame/wall_ms/median", Kind::number, false},
    {"/frame/wall_ms/mad", Kind::number, false},
    {"/frame/wall_ms/ci95", Kind::array, false},
    {"/frame/wall_ms/min", Kind::number, false},
    {"/frame/wall_ms/n", Kind::integer, false},
    {"/frame/gpu_ms", Kind::object},
    {"/frame/gpu_ms/median", Kind::number, false},
    {"/frame/gpu_ms/mad", Kind::number, false},
    {"/frame/gpu_ms/ci95", Kind::array, false},
    {"/frame/gpu_ms/min", Kind::number, false},
    {"/frame/gpu_ms/n", Kind::integer, false},
    {"/frame/all_wall_ms", Kind::array},
    {"/work", Kind::object},
    {"/work/rays", Kind::integer},
    {"/work/samples", Kind::integer},
    {"/work/regions", Kind::integer},
    {"/work/regions_skipped", Kind::integer},
    {"/check", Kind::object, true, 2},
    {"/check/psnr_db", Kind::number, false, 2},
    {"/check/from", Kind::string, false, 2},
    {"/check/why", Kind::string, true, 2},
    {"/check_reason", Kind::string, true, 2},
    {"/error", Kind::object},
    {"/error/rmse", Kind::number},
    {"/error/max", Kind::number},
    {"/error/psnr_db", Kind::number},
    {"/error/mrse", Kind::number},
    {"/error/reference", Kind::string},
    {"/error/reference_error", Kind::number, true, 2},
    {"/error/limited_by_reference", Kind::boolean, true, 2},
    {"/error/within_tolerance_seen", Kind::number, true, 2},
    {"/error/split", Kind::object},
    {"/error_common", Kind::object},
    {"/error_common/rmse", Kind::number},
    {"/error_common/max", Kind::number},
    {"/error_common/psnr_db", Kind::number},
    {"/error_common/mrse", Kind::number},
    {"/error_common/reference", Kind::string},
    {"/error_common/filter", Kind::string},
    {"/left_out", Kind::array},
    {"/image_hash", Kind::string},
    {"/context", Kind::object},
    {"/context/renderer", Kind::string},
    {"/context/device", Kind::string, true, 2},
    {"/context/gl_version", Kind::string},
    {"/context/extensions_missing", Kind::array},
    {"/context/cpu", Kind::string},
    {"/context/cores", Kind::integer},
    {"/context/environment", Kind::object},
    {"/context/build_type", Kind::string},
    {"/context/compiler", Kind::string},
    {"/context/commit", Kind::string},
    {"/context/dirty", Kind::boolean},
    {"/context/shader_hash", Kind::string},
    {"/context/shader_cache", Kind::string, true, 2},
    {"/context/date", Kind::string},
};

constexpr Status kStatuses[] = {Status::ok, Status::unsupported, Status::failed, Status::over_budget};

[[noreturn]] void fail(std::string_view pointer, std::string_view problem) {
  throw Error(fmt::format("record: {}: {}", pointer, problem));
}

const char* kind_name(Kind kind) {
  constexpr std::array<const char*, 7> names = {"a string",  "a number", "an integer",           "true or false",
                                                "an object", "a list",   "a string or an object"};
  return names[static_cast<std::size_t>(kind)];
}

bool is_kind(const Json& json, Kind kind) {
  switch (kind) {
    case Kind::string:
      return json.is_string();
    case Kind::number:
      return json.is_number();
    case Kind::integer:
      return json.is_number_integer();
    case Kind::boolean:
      return json.is_boolean();
    case Kind::object:
      return json.is_object();
    case Kind::array:
      return json.is_array();
    case Kind::string_or_object:
      return json.is_string() || json.is_object();
  }
  return false;
}

/// The value at `pointer`, or nullptr where it or something above it does not exist.
const Json* find(const Json& record, const char* pointer) {
  const Json::json_pointer p(pointer);
  return record.contains(p) ? &record.at(p) : nullptr;
}

void check_rule(const Json& record, const Rule& rule) {
  const Json::json_pointer pointer(rule.pointer);
  const Json* parent = find(record, pointer.parent_pointer().to_string().c_str());
  if (parent == nullptr || parent->is_null()) return;  // the parent's own rule speaks of it
  const Json* value = find(record, rule.pointer);
  if (value == nullptr) fail(rule.pointer, "this key is missing (absent is null)");
  if (value->is_null() && rule.nullable) return;
  if (!is_kind(*value, rule.kind))
    fail(rule.pointer, fmt::format("{} is expected{}", kind_name(rule.kind), rule.nullable ? " or null" : ""));
}

void check_status(const Json& record) {
  const auto status = record.at("status").get<std::string>();
  if (std::none_of(std::begin(kStatuses), std::end(kStatuses), [&](Status s) { return status_name(s) == status; }))
    fail("/status", fmt::format("{} is none of ok, unsupported, failed, over_budget", quote(status)));
  const bool ok = status == status_name(Status::ok);
  if (ok != record.at("reason").is_null())
    fail("/reason", ok ? "must be null where the status is ok" : "must say why the status is not ok");
  if (!ok && !record.at("frame").is_null()) fail("/frame", "only a record with status ok has times");
}

void check_memory(const Json& memory) {
  if (memory.is_null()) return;
  std::int64_t sum = 0;
  for (const auto& [role, bytes] : memory.at("by_role").items()) {
    if (!bytes.is_number_integer()) fail("/memory/by_role/" + role, "an integer is expected");
    sum += bytes.get<std::int64_t>();
  }
  if (memory.at("total_bytes") != sum) fail("/memory/total_bytes", fmt::format("is not the sum of its roles, {}", sum));
}

void check_timing(const Json& timing, const std::string& pointer) {
  if (timing.is_null()) return;
  const Json& interval = timing.at("ci95");
  const bool pair = interval.size() == 2 && interval[0].is_number() && interval[1].is_number() && interval[0] <= interval[1];
  if (!pair) fail(pointer + "/ci95", "two ascending numbers are expected");
}

void check_frame(const Json& frame) {
  if (frame.is_null()) return;
  check_timing(frame.at("wall_ms"), "/frame/wall_ms");
  check_timing(frame.at("gpu_ms"), "/frame/gpu_ms");
  const Json& all = frame.at("all_wall_ms");
  if (all.is_null() || frame.at("wall_ms").is_null()) return;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (!all[i].is_number()) fail(fmt::format("/frame/all_wall_ms/{}", i), "a number is expected");
  if (frame.at("wall_ms").at("n") != all.size())
    fail("/frame/wall_ms/n", fmt::format("is not the number of samples, {}", all.size()));
}

/// A picture has a bound or a reason why it has none.
void check_check(const Json& record) {
  const bool has_bound = !record.at("check").is_null(), has_reason = !record.at("check_reason").is_null();
  if (has_bound && has_reason) fail("/check_reason", "must be null where there is a check");
  if (!has_bound && !has_reason && record.at("status") == status_name(Status::ok))
    fail("/check_reason", "must say why the picture was not checked");
}

/// Causes that were not measured are left out or null.
void check_split(const Json& error) {
  if (error.is_null() || error.at("split").is_null()) return;
  for (const auto& [cause, difference] : error.at("split").items()) {
    if (difference.is_null()) continue;
    if (cause == "sum_closes") {  // no cause, but how well they add up
      if (!difference.is_number()) fail("/error/split/sum_closes", "a number is expected");
      continue;
    }
    for (const char* key : {"rmse", "max"})
      if (!difference.is_object() || !difference.contains(key) || !difference.at(key).is_number())
        fail(fmt::format("/error/split/{}/{}", clipped(cause), key), "a number is expected");
  }
}

/// Sorted keys, and whole floats as integers, so that equal configurations have equal texts.
nlohmann::json canonical(const Json& json) {
  if (json.is_object()) {
    nlohmann::json object = nlohmann::json::object();
    for (const auto& [key, value] : json.items()) object[key] = canonical(value);
    return object;
  }
  if (json.is_array()) {
    nlohmann::json array = nlohmann::json::array();
    for (const Json& value : json) array.push_back(canonical(value));
    return array;
  }
  if (!json.is_number_float()) return nlohmann::json::parse(json.dump());
  const double number = json.get<double>();
  if (!std::isfinite(number)) throw Error("configuration: NaN and infinities are no JSON");
  constexpr double kExactIntegers = 9007199254740992.0;  // 2^53
  if (std::abs(number) <= kExactIntegers && number == std::floor(number)) return static_cast<std::int64_t>(number);
  return number;
}

void check_contents(const Json& record) {
  for (const Rule& rule : kRules) check_rule(record, rule);
  check_status(record);
  check_memory(record.at("memory"));
  check_frame(record.at("frame"));
  check_split(record.at("error"));
}

bool is_first_schema(const Json& record) { return record.is_object() && record.value("schema", Json()) == kFirstSchema; }

/// Keys that schema 1 did not have are null in what it described.
void add_later_keys(Json& record) {
  for (const Rule& rule : kRules) {
    const Json::json_pointer pointer(rule.pointer);
    const Json& parent = pointer.parent_pointer().empty() ? record : value_at(record, pointer.parent_pointer().to_string());
    if (rule.since > 1 && parent.is_object() && !record.contains(pointer)) record[pointer] = nullptr;
  }
}

Json read_separate_record(const std::filesystem::path& path) {
  Json record;
  try {
    record = read_json(path);
  } catch (const UsageError& e) {  // of a file that no user writes
    throw Error(e.what());
  }
  try {
    if (is_first_schema(record)) {
      add_later_keys(record);
      check_contents(record);
    } else {
      validate_record(record);
    }
    return record;
  } catch (const std::exception& e) {
    throw Error(fmt::format("{}: {}", path.string(), e.what()));
  }
}

}  // namespace

std::string_view status_name(Status status) {
  constexpr std::array<std::string_view, 4> names = {"ok", "unsupported", "failed", "over_budget"};
  return names[static_cast<std::size_t>(status)];
}

Json blank_record(Status status, std::string_view reason) {
  Json record = Json::object();
  for (const Rule& rule : kRules) {
    const Json::json_pointer pointer(rule.pointer);
    if (pointer.parent_pointer().empty()) record[pointer.back()] = nullptr;
  }
  record["schema"] = kRecordSchema;
  record["status"] = status_name(status);
  if (!reason.empty()) record["reason"] = reason;
  return record;
}

const Json& value_at(const Json& json, std::string_view pointer) {
  static const Json null;
  const Json::json_pointer p{std::string(pointer)};
  return json.contains(p) ? json.at(p) : null;
}

Json timing_json(std::span<const double> samples_ms) {
  if (samples_ms.empty()) return nullptr;
  const Summary s = summarize(samples_ms);
  return {{"median", s.median}, {"mad", s.mad}, {"ci95", {s.ci_lower, s.ci_upper}},
          {"min", s.min},       {"n", s.n},     {"coverage", s.coverage}};
}

Json memory_json(const EncodedField& field, std::int64_t leaf_cells) {
  const MemoryByRole roles = field.memory();
  Json texels = Json::object();
  for (const HostTexture& texture : field.textures)  // textures of a set share a name
    texels[texture.name] = texels.value(texture.name, std::int64_t{0}) + texture.texels();
  Json per_cell = nullptr;
  const std::int64_t values = leaf_cells * field.field_count;
  if (values > 0) per_cell = static_cast<double>(field.value_texels()) / static_cast<double>(values);
  return {
      {"total_bytes", roles.total()},
      {"by_role",
       {{"payload", roles.payload}, {"duplicated", roles.duplicated}, {"topology", roles.topology}, {"padding", roles.padding}}},
      {"texels_by_texture", texels},
      {"texels_per_cell", per_cell},
      {"host_peak_bytes", field.host_peak_bytes}};
}

void add_leaps(Json& memory, std::int64_t bytes) {
  if (bytes == 0) return;
  memory["total_bytes"] = memory["total_bytes"].get<std::int64_t>() + bytes;
  Json& topology = memory["by_role"]["topology"];
  topology = topology.get<std::int64_t>() + bytes;
  memory["texels_by_texture"]["leap_distances"] = bytes / 4;
}

Json left_out_json(const EncodedField& field) {
  Json list = Json::array();
  for (const LeftOut& item : field.left_out)
    list.push_back({{"what", item.what},
                    {"why", item.why},
                    {"bytes", item.bytes},
                    {"seconds", item.seconds ? Json(*item.seconds) : Json()}});
  return list;
}

Json error_json(const ErrorMetrics& error, std::string_view reference_hash) {
  return {{"rmse", error.rmse},
          {"max", error.max},
          {"psnr_db", error.psnr_db ? Json(*error.psnr_db) : Json()},
          {"mrse", error.mrse},
          {"reference", reference_hash}};
}

void validate_record(const Json& record) {
  if (!record.is_object()) fail("", "an object is expected");
  const auto schema = record.find("schema");
  if (schema == record.end() || *schema != kRecordSchema) fail("/schema", fmt::format("'{}' is expected", kRecordSchema));
  check_contents(record);
  check_check(record);
}

std::string configuration_hash(const Json& configuration) {
  const std::string text = canonical(configuration).dump();
  const XXH128_hash_t hash = XXH3_128bits(text.data(), text.size());
  return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

std::vector<Json> load_separate_records(const std::filesystem::path& folder) {
  const std::filesystem::path records = folder / "records";
  std::error_code error;
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(records, error))
    if (entry.path().extension() == ".json") paths.push_back(entry.path());
  if (error)
    throw Error(fmt::format(
        "{}: no records: neither records.jsonl nor records.jsonl.gz is there; accepted: a folder that `amrtex run` wrote",
        folder.string()));
  std::sort(paths.begin(), paths.end());
  std::vector<Json> loaded;
  for (const auto& path : paths) loaded.push_back(read_separate_record(path));
  return loaded;
}

std::optional<std::filesystem::path> separate_record(const std::filesystem::path& folder) {
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "records", absent))
    if (entry.path().extension() == ".json") return entry.path();
  return std::nullopt;
}

}  // namespace amrtex
