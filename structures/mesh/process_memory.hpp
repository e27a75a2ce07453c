// How much memory this process has held.
#pragma once

#include <cstdint>
#include <optional>

namespace amrtex {

/// Most bytes that this process has held in memory; absent where the system does not say. Not getrusage(), which begins with the
/// most of the process that started this one.
std::optional<std::int64_t> process_peak_bytes();

}  // namespace amrtex
