// A data file that is read in pieces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

namespace amrtex {

/// Opened for reads at any position, from any thread.
class DataFile {
 public:
  /// Throws Error where it cannot be opened.
  explicit DataFile(const std::filesystem::path& path);
  ~DataFile();
  DataFile(const DataFile&) = delete;
  DataFile& operator=(const DataFile&) = delete;

  /// Throws Error where so many bytes from `offset` on cannot be read.
  void read(std::uint64_t offset, std::byte* out, std::size_t bytes) const;

 private:
  std::string path_;
  int descriptor_;
};

}  // namespace amrtex
