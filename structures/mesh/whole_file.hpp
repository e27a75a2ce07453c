// Files that are whole or not there, whatever happens while they are written.
#pragma once

#include <filesystem>
#include <string_view>

#include "structures/mesh/error.hpp"

namespace amrtex {

/// What is wrong with the place that something is written to: full, read-only, gone.
class OutputError : public Error {
 public:
  using Error::Error;
};

/// Writes all bytes and waits until they are on disk; 0, or the error number.
int write_all(int descriptor, std::string_view bytes);

/// Writes under a random name beside `target` that no other process can have, fsync, rename; what was there is replaced. Throws OutputError
/// naming the file.
void write_atomically(const std::filesystem::path& target, std::string_view bytes);

/// Makes a folder and those above it where they are not there. Throws OutputError.
void make_folder(const std::filesystem::path& folder);

/// Makes a rename in `folder` survive a power failure.
void sync_folder(const std::filesystem::path& folder);

/// Removes what write_atomically() left in `folder` when its process was killed. Only who has the folder for itself may ask.
void remove_unfinished_files(const std::filesystem::path& folder);

}  // namespace amrtex
