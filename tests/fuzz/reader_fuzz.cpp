#include "tests/fuzz/reader_fuzz.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex::fuzz {
namespace {

namespace fs = std::filesystem;

void write(const fs::path& path, std::string_view bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

Seed::Seed() : folder_(fs::temp_directory_path() / fmt::format("amrtex_fuzz_{}", ::getpid())) {
  fs::remove_all(folder_);
  fs::create_directories(folder_);
  data_ = write_seed(folder_);
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder_))
    if (entry.is_regular_file()) {
      std::ifstream in(entry.path(), std::ios::binary);
      files_.push_back({entry.path(), {std::istreambuf_iterator<char>(in), {}}});
    }
  std::sort(files_.begin(), files_.end(), [](const SeedFile& a, const SeedFile& b) { return a.path < b.path; });
}

Seed::~Seed() { fs::remove_all(folder_); }

bool Seed::read_with(std::size_t file, std::string_view bytes) const {
  write(files_[file].path, bytes);
  bool is_mesh = true;
  try {
    AmrHierarchy(read_mesh(data_)).content_hash(0);
  } catch (const Error&) {
    is_mesh = false;
  }
  write(files_[file].path, files_[file].bytes);
  return is_mesh;
}

}  // namespace amrtex::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const amrtex::fuzz::Seed seed;
  if (size == 0) return 0;
  seed.read_with(data[0] % seed.files().size(), {reinterpret_cast<const char*>(data) + 1, size - 1});
  return 0;
}
