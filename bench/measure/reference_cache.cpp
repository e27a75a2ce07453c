#include "bench/measure/reference_cache.hpp"

#include <fstream>
#include <optional>

#include "bench/records/record.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// A picture nearer to its reference than this many times the reference's own error shows as much of the one as of the other.
constexpr double kClear = 10;

Json rule_json(const ReferenceRule& rule) {
  return rule.step() ? Json{{"step", *rule.step()}} : Json{{"tolerance", rule.tolerance()}};
}

/// What is known of a picture beside its floats; nullopt where that cannot be read.
std::optional<ReferencePicture> read_facts(const fs::path& path) {
  std::ifstream file(path);
  const Json facts = Json::parse(file, nullptr, false);
  if (!facts.is_object() || !facts.contains("error") || !facts.contains("evaluations")) return std::nullopt;
  ReferencePicture known;
  if (facts["error"].is_number()) known.error = facts["error"].get<double>();
  if (facts["evaluations"].is_number_integer()) known.evaluations = facts["evaluations"].get<std::int64_t>();
  return known;
}

/// Nothing where it is not there or damaged, by whatever befell the disk: it is drawn again, and that concerns no point.
std::optional<ReferencePicture> read_picture(const fs::path& path, const fs::path& facts) {
  if (!fs::exists(path)) return std::nullopt;
  std::optional<ReferencePicture> known = read_facts(facts);
  if (!known) return std::nullopt;
  try {
    known->picture = read_npy(path);
  } catch (const Error&) {
    return std::nullopt;
  }
  return known;
}

}  // namespace

std::string reference_name(const ReferenceRequest& r) {
  Json key = {{"scene", scene_reference(r.scene)}, {"data", r.data_hash}};
  key["filter"] = filter_name(r.definition.filter);
  key["page"] = {r.definition.page_size, r.definition.page_level};
  key["rule"] = rule_json(r.rule);
  key["version"] = kReferenceVersion;
  return configuration_hash(key);
}

ReferencePicture cached_reference(const ReferenceRequest& r, const fs::path& folder) {
  const std::string hash = reference_name(r);
  const fs::path path = folder / (hash + ".npy");
  const fs::path facts = folder / (hash + ".json");
  if (auto known = read_picture(path, facts)) return *std::move(known);
  ReferencePicture drawn = HierarchyReference(r.hierarchy, 0, r.definition).draw(r.scene, r.rule);
  make_folder(folder);
  write_atomically(facts, Json{{"error", drawn.error ? Json(*drawn.error) : Json()}, {"evaluations", drawn.evaluations}}.dump());
  write_npy(drawn.picture, path, true);
  return drawn;
}

void add_reference_error(Json& error, const ReferencePicture& reference, const ErrorMetrics& metrics) {
  error["reference_error"] = reference.error ? Json(*reference.error) : Json();
  error["limited_by_reference"] = reference.error ? Json(metrics.max < kClear * *reference.error) : Json();
}

}  // namespace amrtex
