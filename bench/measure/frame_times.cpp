#include "bench/measure/frame_times.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "bench/measure/gpu_timing.hpp"
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

/// Draws before anything is timed. A GPU raises its clock while it works: there they go on until times are steady.
WarmUp warm_up(const RenderPoint& render, Consumer& consumer, bool on_gpu) {
  if (on_gpu) return warm_up_until_steady(render.warm_up, [&] { return consumer.draw().wall_ms; });
  for (int i = 0; i < render.warm_up; ++i) consumer.draw();
  return {render.warm_up, false};
}

Json gpu_part(const RenderPoint& render, Consumer& consumer, Context& context, const std::string& refusal) {
  const std::optional<TimerQuality> timer = refusal.empty() ? measure_timer(context) : std::nullopt;
  if (!timer || render.frames <= 0) return refused_gpu_frame_json(refusal.empty() ? "no frames are timed" : refusal);
  return gpu_frame_json(time_on_gpu(consumer, render.frames, *timer, GpuStateReader(context.info())));
}

Json frame_json(const std::vector<FrameTime>& frames, const WarmUp& warmed, bool on_gpu) {
  std::vector<double> wall;
  for (const FrameTime& f : frames) wall.push_back(f.wall_ms);
  Json frame;
  frame["wall_ms"] = timing_json(wall);
  frame["all_wall_ms"] = wall;
  frame["warm_up"] = warmed.draws;
  frame["steady"] = on_gpu ? Json(warmed.steady) : Json();
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

FrameTimes time_point(const RenderPoint& render, Consumer& consumer, Consumer* baseline, Context& context) {
  const std::string refusal = timer_refusal(context.info());
  WarmUp warmed;
  std::vector<FrameTime> frames;
  BaselineTimes beside;
  for (int tries = 0; tries < kTimingTries; ++tries) {
    beside.before = baseline_ms(baseline);
    warmed = warm_up(render, consumer, refusal.empty());
    frames = time_frames(consumer, 0, render.frames);
    beside.after = baseline_ms(baseline);
    if (baseline == nullptr || beside.agree()) break;
  }
  FrameTimes times{frame_json(frames, warmed, refusal.empty()), ""};
  times.frame.update(gpu_part(render, consumer, context, refusal));
  if (baseline == nullptr) return times;
  times.frame["baseline_ms"] = {beside.before, beside.after};
  times.frame["relative"] = times.frame.at("wall_ms").at("median").get<double>() / beside.mean();
  if (!beside.agree())
    times.warning = fmt::format("the baseline took {:.1f} ms before and {:.1f} ms after: other work disturbed this time",
                                beside.before, beside.after);
  return times;
}

}  // namespace amrtex
