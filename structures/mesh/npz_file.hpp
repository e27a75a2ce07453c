// Several arrays in one file of NumPy's: a zip of .npy files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "structures/mesh/npy.hpp"

namespace amrtex {

/// Compressed; equal arrays give equal bytes. Throws OutputError.
void write_npz(const std::filesystem::path& path, const std::map<std::string, NpyArray>& arrays);

/// Throws Error with the path for what is no such file or damaged.
std::map<std::string, NpyArray> read_npz(const std::filesystem::path& path);

/// Reads arrays one after the other, and of a large one what is wanted: the whole of it need not fit into memory.
class NpzFile {
 public:
  /// Throws Error with the path for what is no such file.
  explicit NpzFile(const std::filesystem::path& path);
  ~NpzFile();
  NpzFile(NpzFile&&) noexcept;
  NpzFile& operator=(NpzFile&&) noexcept;

  bool has(const std::string& name) const;
  /// Of an array that is there, without its values.
  NpyHeader header(const std::string& name) const;
  NpyArray read(const std::string& name) const;
  /// Calls values(read), where each read(out, bytes) takes the next bytes of the array's values; null for `out` passes over
  /// them. Throws Error for what is damaged.
  using NextBytes = std::function<void(void* out, std::uint64_t bytes)>;
  void stream(const std::string& name, const std::function<void(const NextBytes&)>& values) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace amrtex
