#include "bench/measure/environment.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <fstream>
#include <string_view>
#include <thread>
#include <vector>

#include "build_info.hpp"  // made by build_info.cmake at every build

namespace amrtex {
namespace {

std::string compiler_name() {
#if defined(__clang__)
  return "Clang " __clang_version__;
#elif defined(__GNUC__)
  return "GCC " __VERSION__;
#else
  return "unknown";
#endif
}

bool concerns_driver(std::string_view variable) {
  constexpr std::array<std::string_view, 7> prefixes = {"MESA_", "LP_", "GALLIUM_", "LIBGL_", "EGL_", "VK_", "ZINK_"};
  if (variable.starts_with("MESA_SHADER_CACHE_DIR=")) return false;
  return std::any_of(prefixes.begin(), prefixes.end(), [&](std::string_view prefix) { return variable.starts_with(prefix); });
}

}  // namespace

BuildInfo build_info() {
  BuildInfo info;
  info.build_type = kBuildType;
  info.compiler = compiler_name();
  if (!kBuildCommit.empty()) info.commit = kBuildCommit;
  if (!kBuildDirty.empty()) info.dirty = kBuildDirty == "true";
  return info;
}

std::string implementation_hash() { return std::string(kImplementation); }

std::optional<std::string> cpu_name() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with("model name")) continue;
    const std::size_t begin = line.find_first_not_of(" \t", line.find(':') + 1);
    if (begin != std::string::npos) return line.substr(begin);
  }
  return std::nullopt;
}

Json driver_variables() {
  std::vector<std::pair<std::string, std::string>> variables;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string_view text = *entry;
    const std::size_t equals = text.find('=');
    if (equals != std::string_view::npos && concerns_driver(text))
      variables.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  std::sort(variables.begin(), variables.end());
  Json json = Json::object();
  for (const auto& [name, value] : variables) json[name] = value;
  return json;
}

std::string utc_date() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  const std::size_t length = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return std::string(text.data(), length);
}

Json context_json() {
  const BuildInfo build = build_info();
  const std::optional<std::string> cpu = cpu_name();
  const unsigned cores = std::thread::hardware_concurrency();  // 0 = not known
  return {{"renderer", nullptr},
          {"device", nullptr},
          {"gl_version", nullptr},
          {"extensions_missing", nullptr},
          {"cpu", cpu ? Json(*cpu) : Json()},
          {"cores", cores > 0 ? Json(cores) : Json()},
          {"environment", driver_variables()},
          {"build_type", build.build_type.empty() ? Json() : Json(build.build_type)},
          {"compiler", build.compiler},
          {"commit", build.commit ? Json(*build.commit) : Json()},
          {"dirty", build.dirty ? Json(*build.dirty) : Json()},
          {"shader_hash", nullptr},
          {"shader_cache", nullptr},
          {"date", utc_date()}};
}

}  // namespace amrtex
