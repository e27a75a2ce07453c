#include "bench/records/record_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <system_error>
#include <utility>

#include "bench/records/record.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFile = "records.jsonl";
constexpr std::string_view kCompressed = "records.jsonl.gz";

std::string reason() { return std::system_category().message(errno); }

std::string checksum(std::string_view text) {
  const uLong crc = ::crc32(::crc32(0, nullptr, 0), reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size()));
  return fmt::format("{:08x}", crc);
}

std::string text_of(const Json& record) { return record.dump(-1, ' ', false, Json::error_handler_t::replace); }

/// Of a line: the record, or why it is none.
struct Line {
  Json record;
  std::string problem;
};

/// The number of a schema as amrtex-record/2; 0 for anything else.
int schema_number(const Json& record) {
  constexpr std::string_view kPrefix = "amrtex-record/";
  const Json schema = record.is_object() ? record.value("schema", Json()) : Json();
  if (!schema.is_string()) return 0;
  const std::string text = schema;
  return text.starts_with(kPrefix) ? std::atoi(text.c_str() + kPrefix.size()) : 0;
}

/// The record in a line, letter by letter, where it has the form of record_line(); empty where it has not.
std::string_view record_in(std::string_view line) {
  constexpr std::string_view kBegin = R"({"record": )", kEnd = R"(, "crc32": "00000000"})";
  if (!line.starts_with(kBegin) || line.size() < kBegin.size() + kEnd.size()) return {};
  return line.substr(kBegin.size(), line.size() - kBegin.size() - kEnd.size());
}

/// The same number can be written in several ways: the letters count, and where a program laid them out anew, what they say.
bool fits(const Json& crc, std::string_view line, const Json& record) {
  return crc == checksum(record_in(line)) || crc == checksum(text_of(record));
}

Line read_line(std::string_view text, const std::string& place) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("record") || !json.contains("crc32")) return {{}, "is no record"};
  const Json& record = json["record"];
  if (!fits(json["crc32"], text, record)) return {{}, "does not fit its own checksum"};
  if (schema_number(record) > schema_number(Json{{"schema", kRecordSchema}}))
    throw Error(fmt::format("{}: the record is of schema {}; accepted: {} and older ones, or a newer amrtex", place,
                            quote(record["schema"].get<std::string>()), kRecordSchema));
  try {
    validate_record(record);
  } catch (const Error& error) {
    return {{}, fmt::format("is not valid: {}", error.what())};
  }
  return {record, {}};
}

std::string read_text(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (!in) throw Error(fmt::format("{}: cannot be read: {}", path.string(), reason()));
  return text;
}

std::string read_compressed(const fs::path& path) {
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(::gzopen(path.c_str(), "rb"), &::gzclose);
  if (!file) throw Error(fmt::format("{}: cannot be read: {}", path.string(), reason()));
  std::string text;
  std::string part(1 << 16, '\0');
  for (int n = 0; (n = ::gzread(file.get(), part.data(), static_cast<unsigned>(part.size()))) != 0;) {
    if (n < 0) throw Error(fmt::format("{}: is damaged: {}", path.string(), ::gzerror(file.get(), &n)));
    text.append(part, 0, static_cast<std::size_t>(n));
  }
  return text;
}

}  // namespace

std::string context_key(const Json& context) {
  if (!context.is_object()) return {};
  Json what = Json::object();
  for (const char* key : {"device", "renderer", "gl_version", "cpu", "cores"}) what[key] = context.value(key, Json());
  return configuration_hash(what);
}

RecordKey key_of(const Json& record) {
  const Json configuration = record.value("configuration", Json()), repetition = record.value("repetition", Json());
  return {configuration.is_string() ? configuration.get<std::string>() : text_of(record),
          repetition.is_number_integer() ? repetition.get<int>() : 0, context_key(record.value("context", Json()))};
}

std::string record_line(const Json& record) {
  const std::string text = text_of(record);
  return fmt::format(R"({{"record": {}, "crc32": "{}"}})", text, checksum(text));
}

