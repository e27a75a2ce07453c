#include "bench/measure/frame_times.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "bench/measure/timing.hpp"
#include "bench/numbers/baseline_drift.hpp"
#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"
#include "renderers/consumers/make_consumer.hpp"

namespace amrtex {
namespace {

constexpr int kBaselineFrames = 3;
constexpr int kTimingTries = 4;

/// Milliseconds of the baseline before a point and after it.
struct BaselineTimes {
  double before = 0;
  double after = 0;

  bool agree() const { return baselines_agree(before, after); }
  double mean() const { return (before + after) / 2; }
};

double baseline_ms(Consumer* baseline) {
  if (baseline == nullptr) return 0;
  std::vector<double> wall;
  for (const FrameTime& f : time_frames(*baseline, 1, kBaselineFrames)) wall.push_back(f.wall_ms);
  return median(wall);
}

Json frame_json(const RenderPoint& render, const std::vector<FrameTime>& frames, bool software) {
  std::vector<double> wall;
  std::vector<double> gpu;
  for (const FrameTime& f : frames) {
    wall.push_back(f.wall_ms);
    gpu.push_back(f.gpu_ms);
  }
  Json frame;
  frame["wall_ms"] = timing_json(wall);
  frame["gpu_ms"] = software ? Json() : timing_json(gpu);  // there the timer tells of the last tile alone
  frame["all_wall_ms"] = wall;
  frame["warm_up"] = render.warm_up;
  frame["baseline_ms"] = nullptr;
  frame["relative"] = nullptr;
  return frame;
}

}  // namespace

std::unique_ptr<Built> Baseline::build(const Scene& scene) const {
  const auto first = std::find_if(experiment_.builds.begin(), experiment_.builds.end(),
                                  [&](const BuildPoint& b) { return b.dataset == dataset_; });
  try {
    return build_structure(experiment_, *first, mesh_, scene, context_);
  } catch (const Error& error) {
    throw UsageError(
        fmt::format("{}: baseline: the first of all points cannot be drawn: {}; accepted: another order of encodings and filters",
                    experiment_.file.string(), error.what()));
  }
}

Consumer* Baseline::beside(const RenderPoint& render) {
  if (!experiment_.baseline) return nullptr;
  RenderPoint settings = experiment_.renders.front();
  settings.view = render.view;
  settings.view_name = render.view_name;
  settings.transfer_function = render.transfer_function;
  settings.transfer_function_name = render.transfer_function_name;
  settings.more_fields = render.more_fields;
  const std::string key = render_json(settings).dump();
  if (!built_) built_ = build(scene_of(experiment_, settings));
  if (!consumer_ || key != drawn_) {
    consumer_ = make_consumer(context_, mesh_, built_->structure, scene_of(experiment_, settings));
    drawn_ = key;
  }
  return consumer_.get();
}

FrameTimes time_point(const RenderPoint& render, Consumer& consumer, Consumer* baseline, bool software) {
  std::vector<FrameTime> frames;
  BaselineTimes beside;
  for (int tries = 0; tries < kTimingTries; ++tries) {
    beside.before = baseline_ms(baseline);
    frames = time_frames(consumer, render.warm_up, render.frames);
    beside.after = baseline_ms(baseline);
    if (baseline == nullptr || beside.agree()) break;
  }
  FrameTimes times{frame_json(render, frames, software), ""};
  if (baseline == nullptr) return times;
  times.frame["baseline_ms"] = {beside.before, beside.after};
  times.frame["relative"] = times.frame.at("wall_ms").at("median").get<double>() / beside.mean();
  if (!beside.agree())
    times.warning = fmt::format("the baseline took {:.1f} ms before and {:.1f} ms after: other work disturbed this time",
                                beside.before, beside.after);
  return times;
}

}  // namespace amrtex
