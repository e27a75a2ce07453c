#include "renderers/bindings/transfer_bindings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "structures/common/build_tools.hpp"

namespace amrtex {
namespace {

constexpr int kTableBins = 4096;
constexpr std::size_t kMostInvisibleRanges = 8;
/// Shader knots as u_knots in preintegrated.glsl; more stand in a buffer.
constexpr std::size_t kMostKnots = 34;
/// What extinction is cut at: a float, and opaque at any length.
constexpr double kMostExtinction = 1e30;

/// Is the transfer function evaluated from its points, or from a table?
bool is_exact(const TransferFunction& tf) {
  return tf.extinction.size() <= kMostExactPoints && tf.color.size() <= kMostExactColors;
}

/// A float, or the largest one.
double as_float(double v) {
  constexpr double kMost = 3e38;
  return std::clamp(v, -kMost, kMost);
}

/// `unit`: multiplies extinction so that it is per unit of ray length. `suffix`: of the uniforms' names.
void add_points(const TransferFunction& tf, double unit, SceneBindings& b, const std::string& suffix = "") {
  std::vector<double> extinction;
  for (std::size_t i = 0; i < tf.extinction.size(); ++i) {
    const double x = tf.axis(tf.extinction[i].value);
    const double kappa = std::min(tf.extinction[i].extinction * unit, kMostExtinction);
    double slope = 0;
    if (i + 1 < tf.extinction.size())
      slope = as_float((std::min(tf.extinction[i + 1].extinction * unit, kMostExtinction) - kappa) /
                       (tf.axis(tf.extinction[i + 1].value) - x));
    extinction.insert(extinction.end(), {x, kappa, slope});
  }
  b.set("u_extinction_points" + suffix, extinction);
  b.set("u_color_points" + suffix, color_points(tf));
}

void add_table(const TransferFunction& tf, double unit, SceneBindings& b) {
  const double lower = tf.axis(std::min(tf.extinction.front().value, tf.color.front().value));
  const double upper = tf.axis(std::max(tf.extinction.back().value, tf.color.back().value));
  const double scale = upper > lower ? kTableBins / (upper - lower) : 1;
  HostTexture table = make_buffer("transfer_table", TexelFormat::rgba32f, kTableBins + 1);
  auto* entries = table.as<glm::vec4>();
  for (int i = 0; i <= kTableBins; ++i) {
    const double x = lower + i / scale;
    const double v = tf.logarithmic ? std::pow(10.0, x) : x;
    entries[i] = glm::vec4(Vec3f(tf.color_at(v)), static_cast<float>(std::min(tf.extinction_at(v) * unit, kMostExtinction)));
  }
  b.set("u_transfer_axis", {lower, scale});
  b.set("u_transfer_last", kTableBins);
  b.buffers.push_back(std::move(table));
}

/// Both curves' points as one list, and one point beyond all values at each end.
std::vector<double> knots(const TransferFunction& tf, double unit) {
  constexpr double kFar = 1e30;
  std::vector<double> values;
  for (const auto& p : tf.extinction) values.push_back(p.value);
  for (const auto& p : tf.color) values.push_back(p.value);
  std::sort(values.begin(), values.end());
  // the shader must be able to tell them apart
  const auto same = [&](double a, double b) { return static_cast<float>(tf.axis(a)) == static_cast<float>(tf.axis(b)); };
  values.erase(std::unique(values.begin(), values.end(), same), values.end());
  std::vector<double> numbers;
  const auto add = [&](double x, double inverse, double value) {
    const Vec3d rgb = tf.color_at(value);
    numbers.insert(numbers.end(), {x, inverse, std::min(tf.extinction_at(value) * unit, kMostExtinction), rgb.r, rgb.g, rgb.b});
  };
  add(-kFar, 0, values.front());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = tf.axis(values[i]);
    add(x, i + 1 < values.size() ? as_float(1 / (tf.axis(values[i + 1]) - x)) : 0, values[i]);
  }
  add(kFar, 0, values.back());
  return numbers;
}

/// A little inside of the true ones, by what the shader's own evaluation may be off (`margin`, on the axis).
std::vector<std::array<double, 2>> invisible_ranges(const TransferFunction& tf, double margin) {
  constexpr double kFar = std::numeric_limits<double>::max();
  const auto value = [&](double x) { return tf.logarithmic ? std::pow(10.0, x) : x; };
  std::vector<std::array<double, 2>> ranges;
  const auto& points = tf.extinction;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].extinction > 0) continue;
    std::size_t last = i;
    while (last + 1 < points.size() && !(points[last + 1].extinction > 0)) ++last;
    const double from = i == 0 ? -kFar : value(tf.axis(points[i].value) + margin);
    const double to = last + 1 == points.size() ? kFar : value(tf.axis(points[last].value) - (last == 0 && i == 0 ? 0 : margin));
    if (from < to && ranges.size() < kMostInvisibleRanges) ranges.push_back({from, to});
    i = last;
  }
  return ranges;
}

}  // namespace

