#include "bench/settings/bytes_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>

#include "structures/mesh/error.hpp"

namespace amrtex {

std::int64_t parse_bytes(const std::string& text) {
  std::size_t used = 0;
  double number = -1;
  try {
    number = std::stod(text, &used);
  } catch (const std::exception&) {
  }
  const std::string unit = text.substr(std::min(used, text.size()));
  double factor = 0;
  if (unit.empty() || unit == "B") factor = 1;
  if (unit == "KiB") factor = 1024;
  if (unit == "MiB") factor = 1024.0 * 1024;
  if (unit == "GiB") factor = 1024.0 * 1024 * 1024;
  if (!(number >= 0) || factor == 0 || number * factor > 9e18)
    throw UsageError(fmt::format("{} is no amount of memory; accepted: 500000, 64KiB, 512MiB, 2GiB", text));
  return static_cast<std::int64_t>(number * factor);
}

}  // namespace amrtex
