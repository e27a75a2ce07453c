#include "bench/measure/gpu_timing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"

namespace amrtex {
namespace {

constexpr double kShortFrame = 1;  // ms; below, one draw is no measure
constexpr double kLeastQuery = 5;  // ms
constexpr int kMostDraws = 4096;
constexpr std::size_t kSteadyFrames = 5;
constexpr double kSteadySpread = 0.05;
constexpr double kSameClock = 0.02;
constexpr int kMostWarmUp = 60;
constexpr std::chrono::seconds kLongestWarmUp{2};

}  // namespace

int draws_per_query(double frame_ms) {
  if (!(frame_ms < kShortFrame)) return 1;
  const double draws = std::ceil(kLeastQuery / std::max(frame_ms, kLeastQuery / kMostDraws));
  return std::clamp(static_cast<int>(draws), 1, kMostDraws);
}

bool is_steady(std::span<const double> times) {
  if (times.size() < kSteadyFrames) return false;
  const std::vector<double> last(times.end() - static_cast<std::ptrdiff_t>(kSteadyFrames), times.end());
  const auto [least, most] = std::minmax_element(last.begin(), last.end());
  const double middle = median(last);
  return *most - middle <= kSteadySpread * middle && middle - *least <= kSteadySpread * middle;
}

std::vector<bool> under_other_clock(std::span<const std::optional<double>> clocks_mhz) {
  std::vector<double> known;
  for (const std::optional<double>& clock : clocks_mhz)
    if (clock) known.push_back(*clock);
  std::vector<bool> other(clocks_mhz.size(), false);
  if (known.empty()) return other;
  const double common = median(known);
  for (std::size_t i = 0; i < clocks_mhz.size(); ++i)
    other[i] = clocks_mhz[i] && std::abs(*clocks_mhz[i] - common) > kSameClock * common;
  return other;
}

WarmUp warm_up_until_steady(int least, const std::function<double()>& draw_ms) {
  std::vector<double> times;
  WarmUp result;
  for (; result.draws < least; ++result.draws) times.push_back(draw_ms());
  const auto end = std::chrono::steady_clock::now() + kLongestWarmUp;
  while (!is_steady(times) && result.draws < least + kMostWarmUp && std::chrono::steady_clock::now() < end) {
    times.push_back(draw_ms());
    ++result.draws;
  }
  result.steady = is_steady(times);
  return result;
}

GpuTimes time_on_gpu(Consumer& consumer, int samples, const TimerQuality& timer, const GpuStateReader& reader) {
  GpuTimes times;
  times.timer = timer;
  times.before = reader.read();
  times.draws_per_query = draws_per_query(consumer.gpu_ms_a_draw(1));
  for (int i = 0; i < samples; ++i) {
    times.samples_ms.push_back(consumer.gpu_ms_a_draw(times.draws_per_query));
    times.after = reader.read();
    times.clocks_mhz.push_back(times.after.clock_mhz);
  }
  return times;
}

Json gpu_frame_json(const GpuTimes& times) {
  const std::vector<bool> other = under_other_clock(times.clocks_mhz);
  std::vector<double> kept;
  Json clocks = Json::array();
  for (std::size_t i = 0; i < times.samples_ms.size(); ++i) {
    if (!other[i]) kept.push_back(times.samples_ms[i]);
    clocks.push_back(times.clocks_mhz[i] ? Json(*times.clocks_mhz[i]) : Json());
  }
  return {{"gpu_ms", kept.empty() ? Json() : timing_json(kept)},
          {"all_gpu_ms", times.samples_ms},
          {"other_clock", other},
          {"samples_under_other_clock", std::count(other.begin(), other.end(), true)},
          {"draws_per_query", times.draws_per_query},
          {"gpu_timer", {{"resolution_ns", times.timer.resolution_ns}, {"overhead_ns", times.timer.overhead_ns}}},
          {"gpu_clock_mhz", clocks},
          {"gpu_before", to_json(times.before)},
          {"gpu_after", to_json(times.after)},
          {"gpu_refused", nullptr}};
}

Json refused_gpu_frame_json(const std::string& reason) {
  Json json = {{"gpu_ms", nullptr}, {"draws_per_query", nullptr}};
  json["gpu_refused"] = reason;
  return json;
}

}  // namespace amrtex
