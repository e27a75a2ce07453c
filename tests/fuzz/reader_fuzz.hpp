// A fuzz target: a small data set, one of whose files is replaced.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace amrtex::fuzz {

/// Of one target: writes a small data set into an empty folder and returns the path that a reader is given.
std::filesystem::path write_seed(const std::filesystem::path& folder);

struct SeedFile {
  std::filesystem::path path;
  std::string bytes;
};

/// The data set of the target, in a folder that is removed at the end of the process.
class Seed {
 public:
  Seed();
  ~Seed();
  Seed(const Seed&) = delete;
  Seed& operator=(const Seed&) = delete;

  const std::vector<SeedFile>& files() const { return files_; }
  /// Reads the data set with these bytes in place of a file's. Returns whether it was a mesh; what is refused with an Error is
  /// none. Anything else leaves this function.
  bool read_with(std::size_t file, std::string_view bytes) const;

 private:
  std::filesystem::path folder_;
  std::filesystem::path data_;
  std::vector<SeedFile> files_;
};

}  // namespace amrtex::fuzz
