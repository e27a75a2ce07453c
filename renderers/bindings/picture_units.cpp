#include "renderers/bindings/picture_units.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Lengths and results that shaders take as they are.
constexpr int kLeastLength = -100, kMostLength = 100;
constexpr int kLeastResult = -90, kMostResult = 120;
/// Exponent of the largest sum where numbers are scaled to have one.
constexpr int kScaledSum = 100;

bool between(double v, int least, int most) { return v >= std::ldexp(1.0, least) && v <= std::ldexp(1.0, most); }

/// A power of two by which a length is divided, so that it and the largest result are floats; 1 where they are.
double length_divisor(double edge, double most) {
  const bool as_it_is = between(edge, kLeastLength, kMostLength) && (most == 0 || between(most, kLeastResult, kMostResult));
  return as_it_is ? 1 : std::ldexp(1.0, std::ilogb(edge));
}

/// Throws where a line integral may be no double. `largest`: magnitude of a value; `length`: of the longest way.
void require_double(double largest, double edge, double edges) {
  if (!(largest > 0)) return;
  const int exponent = std::ilogb(largest) + std::ilogb(edge) + std::ilogb(edges);
  if (exponent <= 1020 && exponent >= -1000) return;
  throw UnsupportedError(
      fmt::format("mode projection: values up to {:.3g} over lengths up to {:.3g}: their products, of about 2^{}, "
                  "are no doubles; accepted: products between 2^-1000 and 2^1020",
                  largest, edges * edge, exponent));
}

double magnitude(double min, double max) { return std::isnan(min) ? 0 : std::max(std::abs(min), std::abs(max)); }

void add_projection(const DomainGeometry& geometry, const EncodedField& field, SceneBindings& b) {
  const FieldStatistics& s = field.values.front();
  const ValueUnits units = field.scale.units;
  const double edge = geometry.smallest_edge();
  const double edges = glm::length(geometry.size() / edge);
  require_double(magnitude(s.min, s.max), edge, edges);
  const double sum = magnitude(units.number(s.min), units.number(s.max)) * edges;
  const double sum_unit = sum > std::ldexp(1.0, kMostResult) ? std::ldexp(1.0, kScaledSum - std::ilogb(sum)) : 1;
  const double divisor = length_divisor(edge, sum * sum_unit * edge);
  b.set("u_sum_unit", sum_unit);
  b.set("u_length_unit", edge / divisor);
  b.picture = {std::ldexp(divisor, std::ilogb(units.scale) - std::ilogb(sum_unit)), units.offset, units.offset == 0 ? 0 : edge};
}

/// World distance from the eye to the farthest place of the domain.
double farthest(const DomainGeometry& geometry, const Scene& scene) {
  const double edge = geometry.smallest_edge();
  return edge * (glm::length((scene.view.eye - geometry.middle()) / edge) + glm::length(geometry.size() / edge));
}

}  // namespace

void add_picture_units(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, SceneBindings& b) {
  const RenderSettings& s = scene.settings;
  if (s.mode == Mode::projection) {
    add_projection(geometry, field, b);
  } else {
    const bool depth = s.draws_surfaces() && s.isosurfaces.output == Output::depth;
    const double edge = geometry.smallest_edge();
    const double divisor = depth ? length_divisor(edge, farthest(geometry, scene)) : 1;
    b.set("u_sum_unit", 1.0);
    b.set("u_length_unit", edge / divisor);
    if (depth) b.picture = {divisor, 0, 0};
    if (s.mode == Mode::mip) b.picture = {field.scale.units.scale, field.scale.units.offset, 0};
  }
  b.define("AMRTEX_OFFSET_PICTURE", b.picture.offset != 0 ? 1 : 0);
}

int drawn_channels(const PictureUnits& units, int channels) { return units.length > 0 ? 4 : channels; }

Picture in_picture_units(Picture drawn, const PictureUnits& units) {
  if (units.scale == 1 && units.offset == 0) return drawn;
  if (units.length == 0) {
    for (double& v : drawn.values) {
      const bool none = units.offset != 0 && v == -std::numeric_limits<double>::infinity();
      v = none ? 0 : units.offset + units.scale * v;
    }
    return drawn;
  }
  Picture picture(drawn.width, drawn.height, 1);
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    const double* d = &drawn.values[4 * i];
    picture.values[i] = units.scale * d[0] + units.offset * ((d[1] + d[2]) * units.length);
  }
  return picture;
}

}  // namespace amrtex
