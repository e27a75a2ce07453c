#include "bench/measure/check_bound.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace amrtex {
namespace {

/// Sums of float samples along a ray, and a transfer function drawn from its table of 4096 bins.
constexpr double kArithmetic = 1e-4;
/// Two of 256 grey levels, 42 dB: a picture that is further off shows something else. One sample a cell stays well below in a
/// scene of ordinary steepness, and a longer step gets no more.
constexpr double kOneCell = 2.0 / 256;
/// Where the field jumps inside an interval its middle may stand for the wrong side.
constexpr double kJump = 2;
/// The integrator `tolerance` goes by estimates.
constexpr double kEstimate = 2;
/// Slices stand across the view's axis: towards the corners of a picture their distance along a ray grows.
constexpr double kSlices = 2;
/// `preintegrated` reads the light of an interval from values that a curved field does not pass in a line.
constexpr double kPreintegrated = 5e-4;
/// GL asks of filtering in hardware for 8 bits of a coordinate's fraction: half of one, where neighbours differ by a quarter of
/// the range.
constexpr double kHardware = 1.0 / 2048;
/// A normal is a difference of values a cell apart, a tenth of the range: what disturbs values disturbs shading ten times.
constexpr double kShading = 10;
/// Slices blended in 8 bits: 256 of them are off by this.
constexpr double kBlended8 = 0.1;
/// Of the pixels along the silhouettes of surfaces, about as many as four edges of the picture: the share on the wrong side, by
/// rounding and by one sample a cell; each is all or nothing.
constexpr double kSilhouette = 5e-3, kSilhouetteStep = 5e-3, kEdges = 4;
constexpr double kStrayPixels = 2;
/// A float picture against a double one, in parts of the largest value.
constexpr double kRounding = 1e-6;

/// Does the field jump inside an interval? A midpoint says nothing about what lies behind a jump, so the order falls to one.
bool jumps(Filter filter, Sampling sampling) {
  const Continuity where = filter_info(filter).continuity;
  // adaptive intervals end where the level changes
  return where == Continuity::cell || (sampling == Sampling::lattice && where != Continuity::everywhere);
}

bool has_volume(const RenderSettings& s) { return s.mode != Mode::iso && (s.draws_volume() || !s.draws_surfaces()); }

void add_step(std::vector<Allowance>& list, const BuildPoint& build, const RenderSettings& s) {
  if (s.integrator == Integrator::tolerance) {
    list.push_back({fmt::format("tolerance {}", s.tolerance), kEstimate * s.tolerance});
    return;
  }
  const bool first_order =
      jumps(build.filter, s.sampling) || s.integrator == Integrator::euler || s.integrator == Integrator::left;
  const double width = std::min(s.step, 1.0);
  const double error = kOneCell * (first_order ? kJump * width : width * width) * (s.draws_slices() ? kSlices : 1);
  list.push_back({fmt::format("step {} ({}, {}, order {})", s.step, sampling_name(s.sampling), integrator_name(s.integrator),
                              first_order ? 1 : 2),
                  error});
  if (s.integrator == Integrator::preintegrated) list.push_back({"preintegrated", kPreintegrated});
  if (s.slice_target == SliceTarget::rgba8) list.push_back({"blending in 8 bits", kBlended8});
}

/// Half of one of the levels that the range is stored in.
double half_level(Storage storage) {
  switch (storage) {
    case Storage::r8:
      return 1.0 / 510;
    case Storage::r16:
      return 1.0 / 131070;
    case Storage::r16f:
      return 1.0 / 4096;
    default:
      return 0;
  }
}

void add_values(std::vector<Allowance>& list, const BuildPoint& build, const RenderSettings& s) {
  const double gain = s.draws_surfaces() ? kShading : 1;
  if (const double error = half_level(build.storage); error > 0)
    list.push_back({fmt::format("storage {}", format_name(build.storage)), gain * error});
  if (build.filtering == Filtering::hardware) list.push_back({"filtering hardware", gain * kHardware});
}

void add_surfaces(std::vector<Allowance>& list, const RenderSettings& s) {
  const double pixels = static_cast<double>(s.width) * s.height;
  const double lines = s.point_light ? 2 : 1;  // edges of shadows are silhouettes too
  const double share = kEdges * lines * (kSilhouette + kSilhouetteStep * std::min(s.step, 1.0)) / std::sqrt(pixels);
  list.push_back({"silhouettes", std::sqrt(share + kStrayPixels / pixels)});
  if (const auto& around = s.isosurfaces.ambient_occlusion)
    list.push_back({fmt::format("{} rays of occlusion", around->rays), 0.5 / std::sqrt(around->rays)});
}

std::string text_of(std::span<const Allowance> allowances) {
  std::vector<std::string> parts;
  for (const Allowance& a : allowances) parts.push_back(fmt::format("{:.2g} {}", a.rmse, a.cause));
  return fmt::format("rmse in parts of the peak: {}", fmt::join(parts, " + "));
}

/// Why the own reference does not show what this picture is meant to show; empty where it does.
std::string difference_on_purpose(const Experiment& experiment, const RenderSettings& s) {
  if (s.prunes_levels()) return "coarser levels are drawn on purpose (level_of_detail, max_level); the reference has all of them";
  const auto& shading = experiment.reference->shading;
  if (s.draws_surfaces() && shading && *shading != s.isosurfaces.shading)
    return fmt::format("its reference is shaded by other normals on purpose ({})", shading_name(*shading));
  return "";
}

}  // namespace

std::vector<Allowance> default_allowances(const BuildPoint& build, const RenderSettings& settings) {
  std::vector<Allowance> list = {{"arithmetic", kArithmetic}};
  if (has_volume(settings)) add_step(list, build, settings);
  if (settings.draws_surfaces()) add_surfaces(list, settings);
  add_values(list, build, settings);
  if (settings.early_end && settings.draws_volume())
    list.push_back({fmt::format("early_end {}", *settings.early_end), 1 - *settings.early_end});
  if (settings.point_light && settings.draws_volume())
    list.push_back({fmt::format("shadow_step {}", settings.point_light->shadow_step),
                    kOneCell * std::min(settings.point_light->shadow_step, 1.0)});
  return list;
}

double psnr_of(std::span<const Allowance> allowances) {
  double sum = 0;
  for (const Allowance& a : allowances) sum += a.rmse;
  return -20 * std::log10(sum);
}

PictureCheck check_of(const Experiment& experiment, const BuildPoint& build, const RenderSettings& settings) {
  if (!experiment.reference) return {std::nullopt, "", "no reference"};
  if (!experiment.reference->own) return {std::nullopt, "", "no reference of its own filter"};
  if (experiment.unchecked_because) return {std::nullopt, "", "switched off by the experiment: " + *experiment.unchecked_because};
  if (experiment.minimum_psnr_db) return {experiment.minimum_psnr_db, "experiment", experiment.check_why};
  if (std::string why = difference_on_purpose(experiment, settings); !why.empty()) return {std::nullopt, "", std::move(why)};
  const std::vector<Allowance> allowances = default_allowances(build, settings);
  return {psnr_of(allowances), "default", text_of(allowances)};
}

bool passes(const PictureCheck& check, const ErrorMetrics& error, const Picture& reference) {
  if (!check.psnr_db || reaches_psnr(error, *check.psnr_db)) return true;
  double largest = 0;
  for (const double v : reference.values)
    if (std::isfinite(v)) largest = std::max(largest, std::abs(v));
  return error.rmse <= kRounding * largest;
}

}  // namespace amrtex
