// Times of GPU timer queries: what is decided about them, and how they are taken (bench/README.md, "Times of a GPU").
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "bench/measure/gpu_state.hpp"
#include "renderers/consumers/consumer.hpp"
#include "renderers/gpu/gpu_timer.hpp"

namespace amrtex {

/// Draws inside one query: 1 for frames of a millisecond and more, else as many as make 5 ms, at most 4096.
int draws_per_query(double frame_ms);

/// Have times settled? The last five lie within 5 % of their median.
bool is_steady(std::span<const double> times);

/// Which samples were taken under another clock than most: more than 2 % off the median of all clocks. A sample without a clock
/// counts as the others do.
std::vector<bool> under_other_clock(std::span<const std::optional<double>> clocks_mhz);

struct WarmUp {
  int draws = 0;
  bool steady = false;
};
/// Draws at least `least` times, then until times are steady: at most 60 times or two seconds more.
WarmUp warm_up_until_steady(int least, const std::function<double()>& draw_ms);

/// GPU times of a consumer, in milliseconds a draw.
struct GpuTimes {
  int draws_per_query = 1;
  std::vector<double> samples_ms;
  std::vector<std::optional<double>> clocks_mhz;  ///< right after each sample
  GpuState before, after;
  TimerQuality timer;
};
/// Waits for each query, reads nothing back. Call it where timer_refusal() is empty.
GpuTimes time_on_gpu(Consumer& consumer, int samples, const TimerQuality& timer, const GpuStateReader& reader);

/// `gpu_ms` of a record (the samples under the common clock), and what stands beside it: `all_gpu_ms`, `other_clock`,
/// `samples_under_other_clock`, `draws_per_query`, `gpu_timer`, `gpu_clock_mhz`, `gpu_before`, `gpu_after`.
Json gpu_frame_json(const GpuTimes& times);
/// The same keys without times, and `gpu_refused`.
Json refused_gpu_frame_json(const std::string& reason);

}  // namespace amrtex
