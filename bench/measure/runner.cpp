#include "bench/measure/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <random>
#include <vector>

#include "bench/measure/change_time.hpp"
#include "bench/measure/description.hpp"
#include "bench/measure/environment.hpp"
#include "bench/measure/frame_times.hpp"
#include "bench/measure/judgement.hpp"
#include "bench/measure/left_out_time.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/measure/shader_cache.hpp"
#include "bench/measure/stopwatch.hpp"
#include "bench/measure/value_resolution.hpp"
#include "bench/records/record.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/make_consumer.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr int kChanges = 20;

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
  return {Status::failed, error.what()};
}

/// Records of schema 1 are named by less than what decides a point, so a run could take one for another.
void refuse_first_schema(const fs::path& folder) {
  if (const auto record = record_of_first_schema(folder))
    throw UsageError(fmt::format(
        "output folder {}: {} is of schema {}, which a run does not go on from; accepted: another folder for --out, or this one "
        "without its folder `records` (`amrtex report` still makes tables of them)",
        folder.string(), record->filename().string(), kFirstSchema));
}

/// The data set that is measured at the moment, with the baseline of its points.
struct Current {
  Current(const Experiment& experiment, std::size_t dataset, Context& context)
      : data(experiment, dataset), baseline(experiment, dataset, data.mesh(), context) {}

  LoadedData data;
  Baseline baseline;
};

class Runner {
 public:
  Runner(const Experiment& experiment, const RunOptions& options)
      : experiment_(experiment),
        options_(options),
        conditions_{options.shader_cache.empty() ? Json() : Json(use_shader_cache(options.shader_cache)), implementation_hash()},
        context_(make_context(parse_context_kind(experiment.context))) {}

  RunSummary run() {
    for (const BuildPoint* build : measuring_order()) run_build(*build);
    return summary_;
  }

 private:
  /// The builds of each data set, shuffled by the seed: what drifts with time must not favour
  /// an encoding because of its place in the file.
  std::vector<const BuildPoint*> measuring_order() const {
    std::vector<const BuildPoint*> order;
    for (const BuildPoint& build : experiment_.builds) order.push_back(&build);
    std::mt19937_64 random(experiment_.seed);
    for (std::size_t i = order.size(); i > 1; --i) {
      const std::size_t j = random() % i;
      if (order[i - 1]->dataset == order[j]->dataset) std::swap(order[i - 1], order[j]);
    }
    return order;
  }

  void load(std::size_t dataset) {
    if (current_ && data().dataset() == dataset) return;
    current_.reset();
    current_.emplace(experiment_, dataset, *context_);
  }

  LoadedData& data() { return current_->data; }
  const AmrHierarchy& mesh() const { return current_->data.mesh(); }

  /// Is the point's record there, drawn by this program's shaders and builders?
  bool is_kept(const std::string& hash) const {
    if (options_.force) return false;
    return options_.keep_old ? has_record(options_.folder, hash)
                             : has_record_of(options_.folder, hash, conditions_.implementation);
  }

  void run_build(const BuildPoint& build) {
    load(build.dataset);
    std::vector<const RenderPoint*> open;
    for (const RenderPoint& render : experiment_.renders) {
      if (options_.wanted && !options_.wanted(build, render)) continue;
      if (is_kept(data().point_hash(build, render)))
        ++summary_.kept;
      else
        open.push_back(&render);
    }
    // a structure holds what its scenes need and nothing else, so each need has its own build
    while (!open.empty()) {
      const auto differ = std::stable_partition(open.begin(), open.end(),
                                                [&](const RenderPoint* r) { return equal_needs(build, *r, *open.front()); });
      measure_all(build, {open.begin(), differ});
      open.erase(open.begin(), differ);
    }
  }

  bool equal_needs(const BuildPoint& build, const RenderPoint& a, const RenderPoint& b) const {
    const Scene first = scene_of(experiment_, a);
    const Scene second = scene_of(experiment_, b);
    return scene_needs(first, build.filter, build.filtering) == scene_needs(second, build.filter, build.filtering) &&
           more_fields(mesh(), first) == more_fields(mesh(), second);
  }

  /// Render points of equal needs.
  void measure_all(const BuildPoint& build, const std::vector<const RenderPoint*>& renders) {
    std::unique_ptr<Built> built;
    try {
      built = build_structure(experiment_, build, mesh(), scene_of(experiment_, *renders.front()), *context_);
      if (experiment_.explain_left_out)
        time_left_out(find_encoding(build.encoding), mesh(), built->structure.request, built->structure.field);
    } catch (const UsageError&) {
      throw;  // a bad parameter concerns the whole experiment
    } catch (const std::exception& error) {
      for (const RenderPoint* render : renders) record_failure(build, *render, failure_of(error));
      return;
    }
    for (const RenderPoint* render : renders) {
      options_.progress(fmt::format("{} {} {} {}", build.encoding, build.parameters.dump(), filter_name(build.filter),
                                    render_json(*render).dump()));
      try {
        measure(build, *built, *render);
      } catch (const UsageError&) {
        throw;
      } catch (const std::exception& error) {
        record_failure(build, *render, failure_of(error));
      }
    }
  }

