// Where the time of a run goes.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "structures/mesh/json.hpp"

namespace amrtex {

enum class Share { frames, warm_up, compilation, references, builds, uploads, reading };
inline constexpr std::array<std::string_view, 7> kShareNames = {"measured frames", "warm-up and baseline", "compilation and checks",
                                                                "references",      "builds",               "uploads",
                                                                "reading"};

/// Seconds by share; what is left of a run's time is the harness's own.
struct TimeShares {
  std::array<double, kShareNames.size()> seconds{};

  void add(Share share, double more) { seconds[static_cast<std::size_t>(share)] += more; }
  void add(const TimeShares& other) {
    for (std::size_t i = 0; i < seconds.size(); ++i) seconds[i] += other.seconds[i];
  }
  double sum() const {
    double all = 0;
    for (const double s : seconds) all += s;
    return all;
  }
};

inline Json to_json(const TimeShares& shares) { return shares.seconds; }
inline TimeShares time_shares_from_json(const Json& json) { return {json.get<std::array<double, kShareNames.size()>>()}; }

}  // namespace amrtex
