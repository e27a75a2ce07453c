#include "bench/measure/runner.hpp"

#include <fmt/format.h>

#include <chrono>
#include <map>
#include <memory>
#include <random>

#include "bench/measure/change_time.hpp"
#include "bench/measure/check_bound.hpp"
#include "bench/measure/environment.hpp"
#include "bench/measure/error_split.hpp"
#include "bench/measure/left_out_time.hpp"
#include "bench/measure/reference_cache.hpp"
#include "bench/measure/shader_cache.hpp"
#include "bench/numbers/image_error.hpp"
#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "renderers/gpu/structure.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "renderers/scene/triangle_mesh.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/mesh/exact_hash.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// Two readings of the baseline that differ by more say that the machine was busy.
constexpr double kBaselineDrift = 0.15;
constexpr int kBaselineFrames = 3;
constexpr int kTimingTries = 4;
constexpr int kChanges = 20;

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// A structure on the context, with what was measured on the way there.
struct Built {
  Structure structure;
  double build_seconds = 0;
  double upload_seconds = 0;
};

/// A picture before its own reference.
struct Judgement {
  ErrorMetrics error;
  Picture reference;
};

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

/// Largest difference of the channels of each pixel that is not empty in both pictures, ascending: where the field is small on
/// the picture, most pixels are empty and exact. One 0 where all are.
std::vector<double> seen_errors(const Picture& picture, const Picture& reference) {
  std::vector<double> errors;
  const auto channels = static_cast<std::size_t>(picture.channels);
  for (std::size_t pixel = 0; pixel < picture.values.size(); pixel += channels) {
    double error = 0;
    bool empty = true;
    for (std::size_t i = pixel; i < pixel + channels; ++i) {
      error = std::max(error, std::abs(picture.values[i] - reference.values[i]));
      empty = empty && picture.values[i] == 0 && reference.values[i] == 0;
    }
    if (!empty) errors.push_back(error);
  }
  if (errors.empty()) errors.push_back(0);
  std::sort(errors.begin(), errors.end());
  return errors;
}

Json json_or_null(const std::optional<std::int64_t>& value) { return value ? Json(*value) : Json(); }

/// Records of schema 1 are named by less than what decides a point, so a run could take one for another.
void refuse_first_schema(const fs::path& folder) {
  if (const auto record = record_of_first_schema(folder))
    throw UsageError(fmt::format(
        "output folder {}: {} is of schema {}, which a run does not go on from; accepted: another folder for --out, or this one "
        "without its folder `records` (`amrtex report` still makes tables of them)",
        folder.string(), record->filename().string(), kFirstSchema));
}