  void measure(const BuildPoint& build, Built& built, const RenderPoint& render) {
    const Scene scene = scene_of(experiment_, render);
    const Stopwatch first;
    const auto consumer = make_consumer(*context_, mesh(), built.structure, scene);
    consumer->draw();
    const double first_frame_ms = first.seconds() * 1000;
    const Picture picture = consumer->read();

    Json record = blank_record(Status::ok);
    describe_point(record, experiment_, data(), build, render, context_->info(), conditions_);
    describe_structure(record, built, mesh());
    record["first_frame_ms"] = first_frame_ms;
    if (!scene.settings.triangles.empty()) record["triangle_seconds"] = consumer->triangle_seconds();
    record["image_hash"] = picture_hash(picture);
    record["context"]["shader_hash"] = consumer->shader_hash();
    if (const ValueResolution resolution = value_resolution(built.structure.field, scene); !resolution.fine()) {
      record["value_resolution"] = resolution.json();
      for (const std::string& text : resolution.warnings()) warn(record, text);
    }
    add_warnings(record, scene, *consumer);
    const std::optional<Judgement> own =
        add_errors(record, {experiment_, data(), built.structure, *context_, scene, picture, options_.folder / "references"});
    if (!add_check(record, experiment_, build, scene.settings, own)) {
      write(build, render, record);
      return;  // a wrong picture gets no time
    }
    write_png(picture, picture_path(build, render));
    add_work(record, *consumer);
    if (render.frames > 0) add_times(record, render, *consumer);
    if (experiment_.time_change) add_change(record, built, scene);
    write(build, render, record);
  }

  void add_warnings(Json& record, const Scene& scene, const Consumer& consumer) const {
    for (const std::string& text : scene_warnings(mesh(), scene)) warn(record, text);
    if (scene.settings.slice_target == SliceTarget::rgba8)
      warn(record, "slices were blended in 8 bits a channel (slice_target rgba8): a historical control");
    if (!consumer.transfer_exact())
      warn(record, "the transfer function has more than 16 points: it is drawn from a table of 4096 bins");
  }

  static void add_work(Json& record, Consumer& consumer) {
    const WorkCounts work = consumer.count();
    record["work"] = {{"rays", work.rays},
                      {"samples", work.samples},
                      {"regions", work.regions},
                      {"regions_skipped", work.regions_skipped},
                      {"passes", work.passes}};
  }

  void add_times(Json& record, const RenderPoint& render, Consumer& consumer) {
    const FrameTimes times = time_point(render, consumer, current_->baseline.beside(render), context_->info().software);
    record["frame"] = times.frame;
    if (!times.warning.empty()) warn(record, times.warning);
  }

  void add_change(Json& record, const Built& built, const Scene& scene) {
    try {
      const ChangeTimes change = time_changes(*context_, mesh(), built.structure, scene, kChanges);
      record["change"] = {{"wall_ms", timing_json(change.wall_ms)}, {"bytes", change.bytes}};
    } catch (const UnsupportedError& error) {
      record["change"] = nullptr;
      warn(record, error.what());
    }
  }

  void record_failure(const BuildPoint& build, const RenderPoint& render, const Failure& failure) {
    Json record = blank_record(failure.status, failure.reason);
    describe_point(record, experiment_, data(), build, render, context_->info(), conditions_);
    if (failure.needed_bytes > 0) record["needed_bytes"] = failure.needed_bytes;
    write(build, render, record);
  }

  void write(const BuildPoint& build, const RenderPoint& render, const Json& record) {
    const std::string hash = data().point_hash(build, render);
    const bool outdated = has_record(options_.folder, hash) && !is_kept(hash);
    write_record(options_.folder, hash, record, options_.force || outdated);
    const std::string status = record.at("status");
    if (status == "ok")
      ++summary_.measured;
    else if (status == "unsupported")
      ++summary_.unsupported;
    else if (status == "over_budget")
      ++summary_.over_budget;
    else
      ++summary_.failed;
  }

  fs::path picture_path(const BuildPoint& build, const RenderPoint& render) {
    fs::create_directories(options_.folder / "pictures");
    return options_.folder / "pictures" / (data().point_hash(build, render) + ".png");
  }

  const Experiment& experiment_;
  const RunOptions& options_;
  RunConditions conditions_;  ///< before the context, which finds the folder of shaders when it is made
  std::unique_ptr<Context> context_;
  RunSummary summary_;
  std::optional<Current> current_;
};

}  // namespace

RunSummary run_experiment(const Experiment& experiment, const RunOptions& options) {
  std::error_code error;
  fs::create_directories(options.folder, error);
  if (error) throw Error(fmt::format("output folder {}: {}", options.folder.string(), error.message()));
  refuse_first_schema(options.folder);
  Experiment settled = experiment;  // records are named by what was really used
  if (options.context) settled.context = context_kind_name(*options.context);
  if (options.memory_limit) settled.memory_limit = options.memory_limit;
  return Runner(settled, options).run();
}

}  // namespace amrtex
