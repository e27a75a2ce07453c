#include "structures/mesh/process_memory.hpp"

#include <fstream>
#include <string>
#include <string_view>

namespace amrtex {

std::optional<std::int64_t> process_peak_bytes() {
  std::ifstream in("/proc/self/status");
  constexpr std::string_view key = "VmHWM:";
  for (std::string line; std::getline(in, line);)
    if (line.starts_with(key)) return std::stoll(line.substr(key.size())) * 1024;  // in kB, as the system calls them
  return std::nullopt;
}

}  // namespace amrtex
