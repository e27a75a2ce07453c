#include "bench/measure/point_measurer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <new>

#include "bench/measure/change_time.hpp"
#include "bench/measure/environment.hpp"
#include "bench/measure/left_out_time.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/measure/stopwatch.hpp"
#include "bench/measure/value_resolution.hpp"
#include "bench/records/record.hpp"
#include "bench/records/stored_picture.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr int kChanges = 20;

/// Runs `work` and adds its time to a share.
template <class Work>
auto timed(TimeShares& shares, Share share, Work&& work) {
  struct Adder {
    TimeShares& shares;
    Share share;
    Stopwatch watch{};
    ~Adder() { shares.add(share, watch.seconds()); }
  } adder{shares, share};
  return work();
}

struct Failure {
  Status status;
  std::string reason;
  std::int64_t needed_bytes = 0;  ///< of what is over the budget, where they are known
};

/// Why a point could not be measured, from the exception that says so.
Failure failure_of(const std::exception& error) {
  if (dynamic_cast<const UnsupportedError*>(&error) != nullptr) return {Status::unsupported, error.what()};
  if (const auto* budget = dynamic_cast<const BudgetError*>(&error))
    return {Status::over_budget, error.what(), budget->needed_bytes()};
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) return {Status::failed, "out of memory"};
  return {Status::failed, error.what()};
}

/// What concerns more than one point.
bool ends_the_run(const std::exception& error) {
  return dynamic_cast<const UsageError*>(&error) != nullptr || dynamic_cast<const OutputError*>(&error) != nullptr;
}

void add_work(Json& record, Consumer& consumer) {
  const WorkCounts work = consumer.count();
  record["work"] = {{"rays", work.rays},
                    {"samples", work.samples},
                    {"regions", work.regions},
                    {"regions_skipped", work.regions_skipped},
                    {"passes", work.passes}};
}

}  // namespace

PointMeasurer::PointMeasurer(const Experiment& experiment, std::size_t dataset, MeasuringOptions options)
    : experiment_(experiment),
      options_(std::move(options)),
      data_(timed(shares_, Share::reading, [&] { return LoadedData(experiment, dataset); })),
      implementation_(implementation_hash()) {}

Context& PointMeasurer::context() {
  if (!context_) {
    context_ = make_context(parse_context(options_.context));
    baseline_ = std::make_unique<Baseline>(experiment_, data_.dataset(), data_.mesh(), *context_);
  }
  return *context_;
}

bool PointMeasurer::equal_needs(const BuildPoint& build, const RenderPoint& a, const RenderPoint& b) const {
  const Scene first = scene_of(experiment_, a);
  const Scene second = scene_of(experiment_, b);
  return scene_needs(first, build.filter, build.filtering) == scene_needs(second, build.filter, build.filtering) &&
         more_fields(data_.mesh(), first) == more_fields(data_.mesh(), second);
}

/// A structure holds what its scenes need and nothing else, so each need has its own.
std::vector<PlannedPoint> PointMeasurer::plan() {
  std::vector<PlannedPoint> points;
  for (std::size_t b = 0; b < experiment_.builds.size(); ++b) {
    const BuildPoint& build = experiment_.builds[b];
    if (build.dataset != data_.dataset()) continue;
    std::vector<std::size_t> first_of;  // a render point of each structure
    for (std::size_t r = 0; r < experiment_.renders.size(); ++r) {
      const RenderPoint& render = experiment_.renders[r];
      const auto same = std::find_if(first_of.begin(), first_of.end(),
                                     [&](std::size_t f) { return equal_needs(build, experiment_.renders[f], render); });
      const auto structure = static_cast<int>(same - first_of.begin());
      if (same == first_of.end()) first_of.push_back(r);
      points.push_back({b, r, data_.point_hash(build, render), structure});
    }
  }
  return points;
}

void PointMeasurer::draw_references(const std::vector<PlannedPoint>& points) {
  std::vector<AskedPoint> asked;
  for (const PlannedPoint& p : points) asked.push_back({experiment_.builds.at(p.build), experiment_.renders.at(p.render)});
  timed(shares_, Share::references, [&] { amrtex::draw_references(experiment_, data_, asked, options_.folder / "references"); });
}

std::unique_ptr<Built> PointMeasurer::build_for(const BuildPoint& build, const RenderPoint& render) {
  options_.phase(Phase::building);
  auto built = build_structure(experiment_, build, data_.mesh(), scene_of(experiment_, render), context());
  shares_.add(Share::builds, built->build_seconds);
  shares_.add(Share::uploads, built->upload_seconds);
  if (experiment_.explain_left_out)
    timed(shares_, Share::builds,
          [&] { time_left_out(find_encoding(build.encoding), data_.mesh(), built->structure.request, built->structure.field); });
  return built;
}

void PointMeasurer::measure(std::size_t build, const std::vector<std::size_t>& renders, int repetition,
                            const std::function<void(const Json&)>& done) {
  const BuildPoint& what = experiment_.builds.at(build);
  const auto render_at = [&](std::size_t r) -> const RenderPoint& { return experiment_.renders.at(r); };
  std::unique_ptr<Built> built;
  try {
    built = build_for(what, render_at(renders.front()));
  } catch (const std::exception& error) {
    if (ends_the_run(error)) throw;
    for (const std::size_t r : renders) done(failed(what, render_at(r), repetition, error));
    return;
  }
  for (const std::size_t r : renders) {
    Json record;
    try {
      record = measure_one(what, *built, render_at(r), repetition);
    } catch (const std::exception& error) {
      if (ends_the_run(error)) throw;
      record = failed(what, render_at(r), repetition, error);
    }
    done(record);
  }
  options_.phase(Phase::other);
}

