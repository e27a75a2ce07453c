// How much a sweep has to do, from what is measured of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "bench/measure/runner.hpp"

namespace amrtex {

struct SweepEstimate {
  std::size_t points = 0;
  std::size_t structures = 0;  ///< different builds; those of one build whose scenes need different parts count once
  std::size_t open = 0;
  std::int64_t largest_bytes = 0;     ///< of structures that are measured; 0: none is
  std::optional<double> seconds = {};  ///< of the open points, each as long as the mean of those measured with its encoding, or of all
};

/// Records of a folder; none where it has no file of them.
std::vector<Json> load_known(const std::filesystem::path& folder);
SweepEstimate estimate(std::span<const ListedPoint> points, std::span<const Json> known, int repeat);

}  // namespace amrtex
