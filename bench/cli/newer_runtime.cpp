#include "bench/cli/newer_runtime.hpp"

#include <dlfcn.h>
#include <stdlib.h>  // setenv
#include <unistd.h>

#include <charconv>
#include <exception>

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPreload = "LD_PRELOAD";
constexpr const char* kStartedAgain = "AMRTEX_CPP_LIBRARY";  // so that it happens once

/// 30 of "libstdc++.so.6.0.30", which is what the name without a version links to.
std::optional<int> version_of(const fs::path& library) {
  std::error_code failure;
  const std::string name = fs::canonical(library, failure).filename().string();
  const std::size_t dot = name.rfind('.');
  if (failure || dot == std::string::npos) return std::nullopt;
  int version = 0;
  const auto [end, error] = std::from_chars(name.data() + dot + 1, name.data() + name.size(), version);
  if (error != std::errc() || end != name.data() + name.size()) return std::nullopt;
  return version;
}

}  // namespace

std::string newer_cpp_libraries(const fs::path& loaded, const std::vector<fs::path>& folders) {
  const std::optional<int> ours = version_of(loaded);
  for (const fs::path& folder : folders) {
    const std::optional<int> theirs = version_of(folder / "libstdc++.so.6");
    if (!ours || !theirs || *theirs <= *ours) continue;
    const fs::path beside = folder / "libgcc_s.so.1";
    std::error_code failure;
    return (folder / "libstdc++.so.6").string() + (fs::exists(beside, failure) ? ":" + beside.string() : "");
  }
  return "";
}

void prefer_newer_cpp_library(char** argv) {
  if (::getenv(kStartedAgain) != nullptr) return;
  std::error_code failure;
  const fs::path program = fs::read_symlink("/proc/self/exe", failure);
  Dl_info library{};
  if (failure || ::dladdr(reinterpret_cast<const void*>(&std::terminate), &library) == 0 || library.dli_fname == nullptr) return;
  const fs::path loaded = fs::canonical(library.dli_fname, failure);
  const fs::path own = fs::canonical(program.parent_path().parent_path() / "lib" / "amrtex", failure);
  if (failure || loaded.parent_path() != own) return;
  const std::string newer =
      newer_cpp_libraries(loaded, {"/usr/lib/x86_64-linux-gnu", "/lib/x86_64-linux-gnu", "/usr/lib64", "/lib64", "/usr/lib"});
  if (newer.empty()) return;
  const char* before = ::getenv(kPreload);
  ::setenv(kPreload, (before != nullptr && *before != '\0' ? newer + ":" + before : newer).c_str(), 1);
  ::setenv(kStartedAgain, newer.c_str(), 1);
  ::execv(program.c_str(), argv);  // where it fails, the program goes on as it is
}

}  // namespace amrtex