void PointMeasurer::describe(Json& record, const BuildPoint& build, const RenderPoint& render, int repetition) {
  describe_point(record, experiment_, data_, build, render, context().info(), {options_.shader_cache, implementation_});
  record["repetition"] = repetition;
}

Json PointMeasurer::measure_one(const BuildPoint& build, Built& built, const RenderPoint& render, int repetition) {
  const Scene scene = scene_of(experiment_, render);
  options_.phase(Phase::drawing);
  const Stopwatch first;
  const auto consumer = make_consumer(context(), data_.mesh(), built.structure, scene);
  consumer->draw();
  const double first_frame_ms = first.seconds() * 1000;
  shares_.add(Share::compilation, first_frame_ms / 1000);
  const Picture picture = consumer->read();

  Json record = blank_record(Status::ok);
  describe(record, build, render, repetition);
  describe_structure(record, built, data_.mesh());
  add_leaps(record["memory"], consumer->leap_bytes());
  record["first_frame_ms"] = first_frame_ms;
  if (!scene.settings.triangles.empty()) record["triangle_seconds"] = consumer->triangle_seconds();
  record["image_hash"] = picture_hash(picture);
  record["context"]["shader_hash"] = consumer->shader_hash();
  if (const ValueResolution resolution = value_resolution(built.structure.field, scene); !resolution.fine()) {
    record["value_resolution"] = resolution.json();
    for (const std::string& text : resolution.warnings()) warn(record, text);
  }
  add_warnings(record, scene, *consumer);
  options_.phase(Phase::other);
  const std::optional<Judgement> own = timed(shares_, Share::references, [&] {
    return add_errors(record, {experiment_, data_, built.structure, context(), scene, picture, options_.folder / "references"});
  });
  if (!add_check(record, experiment_, build, scene.settings, own)) return record;  // a wrong picture gets no time
  // compressed while the counting shader is compiled, and there before anything is timed
  std::future<void> kept;
  if (options_.pictures)
    kept = std::async(std::launch::async,
                      [&, name = record["configuration"].get<std::string>()] { keep_picture(name, picture, own); });
  options_.phase(Phase::drawing);
  if (options_.count_work) timed(shares_, Share::compilation, [&] { add_work(record, *consumer); });
  if (kept.valid()) kept.get();
  if (render.frames > 0) add_times(record, render, *consumer);
  if (experiment_.time_change) add_change(record, built, scene);
  return record;
}

/// One to look at, and one to compute with.
void PointMeasurer::keep_picture(const std::string& name, const Picture& picture, const std::optional<Judgement>& own) const {
  make_folder(picture_folder(options_.folder));
  write_png(picture, picture_path(options_.folder, name, ".png"));
  StoredPicture stored{picture, std::nullopt};
  if (own) stored.difference = difference_of(picture, own->reference);
  write_stored_picture(picture_path(options_.folder, name), stored);
}

void PointMeasurer::add_warnings(Json& record, const Scene& scene, const Consumer& consumer) const {
  for (const std::string& text : scene_warnings(data_.mesh(), scene)) warn(record, text);
  if (scene.settings.slice_target == SliceTarget::rgba8)
    warn(record, "slices were blended in 8 bits a channel (slice_target rgba8): a historical control");
  if (!consumer.transfer_exact())
    warn(record, "the transfer function has more than 16 points of extinction or 32 of colour: it is drawn from a table of 4096 bins");
}

void PointMeasurer::add_times(Json& record, const RenderPoint& render, Consumer& consumer) {
  const Stopwatch all;
  // building the baseline counts against no point
  options_.phase(Phase::other);
  Consumer* const beside = baseline_->beside(render);
  options_.phase(Phase::drawing);
  const FrameTimes times = time_point(render, consumer, beside, context());
  double frames = 0;
  for (const Json& ms : times.frame.at("all_wall_ms")) frames += ms.get<double>() / 1000;
  shares_.add(Share::frames, frames);
  shares_.add(Share::warm_up, all.seconds() - frames);
  record["frame"] = times.frame;
  if (!times.warning.empty()) warn(record, times.warning);
}

void PointMeasurer::add_change(Json& record, const Built& built, const Scene& scene) {
  try {
    const ChangeTimes change =
        timed(shares_, Share::frames, [&] { return time_changes(context(), data_.mesh(), built.structure, scene, kChanges); });
    record["change"] = {{"wall_ms", timing_json(change.wall_ms)}, {"bytes", change.bytes}};
  } catch (const UnsupportedError& error) {
    record["change"] = nullptr;
    warn(record, error.what());
  }
}

Json PointMeasurer::failed(const BuildPoint& build, const RenderPoint& render, int repetition, const std::exception& error) {
  const Failure failure = failure_of(error);
  Json record = blank_record(failure.status, failure.reason);
  describe(record, build, render, repetition);
  if (failure.needed_bytes > 0) record["needed_bytes"] = failure.needed_bytes;
  return record;
}

Json PointMeasurer::failure(std::size_t build, std::size_t render, int repetition, std::string_view reason) {
  Json record = blank_record(Status::failed, reason);
  describe(record, experiment_.builds.at(build), experiment_.renders.at(render), repetition);
  return record;
}

}  // namespace amrtex