std::vector<std::array<double, 2>> invisible_ranges(const TransferFunction& tf) {
  const double first = tf.axis(tf.extinction.front().value);
  const double span = tf.axis(tf.extinction.back().value) - first;
  return invisible_ranges(tf, is_exact(tf) ? 1e-6 * (span + std::abs(first)) : 1.01 * span / kTableBins);
}

double extinction_unit(const DomainGeometry& geometry, const TransferFunction& tf) {
  const Vec3d size = geometry.size();
  const bool world = tf.length_unit == TransferFunction::LengthUnit::world;
  return world ? geometry.smallest_edge() : geometry.smallest_edge() / std::max({size.x, size.y, size.z});
}

std::vector<double> color_points(const TransferFunction& tf) {
  std::vector<double> color{tf.axis(tf.color.front().value), 0, tf.color.front().rgb.x, tf.color.front().rgb.y,
                            tf.color.front().rgb.z};
  for (std::size_t i = 1; i < tf.color.size(); ++i) {
    const double x = tf.axis(tf.color[i].value);
    const Vec3d step = tf.color[i].rgb - tf.color[i - 1].rgb;
    color.insert(color.end(), {x, as_float(1 / (x - tf.axis(tf.color[i - 1].value))), step.x, step.y, step.z});
  }
  return color;
}

void add_transfer_function(const DomainGeometry& geometry, const Scene& scene, SceneBindings& b) {
  int extinction_points = 1;
  int color_points = 1;
  std::vector<double> invisible;
  const bool drawn = scene.settings.draws_volume();
  const TransferFunction& tf = scene.transfer_function;
  if (drawn) {
    const double per_unit = extinction_unit(geometry, tf);
    b.transfer_exact = is_exact(tf);
    extinction_points = b.transfer_exact ? static_cast<int>(tf.extinction.size()) : 0;
    color_points = b.transfer_exact ? static_cast<int>(tf.color.size()) : 0;
    if (b.transfer_exact)
      add_points(tf, per_unit, b);
    else
      add_table(tf, per_unit, b);
    for (const auto& [from, to] : invisible_ranges(tf)) invisible.insert(invisible.end(), {as_float(from), as_float(to)});
    if (!invisible.empty()) b.set("u_invisible_ranges", invisible);
  } else {
    b.set("u_extinction_points", std::vector<double>(3));
    b.set("u_color_points", std::vector<double>(5));
  }
  b.define("AMRTEX_LOGARITHMIC", drawn && tf.logarithmic ? 1 : 0);
  b.define("AMRTEX_EXTINCTION_POINTS", extinction_points);
  b.define("AMRTEX_COLOR_POINTS", color_points);
  b.define("AMRTEX_INVISIBLE_RANGES", static_cast<int>(invisible.size() / 2));
}

void add_more_transfer_functions(const DomainGeometry& geometry, const Scene& scene, SceneBindings& b) {
  const std::vector<FieldTransfer>& more = scene.more_fields;
  b.define("AMRTEX_TRANSFERS", 1 + static_cast<int>(more.size()));
  if (more.empty()) return;
  std::vector<double> invisible;
  for (std::size_t number = 1; number <= more.size(); ++number) {
    const TransferFunction& tf = more[number - 1].transfer_function;
    const std::string suffix = fmt::format("_{}", number);
    add_points(tf, extinction_unit(geometry, tf), b, suffix);
    b.define("AMRTEX_EXTINCTION_POINTS" + suffix, static_cast<int>(tf.extinction.size()));
    b.define("AMRTEX_COLOR_POINTS" + suffix, static_cast<int>(tf.color.size()));
    b.define("AMRTEX_LOGARITHMIC" + suffix, tf.logarithmic ? 1 : 0);
    for (const auto& [from, to] : invisible_ranges(tf))
      invisible.insert(invisible.end(), {static_cast<double>(number), as_float(from), as_float(to)});
  }
  b.define("AMRTEX_MORE_INVISIBLE_RANGES", static_cast<int>(invisible.size() / 3));
  if (!invisible.empty()) b.set("u_more_invisible_ranges", invisible);
}

void add_knots(const TransferFunction& tf, double unit, SceneBindings& b) {
  const std::vector<double> numbers = knots(tf, unit);
  const std::size_t count = numbers.size() / 6;
  // over log10 a line from a value near 0 would lie at tiny values nearly all of its way: a decade below the first point will do
  b.set("u_knot_lowest", tf.logarithmic ? numbers[6] - 1 : -1e30);
  const bool few = count <= kMostKnots;
  b.define("AMRTEX_KNOTS", few ? static_cast<int>(count) : 0);
  if (few) {
    b.set("u_knots", numbers);
    return;
  }
  HostTexture buffer = make_buffer("transfer_knots", TexelFormat::r32f, static_cast<int>(numbers.size()));
  std::transform(numbers.begin(), numbers.end(), buffer.as<float>(), [](double v) { return static_cast<float>(v); });
  b.set("u_knot_count", static_cast<int>(count));
  b.buffers.push_back(std::move(buffer));
}

}  // namespace amrtex