RecordLines parse_record_lines(std::string_view text, const std::string& name) {
  RecordLines lines;
  std::map<RecordKey, Json> records;
  std::size_t number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    ++number;
    if (end == std::string_view::npos) {
      lines.torn = true;
      lines.warnings.push_back(
          fmt::format("{}:{}: the last line is cut off and left out; `amrtex run` measures its point again", name, number));
      break;
    }
    Line line = read_line(text.substr(at, end - at), fmt::format("{}:{}", name, number));
    if (line.problem.empty()) {
      const RecordKey key = key_of(line.record);  // before the record is moved from
      records[key] = std::move(line.record);
    } else
      lines.warnings.push_back(
          fmt::format("{}:{}: {}; the line is left out, and `amrtex run` measures its point again", name, number, line.problem));
    at = end + 1;
    lines.whole_bytes = at;
  }
  for (auto& [key, record] : records) lines.records.push_back(std::move(record));
  return lines;
}

RecordLines load_record_lines(const fs::path& folder) {
  if (const fs::path file = folder / kFile; fs::exists(file)) return parse_record_lines(read_text(file), file.string());
  if (const fs::path file = folder / kCompressed; fs::exists(file))
    return parse_record_lines(read_compressed(file), file.string());
  RecordLines lines;
  lines.records = load_separate_records(folder);
  return lines;
}

std::vector<Json> load_records(const fs::path& folder) { return load_record_lines(folder).records; }

RecordFile::RecordFile(const fs::path& folder) : folder_(folder), path_(folder / kFile) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw OutputError(fmt::format("output folder {}: {}", folder.string(), error.message()));
  if (const auto old = separate_record(folder))
    throw UsageError(
        fmt::format("output folder {}: {} is of an older form, which a run does not go on from; accepted: another folder for "
                    "--out, or this one "
                    "without its folder `records` (`amrtex report` still makes tables of them)",
                    folder.string(), (fs::path("records") / old->filename()).string()));
  descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (descriptor_ < 0) throw OutputError(fmt::format("{}: cannot be written: {}", path_.string(), reason()));
  try {
    lock();
    take_over(parse_record_lines(read_text(path_), path_.string()));
    sync_folder(folder);
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

RecordFile::~RecordFile() { ::close(descriptor_); }

/// flock belongs to the open file: it ends with the last process that has it open, and children that inherit nothing do not.
void RecordFile::lock() {
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) == 0) return;
  if (errno == EWOULDBLOCK)
    throw UsageError(
        fmt::format("output folder {}: another run measures into it; accepted: another folder for --out, or this one when "
                    "that run has ended",
                    folder_.string()));
  warnings_.push_back(fmt::format("output folder {}: its file system has no locks ({}): nothing keeps a second run out of it",
                                  folder_.string(), reason()));
}

void RecordFile::take_over(const RecordLines& lines) {
  warnings_.insert(warnings_.end(), lines.warnings.begin(), lines.warnings.end());
  if (lines.torn && ::ftruncate(descriptor_, static_cast<off_t>(lines.whole_bytes)) != 0)
    throw OutputError(fmt::format("{}: its torn last line cannot be cut off: {}", path_.string(), reason()));
  for (const Json& record : lines.records) last_[key_of(record)] = record;
}

const Json* RecordFile::find(const RecordKey& key) const {
  const auto found = last_.find(key);
  return found == last_.end() ? nullptr : &found->second;
}

std::vector<Json> RecordFile::records() const {
  std::vector<Json> records;
  for (const auto& [key, record] : last_) records.push_back(record);
  return records;
}

void RecordFile::append(const Json& record) {
  validate_record(record);
  // somebody may have removed the folder: a line in a file that has no name is lost
  struct stat open_file {
  }, named{};
  if (::fstat(descriptor_, &open_file) != 0 || ::stat(path_.c_str(), &named) != 0 || open_file.st_ino != named.st_ino ||
      open_file.st_dev != named.st_dev)
    throw OutputError(fmt::format("{}: is gone, or another file has its name", path_.string()));
  const std::string line = record_line(record) + "\n";
  if (const int error = write_all(descriptor_, line); error != 0) {
    // half a line must not stay; where even this fails, the next run cuts it off
    static_cast<void>(::ftruncate(descriptor_, open_file.st_size));
    throw OutputError(fmt::format("{}: cannot be written: {}", path_.string(), std::system_category().message(error)));
  }
  last_[key_of(record)] = record;
}

}  // namespace amrtex
