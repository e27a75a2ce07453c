// Data sets of several files that are whole or not there, whatever happens while they are written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/cell_values.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {

/// A hidden folder beside `target`, under a random name that no other process can have. It is locked while this object
/// lives, and it vanishes with it. What processes that were killed left behind beside `target` is removed first: folders
/// of this kind that nobody has locked.
class UnfinishedFolder {
 public:
  explicit UnfinishedFolder(const std::filesystem::path& target);
  ~UnfinishedFolder();
  UnfinishedFolder(const UnfinishedFolder&) = delete;
  UnfinishedFolder& operator=(const UnfinishedFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

  /// The folder becomes the target. Throws Error where there is something of that name.
  void publish();
  /// Files of the folder become files beside the target, all of them or none. Throws Error where one of the names is taken.
  void publish_files(const std::vector<std::string>& names);

 private:
  std::filesystem::path target_;
  std::filesystem::path path_;
  int descriptor_ = -1;  ///< holds the lock
};

/// Throws Error where there is something of this name.
void refuse_existing(const std::filesystem::path& target);

/// A path as it was given, without a slash at its end.
std::filesystem::path without_slash(const std::filesystem::path& path);

/// A file that is written from its begin to its end; closing it tells whether all went well.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path);
  void write(std::string_view bytes);
  template <class T>
  void write_values(const std::vector<T>& values) {
    write({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }
  /// Values of any type as numbers of this one.
  void write_cells(const CellValues& values, RealType type);
  std::uint64_t written() const { return written_; }
  void close();

 private:
  void check() const;

  std::filesystem::path path_;
  std::ofstream out_;
  std::uint64_t written_ = 0;
};

}  // namespace amrtex
