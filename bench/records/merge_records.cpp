#include "bench/records/merge_records.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <utility>

#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/records/stored_picture.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

using PointKey = std::pair<std::string, std::string>;  ///< configuration, context

PointKey point_of(const Json& record) {
  RecordKey key = key_of(record);
  return {std::move(key.configuration), std::move(key.context)};
}

struct Input {
  std::string name;
  std::vector<Json> records;
};

Input read_input(const fs::path& folder, std::vector<std::string>& warnings) {
  RecordLines lines = load_record_lines(folder);
  warnings.insert(warnings.end(), lines.warnings.begin(), lines.warnings.end());
  if (lines.records.empty())
    throw UsageError(fmt::format("{}: no records; accepted: a folder that `amrtex run` wrote", folder.string()));
  for (const Json& record : lines.records)
    if (const Json& schema = value_at(record, "/schema"); schema != kRecordSchema)
      throw UsageError(
          fmt::format("{}: holds records of schema {}; accepted: {}", folder.string(), shown(schema), kRecordSchema));
  return {folder.string(), std::move(lines.records)};
}

/// Which program measured a point, and in which folder that stands.
class Programs {
 public:
  void add(const Json& record, const std::string& folder) {
    const Json& implementation = value_at(record, "/implementation");
    const auto [place, added] = programs_.try_emplace(point_of(record), Program{implementation, folder});
    // a folder may hold several of itself (--keep-old)
    if (!added && place->second.folder != folder && place->second.implementation != implementation)
      throw UsageError(fmt::format(
          "{} and {}: point {} was measured by two programs, {} and {}; accepted: folders of one program", place->second.folder,
          folder, place->first.first, shown(place->second.implementation), shown(implementation)));
  }

 private:
  struct Program {
    Json implementation;
    std::string folder;
  };
  std::map<PointKey, Program> programs_;
};

/// Records by point, and what they say beside their repetition.
class Repetitions {
 public:
  void add(const Json& record) { points_[point_of(record)][key_of(record).repetition] = content(record); }
  bool holds(const Json& record) const {
    const auto point = points_.find(point_of(record));
    if (point == points_.end()) return false;
    return std::any_of(point->second.begin(), point->second.end(),
                       [text = content(record)](const auto& each) { return each.second == text; });
  }
  /// The record's own, or the first that is free behind all.
  int free_for(const Json& record) const {
    const int own = key_of(record).repetition;
    const auto point = points_.find(point_of(record));
    if (point == points_.end() || !point->second.contains(own)) return own;
    return point->second.rbegin()->first + 1;
  }

 private:
  static std::string content(Json record) {
    record["repetition"] = nullptr;
    return record_line(record);
  }

  std::map<PointKey, std::map<int, std::string>> points_;
};

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file) throw Error(fmt::format("{}: cannot be read", path.string()));
  return bytes;
}

/// The picture of a point, where the input has one and `out` has none; returns whether it took one.
bool take_picture(const fs::path& out, const fs::path& input, const std::string& configuration) {
  bool taken = false;
  for (const char* extension : {".npz", ".png"}) {
    const fs::path from = picture_path(input, configuration, extension), to = picture_path(out, configuration, extension);
    std::error_code absent;
    if (!fs::is_regular_file(from, absent) || fs::exists(to, absent)) continue;
    make_folder(picture_folder(out));
    write_atomically(to, bytes_of(from));
    taken = true;
  }
  return taken;
}

}  // namespace

MergedRecords merge_records(const fs::path& out, std::span<const fs::path> inputs) {
  MergedRecords merged;
  std::vector<Input> read;
  Programs programs;
  for (const fs::path& folder : inputs) {
    read.push_back(read_input(folder, merged.warnings));
    for (const Json& record : read.back().records) programs.add(record, read.back().name);
  }
  RecordFile file(out);
  merged.warnings.insert(merged.warnings.end(), file.warnings().begin(), file.warnings().end());
  Repetitions repetitions;
  for (const Json& record : file.records()) {
    programs.add(record, out.string());
    repetitions.add(record);
  }
  for (const Input& input : read)
    for (Json record : input.records) {
      // before its record, as `run` keeps them
      if (take_picture(out, input.name, key_of(record).configuration)) ++merged.pictures;
      if (repetitions.holds(record)) {
        ++merged.present;
        continue;
      }
      const int repetition = repetitions.free_for(record);
      if (repetition != key_of(record).repetition) ++merged.renumbered;
      record["repetition"] = repetition;
      file.append(record);
      repetitions.add(record);
      ++merged.added;
    }
  return merged;
}

}  // namespace amrtex
