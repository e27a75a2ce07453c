#include "bench/measure/judgement.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <set>
#include <vector>

#include "bench/measure/check_bound.hpp"
#include "bench/measure/error_split.hpp"
#include "bench/measure/reference_cache.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

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

/// The scene as references draw it.
Scene reference_scene(const Experiment& experiment, Scene scene) {
  if (experiment.reference->shading) scene.settings.isosurfaces.shading = *experiment.reference->shading;
  return scene;
}

/// `scene` must outlive it.
ReferenceRequest request_of(const Experiment& experiment, LoadedData& data, const Scene& scene, const FilterDefinition& filter) {
  return {data.mesh(), data.exact_hash(scene), filter, scene, experiment.reference->rule()};
}

/// A filter of the whole mesh, that of no encoding.
FilterDefinition common_definition(const AmrHierarchy& mesh, Filter filter) {
  FilterDefinition common{filter, 0, mesh.finest_level()};
  if (!common.has_pages()) common.page_level = 0;
  return common;
}

/// What the structure of a point will reproduce, before it is built.
FilterDefinition own_definition(const AmrHierarchy& mesh, const BuildPoint& build) {
  BuildRequest request;
  request.storage = build.storage;
  request.parameters = build.parameters;
  request.needs.filter = build.filter;
  return find_encoding(build.encoding).definition(mesh, request);
}

/// From the cache, where it was drawn before.
ReferencePicture reference_of(const JudgedPicture& judged, const FilterDefinition& filter, std::string& hash) {
  const Scene scene = reference_scene(judged.experiment, judged.scene);
  const ReferenceRequest request = request_of(judged.experiment, judged.data, scene, filter);
  hash = reference_name(request);
  return cached_reference(request, judged.references);
}

Json common_error(const JudgedPicture& judged, Filter filter) {
  std::string hash;
  const Picture shared = reference_of(judged, common_definition(judged.data.mesh(), filter), hash).picture;
  Json error = error_json(compare(judged.picture, shared), hash);
  error["p95"] = percentile(pixel_errors(judged.picture, shared), 0.95);
  error["p95_seen"] = percentile(seen_errors(judged.picture, shared), 0.95);
  error["filter"] = filter_name(filter);
  return error;
}

/// The error by cause.
Json explain(const JudgedPicture& judged, const Picture& reference) {
  const auto truth = analytic_field(judged.data.source());
  const Encoding& encoding = find_encoding(judged.structure.field.encoding);
  return split_json(split_error({judged.data.mesh(), encoding, judged.structure, judged.context, judged.scene, reference,
                                 judged.picture, judged.experiment.reference->rule(), truth.get()}));
}

/// What the level of detail did: the picture against that of the same structure without it.
Json pruning_error(const JudgedPicture& judged) {
  Scene scene = judged.scene;
  scene.settings.level_of_detail.reset();
  scene.settings.max_level.reset();
  const auto whole = make_consumer(judged.context, judged.data.mesh(), judged.structure, scene);
  whole->draw();
  const ErrorMetrics error = compare(judged.picture, whole->read());
  return {{"rmse", error.rmse}, {"max", error.max}};
}

Json own_error(const JudgedPicture& judged, const ErrorMetrics& metrics, const ReferencePicture& drawn, const std::string& hash) {
  const Picture& own = drawn.picture;
  const RenderSettings& settings = judged.scene.settings;
  Json error = error_json(metrics, hash);
  error["within_tolerance_seen"] = nullptr;
  add_reference_error(error, drawn, metrics);
  error["split"] = judged.experiment.explain_error ? explain(judged, own) : Json();
  if (!judged.experiment.explain_error && settings.prunes_levels()) error["split"]["level_of_detail"] = pruning_error(judged);
  const std::vector<double> pixels = pixel_errors(judged.picture, own);
  error["p95"] = percentile(pixels, 0.95);
  const std::vector<double> seen = seen_errors(judged.picture, own);
  error["p95_seen"] = percentile(seen, 0.95);
  if (settings.integrator == Integrator::tolerance) {
    error["within_tolerance"] = share_within(pixels, settings.tolerance);
    error["within_tolerance_seen"] = share_within(seen, settings.tolerance);
  }
  return error;
}

/// The definitions that the point is compared with.
std::vector<FilterDefinition> definitions_of(const Experiment& experiment, const AmrHierarchy& mesh, const BuildPoint& build) {
  std::vector<FilterDefinition> all;
  if (experiment.reference->common_filter) all.push_back(common_definition(mesh, *experiment.reference->common_filter));
  if (experiment.reference->own) all.push_back(own_definition(mesh, build));
  return all;
}

}  // namespace

void draw_references(const Experiment& experiment, LoadedData& data, const std::vector<AskedPoint>& points,
                     const std::filesystem::path& references) {
  if (!experiment.reference) return;
  std::set<std::string> drawn;
  for (const AskedPoint& point : points) {
    try {
      const Scene scene = reference_scene(experiment, scene_of(experiment, point.render));
      for (const FilterDefinition& filter : definitions_of(experiment, data.mesh(), point.build)) {
        const ReferenceRequest request = request_of(experiment, data, scene, filter);
        if (drawn.insert(reference_name(request)).second) cached_reference(request, references);
      }
    } catch (const OutputError&) {
      throw;
    } catch (const std::exception&) {  // a shortage of memory too: the point's own record tells it
    }
  }
}

double filter_error(const Experiment& experiment, LoadedData& data, const AskedPoint& point,
                    const std::filesystem::path& references) {
  const Scene scene = reference_scene(experiment, scene_of(experiment, point.render));
  const auto drawn = [&](const FilterDefinition& filter) {
    return cached_reference(request_of(experiment, data, scene, filter), references).picture;
  };
  return percentile(seen_errors(drawn(own_definition(data.mesh(), point.build)),
                                drawn(common_definition(data.mesh(), experiment.reference->common_filter.value()))),
                    0.95);
}

std::optional<Judgement> add_errors(Json& record, const JudgedPicture& judged) {
  if (!judged.experiment.reference) return std::nullopt;
  const ReferenceSettings& reference = *judged.experiment.reference;
  if (reference.common_filter) record["error_common"] = common_error(judged, *reference.common_filter);
  if (!reference.own) return std::nullopt;
  std::string hash;
  ReferencePicture own = reference_of(judged, judged.structure.field.definition, hash);
  const ErrorMetrics error = compare(judged.picture, own.picture);
  record["error"] = own_error(judged, error, own, hash);
  return Judgement{error, std::move(own.picture)};
}

bool add_check(Json& record, const Experiment& experiment, const BuildPoint& build, const RenderSettings& settings,
               const std::optional<Judgement>& own) {
  const PictureCheck check = check_of(experiment, build, settings);
  if (!check.psnr_db || !own) {
    record["check_reason"] = check.why;
    return true;
  }
  record["check"] = {{"psnr_db", *check.psnr_db}, {"from", check.from}, {"why", check.why.empty() ? Json() : Json(check.why)}};
  if (passes(check, own->error, own->reference)) return true;
  record["status"] = status_name(Status::failed);
  record["reason"] = fmt::format("failed check: psnr_db {:.2f} against its own reference, at least {:.4g} is asked for by the {}",
                                 own->error.psnr_db.value_or(0), *check.psnr_db, check.from);
  return false;
}

}  // namespace amrtex
