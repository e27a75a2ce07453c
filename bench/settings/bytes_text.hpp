// Amounts of memory as people write them.
#pragma once

#include <cstdint>
#include <string>

namespace amrtex {

/// "512MiB", "2GiB", "1000000". Throws UsageError.
std::int64_t parse_bytes(const std::string& text);

}  // namespace amrtex
