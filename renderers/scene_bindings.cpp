#include "renderers/scene_bindings.hpp"

#include <algorithm>
#include <cmath>

#include "structures/build_tools.hpp"

namespace amrtex {
namespace {

constexpr int kLargestTable = 4096;

/// Beyond this many cells, floats of a whole ray would be off by more than the lattice's
/// quantum of 2^-12 of a cell; then rays are held in double.
constexpr int kFloatRayCells = 4096;

double smallest_edge(const AmrHierarchy& h) {
  const Vec3d s = h.spacing(h.finest_level());
  return std::min({s.x, s.y, s.z});
}

bool needs_double_rays(const AmrHierarchy& h, const Scene& scene) {
  const Vec3i n = h.cells(h.finest_level());
  const Vec3d size = h.domain_upper() - h.domain_lower();
  const double distance = glm::length(scene.view.eye - (h.domain_lower() + h.domain_upper()) * 0.5);
  const bool narrow = !scene.view.orthographic && scene.view.fov_y < 1;
  return std::max({n.x, n.y, n.z}) > kFloatRayCells || distance > 16 * glm::length(size) || narrow;
}

std::vector<double> table_points(const TransferFunction& tf) {
  std::vector<double> points;
  for (const auto& p : tf.extinction) points.push_back(tf.axis(p.value));
  for (const auto& p : tf.color) points.push_back(tf.axis(p.value));
  std::sort(points.begin(), points.end());
  return points;
}

/// Smallest number of bins with every point on an entry; the largest table where there is none.
int table_bins(const std::vector<double>& points, bool& exact) {
  const double lower = points.front();
  const double span = points.back() - lower;
  exact = true;
  if (!(span > 0)) return 1;
  for (int bins = 1; bins <= kLargestTable; ++bins)
    if (std::all_of(points.begin(), points.end(), [&](double p) {
          const double x = (p - lower) / span * bins;
          return std::abs(x - std::round(x)) < 1e-9 * bins;
        }))
      return bins;
  exact = false;
  return kLargestTable;
}

struct TransferTable {
  HostTexture table = make_buffer("transfer_table", TexelFormat::rgba32f, 1);
  HostTexture next_visible = make_buffer("transfer_next_visible", TexelFormat::r32f, 1);
  double lower = 0;
  double scale = 1;
  int last = 1;
  bool exact = true;
};

/// `unit`: multiplies extinction so that it is per unit of ray length.
TransferTable make_table(const TransferFunction& tf, double unit) {
  TransferTable t;
  const std::vector<double> points = table_points(tf);
  const int bins = table_bins(points, t.exact);
  const double span = points.back() - points.front();
  t.lower = points.front();
  t.scale = span > 0 ? bins / span : 1;
  t.last = bins;
  t.table = make_buffer("transfer_table", TexelFormat::rgba32f, bins + 1);
  t.next_visible = make_buffer("transfer_next_visible", TexelFormat::r32f, bins + 1);
  auto* entries = t.table.as<float>();
  auto* visible = t.next_visible.as<float>();
  const auto value_at = [&](int i) {
    const double x = i == bins ? points.back() : t.lower + i / t.scale;
    return tf.logarithmic ? std::pow(10.0, x) : x;
  };
  for (int i = 0; i <= bins; ++i) {
    const double v = value_at(i);
    const Vec3d rgb = tf.color_at(v);
    const double kappa = std::min(tf.extinction_at(v) * unit, 3e38);
    entries[4 * i] = static_cast<float>(rgb.x);
    entries[4 * i + 1] = static_cast<float>(rgb.y);
    entries[4 * i + 2] = static_cast<float>(rgb.z);
    entries[4 * i + 3] = static_cast<float>(kappa);
  }
  constexpr float kNever = 3e38F;
  constexpr float kAlways = -3e38F;
  // beyond the last point the function is constant, so values above it may be visible too
  visible[bins] = entries[4 * bins + 3] > 0 ? kAlways : kNever;
  for (int i = bins - 1; i >= 0; --i) {
    const bool bin = entries[4 * i + 3] > 0 || entries[4 * (i + 1) + 3] > 0;
    const auto from = static_cast<float>(value_at(i) - 1e-6 * std::abs(value_at(i)));
    visible[i] = bin ? from : visible[i + 1];
    if (!bin && visible[i + 1] == kAlways) visible[i] = static_cast<float>(value_at(bins) - 1e-6 * std::abs(value_at(bins)));
  }
  if (entries[3] > 0) visible[0] = kAlways;
  return t;
}

std::vector<double> numbers(const Vec3d& v) { return {v.x, v.y, v.z}; }

void add_camera(const AmrHierarchy& h, const Scene& scene, UniformValues& uniforms) {
  const RenderSettings& s = scene.settings;
  const CameraFrame camera = camera_frame(scene.view, s.width, s.height);
  const Vec3d spacing = h.spacing(h.finest_level());
  const double unit = smallest_edge(h);
  const double to_units = camera.orthographic ? 1 / unit : 1;
  const auto to_finest = [&](const Vec3d& p) { return (p - h.domain_lower()) / spacing; };
  Vec3d lower{0};
  Vec3d upper(h.cells(h.finest_level()));
  if (scene.region) {
    lower = glm::max(lower, to_finest((*scene.region)[0]));
    upper = glm::max(lower, glm::min(upper, to_finest((*scene.region)[1])));
  }
  uniforms.push_back({"u_eye", numbers(to_finest(camera.eye)), true});
  uniforms.push_back({"u_forward", numbers(camera.forward), true});
  uniforms.push_back({"u_right", numbers(camera.right * to_units), true});
  uniforms.push_back({"u_up", numbers(camera.up * to_units), true});
  uniforms.push_back({"u_orthographic", std::vector<int>{camera.orthographic ? 1 : 0}});
  uniforms.push_back({"u_cells_per_unit", numbers(Vec3d(unit) / spacing), true});
  uniforms.push_back({"u_draw_lower", numbers(lower), true});
  uniforms.push_back({"u_draw_upper", numbers(upper), true});
  uniforms.push_back({"u_picture_size", std::vector<double>{static_cast<double>(s.width), static_cast<double>(s.height)}});
}

}  // namespace

UniformValues field_uniforms(const AmrHierarchy& h, const EncodedField& field) {
  const Vec3i n = h.cells(h.finest_level());
  std::vector<int> widths;
  for (int l = 0; l < h.level_count(); ++l) widths.push_back(h.cell_width(l));
  UniformValues uniforms;
  uniforms.push_back({"u_domain_cells", std::vector<int>{n.x, n.y, n.z}});
  uniforms.push_back({"u_level_width", widths});
  uniforms.push_back({"u_value_scale", std::vector<double>{field.scale.offset, field.scale.scale}});
  for (const auto& [name, v] : field.integer_uniforms) uniforms.push_back({name, std::vector<int>{v.x, v.y, v.z}});
  return uniforms;
}

SceneBindings bind_scene(const AmrHierarchy& h, const EncodedField& field, const Scene& scene) {
  const RenderSettings& s = scene.settings;
  const double unit = smallest_edge(h);
  const Vec3d size = h.domain_upper() - h.domain_lower();
  const double longest = std::max({size.x, size.y, size.z});
  SceneBindings b;
  b.uniforms = field_uniforms(h, field);
  add_camera(h, scene, b.uniforms);
  b.uniforms.push_back({"u_step", std::vector<double>{s.step}});
  b.uniforms.push_back({"u_early_end", std::vector<double>{1 - s.early_end.value_or(1)}});
  b.uniforms.push_back({"u_length_unit", std::vector<double>{unit}});
  if (s.mode == Mode::dvr) {
    const bool world = scene.transfer_function.length_unit == TransferFunction::LengthUnit::world;
    TransferTable t = make_table(scene.transfer_function, world ? unit : unit / longest);
    b.uniforms.push_back({"u_transfer_axis", std::vector<double>{t.lower, t.scale}});
    b.uniforms.push_back({"u_transfer_last", std::vector<int>{t.last}});
    b.transfer_exact = t.exact;
    b.buffers.push_back(std::move(t.table));
    b.buffers.push_back(std::move(t.next_visible));
  }
  b.defines = {{"AMRTEX_RAY_DOUBLE", needs_double_rays(h, scene) ? 1 : 0},
               {"AMRTEX_LOGARITHMIC", s.mode == Mode::dvr && scene.transfer_function.logarithmic ? 1 : 0},
               {"AMRTEX_MODE", static_cast<int>(s.mode)},
               {"AMRTEX_LATTICE", s.sampling == Sampling::lattice ? 1 : 0},
               {"AMRTEX_SKIP", s.skip ? 1 : 0},
               {"AMRTEX_EARLY_END", s.early_end && s.mode == Mode::dvr ? 1 : 0}};
  return b;
}

SceneNeeds scene_needs(const Scene& scene, Filter filter, Filtering filtering) {
  SceneNeeds needs;
  needs.filter = filter;
  needs.filtering = filter == Filter::nearest ? Filtering::manual : filtering;
  needs.value_ranges = scene.settings.skip;
  return needs;
}

}  // namespace amrtex
