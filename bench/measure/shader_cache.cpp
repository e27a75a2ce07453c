#include "bench/measure/shader_cache.hpp"

#include <stdlib.h>  // setenv

#include <string>

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// The variable's value, which it receives here where it has none.
std::string settled(const char* variable, const fs::path& folder) {
  setenv(variable, folder.c_str(), 0);
  return ::getenv(variable);
}

bool holds_files(const fs::path& folder) {
  std::error_code absent;
  for (const auto& entry : fs::recursive_directory_iterator(folder, absent))
    if (entry.is_regular_file(absent)) return true;
  return false;
}

bool is_off() {
  const char* disabled = ::getenv("MESA_SHADER_CACHE_DISABLE");
  return disabled != nullptr && (std::string_view(disabled) == "true" || std::string_view(disabled) == "1");
}

}  // namespace

std::string_view use_shader_cache(const fs::path& folder) {
  std::error_code ignored;  // a driver without a folder compiles each time: cold, as is said
  fs::create_directories(folder, ignored);
  const fs::path absolute = fs::absolute(folder);
  const bool mesa_has = holds_files(settled("MESA_SHADER_CACHE_DIR", absolute));
  const bool nvidia_has = holds_files(settled("__GL_SHADER_DISK_CACHE_PATH", absolute));
  return !is_off() && (mesa_has || nvidia_has) ? "warm" : "cold";
}

}  // namespace amrtex
