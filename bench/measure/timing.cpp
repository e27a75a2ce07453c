#include "bench/measure/timing.hpp"

#include <benchmark/benchmark.h>

namespace amrtex {
namespace {

/// Frames are kept by the benchmark function itself; nothing is printed.
class Silent final : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>&) override {}
};

}  // namespace

std::vector<FrameTime> time_frames(Consumer& consumer, int warm_up, int frames) {
  std::vector<FrameTime> times;
  for (int i = 0; i < warm_up; ++i) consumer.draw();
  if (frames <= 0) return times;
  benchmark::ClearRegisteredBenchmarks();
  benchmark::RegisterBenchmark("frame",
                               [&](benchmark::State& state) {
                                 for (auto _ : state) {
                                   times.push_back(consumer.draw());
                                   state.SetIterationTime(times.back().wall_ms / 1000);
                                 }
                               })
      ->UseManualTime()
      ->Iterations(1)
      ->Repetitions(frames);
  Silent reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter, "frame");
  benchmark::ClearRegisteredBenchmarks();
  return times;
}

}  // namespace amrtex