class Runner {
 public:
  Runner(const Experiment& experiment, const RunOptions& options)
      : experiment_(experiment),
        options_(options),
        shader_cache_(options.shader_cache.empty() ? Json() : Json(use_shader_cache(options.shader_cache))),
        context_(make_context(parse_context_kind(experiment.context))),
        implementation_(implementation_hash()) {}

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
    if (mesh_ && loaded_ == dataset) return;
    baseline_.reset();
    baseline_consumer_.reset();
    mesh_.emplace(load_dataset(experiment_, experiment_.datasets[dataset]));
    loaded_ = dataset;
    mesh_hash_ = mesh_->content_hash(0);
    data_hashes_.clear();
  }

  /// Of what is drawn; a mesh is hashed once for each choice of fields and triangles.
  const std::string& data_hash(const RenderPoint& render) {
    const Scene scene = scene_of(experiment_, render);
    std::string key;
    for (const TriangleObject& object : scene.settings.triangles) key += object.mesh->content_hash() + " ";
    for (const int field : more_fields(*mesh_, scene)) key += fmt::format(" {}", field);
    std::string& hash = data_hashes_[key];
    if (hash.empty()) hash = exact_data_hash(*mesh_, scene);
    return hash;
  }

  std::string hash_of(const BuildPoint& build, const RenderPoint& render) {
    return configuration_hash(point_configuration(experiment_, build, render, data_hash(render)));
  }

  /// Is the point's record there, drawn by this program's shaders and builders?
  bool is_kept(const std::string& hash) const {
    if (options_.force) return false;
    return options_.keep_old ? has_record(options_.folder, hash) : has_record_of(options_.folder, hash, implementation_);
  }

  void run_build(const BuildPoint& build) {
    load(build.dataset);
    std::vector<const RenderPoint*> open;
    for (const RenderPoint& render : experiment_.renders) {
      if (options_.wanted && !options_.wanted(build, render)) continue;
      if (is_kept(hash_of(build, render)))
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
           more_fields(*mesh_, first) == more_fields(*mesh_, second);
  }

  /// Render points of equal needs.
  void measure_all(const BuildPoint& build, const std::vector<const RenderPoint*>& renders) {
    std::unique_ptr<Built> built;
    try {
      built = make(build, scene_of(experiment_, *renders.front()));
      if (experiment_.explain_left_out)
        time_left_out(find_encoding(build.encoding), *mesh_, built->structure.request, built->structure.field);
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

  std::unique_ptr<Built> make(const BuildPoint& build, const Scene& scene) {
    BuildRequest request;
    request.storage = build.storage;
    request.parameters = build.parameters;
    request.context = context_->info();
    request.memory_limit = experiment_.memory_limit.value_or(request.memory_limit);
    request.needs = scene_needs(scene, build.filter, build.filtering);
    request.more_fields = more_fields(*mesh_, scene);
    const Encoding& encoding = find_encoding(build.encoding);
    if (const Support support = encoding.supported(request.context); !support.ok)
      throw UnsupportedError(fmt::format("encoding {}: {}", build.encoding, support.reason));
    const Stopwatch building;
    EncodedField field = encoding.build(*mesh_, request);
    const double build_seconds = building.seconds();
    const Stopwatch uploading;
    auto built = std::make_unique<Built>(Built{Structure(*context_, std::move(field), request), build_seconds, 0});
    context_->gl().Finish();
    built->upload_seconds = uploading.seconds();
    return built;
  }

  void measure(const BuildPoint& build, Built& built, const RenderPoint& render) {
    const Scene scene = scene_of(experiment_, render);
    const Stopwatch first;
    const auto consumer = make_consumer(*context_, *mesh_, built.structure, scene);
    consumer->draw();
    const double first_frame_ms = first.seconds() * 1000;
    const Picture picture = consumer->read();

    Json record = blank_record(Status::ok);
    describe(record, build, render, &built);
    record["first_frame_ms"] = first_frame_ms;
    if (!scene.settings.triangles.empty()) record["triangle_seconds"] = consumer->triangle_seconds();
    record["image_hash"] = picture_hash(picture);
    record["context"]["shader_hash"] = consumer->shader_hash();
    for (const std::string& text : scene_warnings(*mesh_, scene)) warn(record, text);
    if (scene.settings.slice_target == SliceTarget::rgba8)
      warn(record, "slices were blended in 8 bits a channel (slice_target rgba8): a historical control");
    if (!consumer->transfer_exact())
      warn(record, "the transfer function has more than 16 points: it is drawn from a table of 4096 bins");
    const std::optional<Judgement> own = add_errors(record, picture, built, scene);
    if (!add_check(record, build, scene, own)) {
      write(build, render, record);
      return;  // a wrong picture gets no time
    }
    write_png(picture, picture_path(build, render));
    const WorkCounts work = consumer->count();
    record["work"] = {{"rays", work.rays},
                      {"samples", work.samples},
                      {"regions", work.regions},
                      {"regions_skipped", work.regions_skipped},
                      {"passes", work.passes}};
    if (render.frames > 0) add_times(record, build, render, *consumer);
    if (experiment_.time_change) add_change(record, built, scene);
    write(build, render, record);
  }

  void add_change(Json& record, const Built& built, const Scene& scene) {
    try {
      const ChangeTimes change = time_changes(*context_, *mesh_, built.structure, scene, kChanges);
      record["change"] = {{"wall_ms", timing_json(change.wall_ms)}, {"bytes", change.bytes}};
    } catch (const UnsupportedError& error) {
      record["change"] = nullptr;
      warn(record, error.what());
    }
  }

  static void warn(Json& record, const std::string& text) { record["context"]["warnings"].push_back(text); }

  /// The scene as references draw it.
  Scene judged(Scene scene) const {
    if (experiment_.reference->shading) scene.settings.isosurfaces.shading = *experiment_.reference->shading;
    return scene;
  }

  /// What it finds against the own reference, where the experiment has one.
  std::optional<Judgement> add_errors(Json& record, const Picture& picture, const Built& built, const Scene& scene) {
    if (!experiment_.reference) return std::nullopt;
    const ReferenceSettings& reference = *experiment_.reference;
    const Scene judge = judged(scene);
    const fs::path cache = options_.folder / "references";
    const auto asked = [&](const FilterDefinition& filter) {
      return ReferenceRequest{*mesh_, exact_data_hash(*mesh_, judge), filter, judge, reference.rule()};
    };
    std::string hash;
    if (reference.common_filter) {
      FilterDefinition common{*reference.common_filter, 0, mesh_->finest_level()};
      if (!common.has_pages()) common.page_level = 0;
      const Picture shared = cached_reference(asked(common), cache, hash).picture;
      record["error_common"] = error_json(compare(picture, shared), hash);
      record["error_common"]["p95"] = percentile(pixel_errors(picture, shared), 0.95);
      record["error_common"]["p95_seen"] = percentile(seen_errors(picture, shared), 0.95);
      record["error_common"]["filter"] = filter_name(common.filter);
    }
    if (!reference.own) return std::nullopt;
    ReferencePicture drawn = cached_reference(asked(built.structure.field.definition), cache, hash);
    Picture& own = drawn.picture;
    const ErrorMetrics error = compare(picture, own);
    record["error"] = error_json(error, hash);
    record["error"]["within_tolerance_seen"] = nullptr;
    add_reference_error(record["error"], drawn, error);
    record["error"]["split"] = experiment_.explain_error ? explain(built, scene, own, picture) : Json();
    if (!experiment_.explain_error && scene.settings.prunes_levels())
      record["error"]["split"]["level_of_detail"] = pruning_error(built, scene, picture);
    const std::vector<double> pixels = pixel_errors(picture, own);
    record["error"]["p95"] = percentile(pixels, 0.95);
    const std::vector<double> seen = seen_errors(picture, own);
    record["error"]["p95_seen"] = percentile(seen, 0.95);
    if (scene.settings.integrator == Integrator::tolerance) {
      record["error"]["within_tolerance"] = share_within(pixels, scene.settings.tolerance);
      record["error"]["within_tolerance_seen"] = share_within(seen, scene.settings.tolerance);
    }
    return Judgement{error, std::move(own)};
  }

  /// What the picture had to reach, and whether it did.
  bool add_check(Json& record, const BuildPoint& build, const Scene& scene, const std::optional<Judgement>& own) const {
    const PictureCheck check = check_of(experiment_, build, scene.settings);
    if (!check.psnr_db || !own) {
      record["check_reason"] = check.why;
      return true;
    }
    record["check"] = {{"psnr_db", *check.psnr_db}, {"from", check.from}, {"why", check.why.empty() ? Json() : Json(check.why)}};
    if (passes(check, own->error, own->reference)) return true;
    record["status"] = status_name(Status::failed);
    record["reason"] =
        fmt::format("failed check: psnr_db {:.2f} against its own reference, at least {:.4g} is asked for by the {}",
                    own->error.psnr_db.value_or(0), *check.psnr_db, check.from);
    return false;
  }

  /// The error by cause.
  Json explain(const Built& built, const Scene& scene, const Picture& reference, const Picture& picture) {
    const auto truth = analytic_field(experiment_.datasets[loaded_]);
    const Encoding& encoding = find_encoding(built.structure.field.encoding);
    return split_json(split_error(
        {*mesh_, encoding, built.structure, *context_, scene, reference, picture, experiment_.reference->rule(), truth.get()}));
  }

  /// What the level of detail did: the picture against that of the same structure without it.
  Json pruning_error(const Built& built, Scene scene, const Picture& pruned) const {
    scene.settings.level_of_detail.reset();
    scene.settings.max_level.reset();
    const auto whole = make_consumer(*context_, *mesh_, built.structure, scene);
    whole->draw();
    const ErrorMetrics error = compare(pruned, whole->read());
    return {{"rmse", error.rmse}, {"max", error.max}};
  }

  void add_times(Json& record, const BuildPoint& build, const RenderPoint& render, Consumer& consumer) {
    std::vector<FrameTime> frames;
    double before = 0;
    double after = 0;
    Consumer* baseline = baseline_for(build, render);
    for (int tries = 0; tries < kTimingTries; ++tries) {
      before = baseline_ms(baseline);
      frames = time_frames(consumer, render.warm_up, render.frames);
      after = baseline_ms(baseline);
      if (baseline == nullptr || std::abs(after - before) <= kBaselineDrift * std::min(before, after)) break;
    }
    std::vector<double> wall;
    std::vector<double> gpu;
    for (const FrameTime& f : frames) {
      wall.push_back(f.wall_ms);
      gpu.push_back(f.gpu_ms);
    }
    Json frame;
    frame["wall_ms"] = timing_json(wall);
    frame["gpu_ms"] = context_->info().software ? Json() : timing_json(gpu);  // there the timer tells of the last tile alone
    frame["all_wall_ms"] = wall;
    frame["warm_up"] = render.warm_up;
    frame["baseline_ms"] = nullptr;
    frame["relative"] = nullptr;
    if (baseline != nullptr) {
      frame["baseline_ms"] = {before, after};
      frame["relative"] = median(wall) / ((before + after) / 2);
      if (std::abs(after - before) > kBaselineDrift * std::min(before, after))
        warn(record, fmt::format("the baseline took {:.1f} ms before and {:.1f} ms after: other work disturbed this time", before,
                                 after));
    }
    record["frame"] = frame;
  }

  double baseline_ms(Consumer* baseline) {
    if (baseline == nullptr) return 0;
    std::vector<double> wall;
    for (const FrameTime& f : time_frames(*baseline, 1, kBaselineFrames)) wall.push_back(f.wall_ms);
    return median(wall);
  }

  /// A baseline that cannot be drawn concerns the whole experiment, not the point that it stands beside.
  std::unique_ptr<Built> make_baseline(const BuildPoint& build, const Scene& scene) {
    try {
      return make(build, scene);
    } catch (const Error& error) {
      throw UsageError(fmt::format(
          "{}: baseline: the first of all points cannot be drawn: {}; accepted: another order of encodings and filters",
          experiment_.file.string(), error.what()));
    }
  }

  /// The experiment's first build with its first render settings, for the same view, when it asks for one.
  Consumer* baseline_for(const BuildPoint& build, const RenderPoint& render) {
    if (!experiment_.baseline) return nullptr;
    const BuildPoint* first = nullptr;
    for (const BuildPoint& b : experiment_.builds)
      if (b.dataset == build.dataset && first == nullptr) first = &b;
    RenderPoint settings = experiment_.renders.front();
    settings.view = render.view;
    settings.view_name = render.view_name;
    settings.transfer_function = render.transfer_function;
    settings.transfer_function_name = render.transfer_function_name;
    settings.more_fields = render.more_fields;
    const std::string key = render_json(settings).dump();
    if (!baseline_) baseline_ = make_baseline(*first, scene_of(experiment_, settings));
    if (!baseline_consumer_ || key != baseline_key_) {
      baseline_consumer_ = make_consumer(*context_, *mesh_, baseline_->structure, scene_of(experiment_, settings));
      baseline_key_ = key;
    }
    return baseline_consumer_.get();
  }

  void describe(Json& record, const BuildPoint& build, const RenderPoint& render, const Built* built) {
    const DatasetSource& source = experiment_.datasets[build.dataset];
    std::int64_t patches = 0;
    for (int l = 0; l < mesh_->level_count(); ++l) patches += static_cast<std::int64_t>(mesh_->patches(l).size());
    record["experiment"] = experiment_.name;
    record["configuration"] = hash_of(build, render);
    record["implementation"] = implementation_;
    record["repetition"] = 0;
    record["process_peak_bytes"] = json_or_null(process_peak_bytes());
    record["dataset"] = {{"name", source.name},
                         {"source", source.file ? Json(source.written) : source.generate},
                         {"hash", mesh_hash_},
                         {"exact_hash", data_hash(render)},
                         {"leaf_cells", mesh_->leaf_cells()},
                         {"stored_cells", mesh_->stored_cells()},
                         {"levels", mesh_->level_count()},
                         {"patches", patches},
                         {"field", mesh_->fields().front()}};
    record["encoding"] = build.encoding;
    record["build_parameters"] = built != nullptr ? built->structure.field.build_parameters : build.parameters;
    record["filter"] = filter_name(build.filter);
    record["storage"] = format_name(build.storage);
    record["filtering"] = filtering_name(build.filtering);
    record["render"] = render_json(render);
    record["context"] = context_json();
    record["context"]["renderer"] = context_->info().renderer;
    record["context"]["device"] = context_->info().software ? record["context"]["cpu"] : Json(context_->info().renderer);
    record["context"]["shader_cache"] = shader_cache_;
    record["context"]["gl_version"] = context_->info().version;
    record["context"]["software"] = context_->info().software;
    record["context"]["extensions_missing"] = Json::array();
    for (const char* name : {"GL_ARB_bindless_texture", "GL_ARB_shader_ballot"})
      if (!context_->info().has_extension(name)) record["context"]["extensions_missing"].push_back(name);
    record["context"]["warnings"] = Json::array();
    if (built == nullptr) return;
    record["memory"] = memory_json(built->structure.field, mesh_->leaf_cells());
    record["build_seconds"] = built->build_seconds;
    record["upload_seconds"] = built->upload_seconds;
    record["left_out"] = left_out_json(built->structure.field);
    record["statistics"] = built->structure.field.statistics;
    record["storage_scale"] = {{"a", built->structure.field.scale.offset}, {"b", built->structure.field.scale.scale}};
  }

  void record_failure(const BuildPoint& build, const RenderPoint& render, const Failure& failure) {
    Json record = blank_record(failure.status, failure.reason);
    describe(record, build, render, nullptr);
    if (failure.needed_bytes > 0) record["needed_bytes"] = failure.needed_bytes;
    write(build, render, record);
  }

  void write(const BuildPoint& build, const RenderPoint& render, const Json& record) {
    const std::string hash = hash_of(build, render);
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
    return options_.folder / "pictures" / (hash_of(build, render) + ".png");
  }

  const Experiment& experiment_;
  const RunOptions& options_;
  Json shader_cache_;  ///< of the context, which finds it when it is made
  std::unique_ptr<Context> context_;
  std::string implementation_;
  RunSummary summary_;
  std::optional<AmrHierarchy> mesh_;
  std::size_t loaded_ = 0;
  std::string mesh_hash_;
  std::map<std::string, std::string> data_hashes_;  ///< by fields and triangles in use
  std::unique_ptr<Built> baseline_;
  std::unique_ptr<Consumer> baseline_consumer_;
  std::string baseline_key_;
};

}  // namespace

AmrHierarchy load_dataset(const Experiment& experiment, const DatasetSource& source) {
  if (!source.file) return AmrHierarchy(generate_mesh(source.generate));
  std::vector<std::string> fields;  // empty: all of them
  if (source.field) {
    const auto need = [&](const std::string& name) {
      if (!name.empty() && std::find(fields.begin(), fields.end(), name) == fields.end()) fields.push_back(name);
    };
    need(*source.field);
    for (const RenderPoint& render : experiment.renders) {
      need(render.settings.isosurfaces.color_field);
      for (const FieldTransfer& other : render.more_fields) need(other.field);
    }
  }
  return AmrHierarchy(read_mesh(*source.file, fields));
}

std::unique_ptr<AnalyticField> analytic_field(const DatasetSource& source) {
  return source.file ? nullptr : make_analytic_field(source.generate);
}

std::vector<int> more_fields(const AmrHierarchy& hierarchy, const Scene& scene) {
  std::vector<int> others;
  for (const FieldTransfer& other : scene.more_fields) others.push_back(hierarchy.field_index(other.field));
  if (!others.empty()) return others;
  const std::string& color = scene.settings.isosurfaces.color_field;
  if (!scene.settings.draws_surfaces() || color.empty()) return {};
  return {hierarchy.field_index(color)};
}

std::string exact_data_hash(const AmrHierarchy& hierarchy, const Scene& scene) {
  std::vector<int> fields = {0};
  for (const int field : more_fields(hierarchy, scene)) fields.push_back(field);
  const std::string mesh = exact_hash(hierarchy, fields);
  if (scene.settings.triangles.empty()) return mesh;
  Json parts = {{"mesh", mesh}, {"triangles", Json::array()}};
  for (const TriangleObject& object : scene.settings.triangles) parts["triangles"].push_back(object.mesh->content_hash());
  return configuration_hash(parts);
}

std::vector<std::string> scene_warnings(const AmrHierarchy& hierarchy, const Scene& scene) {
  std::vector<std::string> warnings;
  if (!scene.settings.draws_surfaces()) return warnings;
  const FieldStatistics& range = hierarchy.statistics(0);
  for (const double isovalue : scene.settings.isosurfaces.values)
    if (!(isovalue >= range.min && isovalue <= range.max))
      warnings.push_back(fmt::format("isovalue {} lies outside the range of {}, {} to {}: it has no surface", isovalue,
                                     hierarchy.fields().front(), range.min, range.max));
  return warnings;
}

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
