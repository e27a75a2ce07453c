// Several arrays in one file of NumPy's: a zip of .npy files.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "structures/mesh/npy.hpp"

namespace amrtex {

/// Compressed; equal arrays give equal bytes. Throws OutputError.
void write_npz(const std::filesystem::path& path, const std::map<std::string, NpyArray>& arrays);

/// Throws Error with the path for what is no such file or damaged.
std::map<std::string, NpyArray> read_npz(const std::filesystem::path& path);

}  // namespace amrtex
