// A bundle brings the C++ library of the machine that it was built on. A driver of a newer machine may need a newer one, and a
// process can hold only one of them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace amrtex {

/// Starts the program again with the machine's C++ library where this process holds an older one beside itself; else returns.
/// To be called before anything is done.
void prefer_newer_cpp_library(char** argv);

/// What to preload in place of `loaded`: libstdc++.so.6 of the first of these folders that has one of a higher version, and the
/// libgcc_s.so.1 beside it. Empty where there is none.
std::string newer_cpp_libraries(const std::filesystem::path& loaded, const std::vector<std::filesystem::path>& folders);

}  // namespace amrtex
