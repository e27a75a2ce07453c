// The records of a folder: DIR/records.jsonl, one line a point, {"record": {...}, "crc32": "..."}. Lines are only added; a later
// one of the same configuration, repetition and context stands for an earlier one. Committed results are the same, compressed:
// records.jsonl.gz.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// What tells lines apart.
struct RecordKey {
  std::string configuration;
  int repetition = 0;
  std::string context;  ///< context_key()
  auto operator<=>(const RecordKey&) const = default;
};
RecordKey key_of(const Json& record);
/// Hex digits of what a time depends on beside the program: device, renderer, GL version, processor, cores.
std::string context_key(const Json& context);

/// One line, without its end.
std::string record_line(const Json& record);

/// What a file of records holds.
struct RecordLines {
  std::vector<Json>
      records;  ///< the last of each key, in the order of the keys: that of the lines depends on when they were measured
  std::vector<std::string> warnings;  ///< of lines that cannot be read: each is as if it were not there
  std::uintmax_t whole_bytes = 0;     ///< up to the end of the last whole line
  bool torn = false;                  ///< is there a part of a line behind it?
};

/// Of the text of a file; `name` stands in messages. Throws Error for a record of a newer schema, naming it.
RecordLines parse_record_lines(std::string_view text, const std::string& name);
/// `folder`/records.jsonl, else records.jsonl.gz, else the files of records/ that older programs wrote, schema 1 among them.
/// Throws Error where there is none, or one cannot be read.
RecordLines load_record_lines(const std::filesystem::path& folder);
/// Its records alone.
std::vector<Json> load_records(const std::filesystem::path& folder);

/// The file of a folder that one run measures into. No other can open it meanwhile, on this machine, and on others as far as the
/// file system has locks; a process that ends, however, holds it no longer.
class RecordFile {
 public:
  /// Makes folder and file where they are not there. A part of a line at the end is cut off, with a warning. Throws UsageError
  /// where another run holds the file or the folder holds files of an older form, OutputError where it cannot be written.
  explicit RecordFile(const std::filesystem::path& folder);
  ~RecordFile();
  RecordFile(const RecordFile&) = delete;
  RecordFile& operator=(const RecordFile&) = delete;

  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Null where there is none.
  const Json* find(const RecordKey& key) const;
  /// The last record of each key, in their order.
  std::vector<Json> records() const;

  /// Validates and adds a line, which is on disk when this returns; or takes back what it wrote, and throws OutputError.
  void append(const Json& record);

 private:
  void lock();
  void take_over(const RecordLines& lines);

  std::filesystem::path folder_;
  std::filesystem::path path_;
  int descriptor_ = -1;
  std::vector<std::string> warnings_;
  std::map<RecordKey, Json> last_;
};

}  // namespace amrtex
