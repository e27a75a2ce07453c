#include "renderers/reference/reference_surface.hpp"

#include <algorithm>
#include <cmath>

#include "renderers/reference/reference_clip.hpp"

namespace amrtex {
namespace {

// f this near to an isovalue at the end of a monotone stretch, relative to the values there, has reached it: what is
// left is rounding, and must not make two crossings of a touch or a hit of a plateau
constexpr double kTouch = 64 * std::numeric_limits<double>::epsilon();
// gaps between pieces, relative to the ray's length in the mesh, that are rounding
constexpr double kJoint = 1e-12;

// Rays of ambient occlusion from each hit, whatever the scene asks for: their share is off by about 1/500.
constexpr int kOpenRays = 512;
// where they begin above the surface, finest cells: rounding must not put them behind it
constexpr double kAbove = 1e-3;

double touching(const PieceFunction& f) {
  double scale = std::max(std::abs(f.lower), std::abs(f.upper));
  if (f.rational) scale *= std::max(f.denominator(0), f.denominator(1));
  return kTouch * scale;
}

/// At equal places values come in the order in which f passes them.
bool meets_before(const Crossing& a, const Crossing& b) {
  if (a.s != b.s) return a.s < b.s;
  return a.rising ? a.surface < b.surface : a.surface > b.surface;
}

Vec3d unit(const Vec3d& v) {
  const double size = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return size > 0 ? glm::normalize(v / size) : Vec3d(0);  // scaled first: gradients in worlds of 1e200 work
}

/// A crossing's point in finest space; one on a face lies on it to the bit, so that it belongs to the upper cell.
Vec3d point_of(const ReferenceTracer& tracer, const IndexRay& ray, double t, double s) {
  return s == 0 ? tracer.front() : glm::clamp(ray.origin + t * ray.direction, Vec3d(0), tracer.domain());
}

}  // namespace

const std::vector<Crossing>& SurfaceFinder::next(const PieceFunction& f, double from, double to) {
  crossings_.clear();
  if (from - end_ > joint_) std::fill(sides_.begin(), sides_.end(), Side::unknown);
  end_ = to;
  for (std::size_t i = 0; i < isovalues_.size(); ++i) {
    if (isovalues_[i] <= f.lower)
      enter(i, Side::above, 0);
    else if (isovalues_[i] > f.upper)
      enter(i, Side::below, 0);
    else
      cross(f, to - from, i);
  }
  std::sort(crossings_.begin(), crossings_.end(), meets_before);
  return crossings_;
}

void SurfaceFinder::enter(std::size_t surface, Side side, double s) {
  if (sides_[surface] != Side::unknown && sides_[surface] != side) crossings_.push_back({s, surface, side == Side::above});
  sides_[surface] = side;
}

/// Between its extrema f is monotone: each such stretch lies on one side or has one root.
void SurfaceFinder::cross(const PieceFunction& f, double length, std::size_t surface) {
  const Cubic g = f.minus(isovalues_[surface]);
  const double touch = touching(f);
  const auto height = [&](double s) { return std::abs(g(s)) <= touch ? 0 : g(s); };
  std::array<double, 2> extrema{};
  const int n = extrema_in_unit(g, extrema);
  double a = 0;
  for (int i = 0; i <= n; ++i) {
    const double b = i < n ? extrema[static_cast<std::size_t>(i)] : 1;
    const double first = height(a);
    const double last = height(b);
    // a stretch on the isovalue is a plateau, and above, unless rounding made it
    if (first != 0 || last != 0 || (b - a) * length > joint_)
      enter(surface, first < 0 || (first == 0 && last < 0) ? Side::below : Side::above, a);
    if (first * last < 0) enter(surface, last < 0 ? Side::below : Side::above, root_between(g, a, b));
    a = b;
  }
}

SurfaceScene::SurfaceScene(const Scene& s, const Scene& stored, const FilterReference& f, const FilterReference* color,
                           const TransferTable* table, const RayRule& ray_rule)
    : scene(s), settings(stored.settings.isosurfaces), filter(f), color_filter(color), volume(table), rule(ray_rule) {
  for (const double value : scene.settings.isosurfaces.values) rgb.push_back(surface_color(scene, value));
}

SurfacePainter::Cost SurfacePainter::draw(ReferenceTracer& tracer, const std::vector<RayPart>& parts,
                                          const std::optional<Mirror>& mirror, double start, const LightIntegral::Arriving& lamp,
                                          double* pixel) {
  if (scene_.settings.output == Output::color) return draw_color(tracer, parts, lamp, pixel);
  SurfaceFinder finder(scene_.settings.values, kJoint * (parts.back().start + parts.back().length));
  bool found = false;
  for (const RayPart& part : parts) {
    if (found) break;
    tracer.trace(part.ray, part.length, [&](const PieceFunction& f, double from, double to) {
      const auto& crossings = finder.next(f, part.start + from, part.start + to);
      found = !crossings.empty();
      if (!found) return true;
      const double s = crossings.front().s;
      const double t = from + s * (to - from);
      if (scene_.settings.output == Output::depth) {
        *pixel = start + part.start + t;
      } else {
        Vec3d normal = normal_at(point_of(tracer, part.ray, t, s));
        if (part.mirrored) normal[mirror->axis] = -normal[mirror->axis];
        for (int a = 0; a < 3; ++a) pixel[a] = normal[a];
        pixel[3] = 1;
      }
      return false;
    });
  }
  return {};
}

SurfacePainter::Cost SurfacePainter::draw_color(ReferenceTracer& tracer, const std::vector<RayPart>& parts,
                                                const LightIntegral::Arriving& lamp, double* pixel) {
  const Isosurfaces& surfaces = scene_.settings;
  const double way = parts.back().start + parts.back().length;
  LightIntegral light({scene_.rule.part, scene_.rule.tolerance, way}, scene_.volume, lamp);
  SurfaceFinder finder(surfaces.values, kJoint * way);
  for (const RayPart& part : parts) {
    if (light.opaque()) break;
    tracer.trace(part.ray, part.length, [&](const PieceFunction& f, double from, double to) {
      double behind = 0;  // the last crossing
      for (const Crossing& c : finder.next(f, part.start + from, part.start + to)) {
        light.add(f, {from, to}, behind, c.s);
        behind = c.s;
        if (light.opaque()) return false;
        const double t = from + c.s * (to - from);
        const Vec3d p = point_of(tracer, part.ray, t, c.s);
        const Vec3d rgb = color_at(p, c.surface, part.direction) * (lamp ? lamp(t) : 1.0);
        light.add_surface(rgb, surfaces.opacity.empty() ? 1 : surfaces.opacity[c.surface]);
      }
      light.add(f, {from, to}, behind);
      return !light.opaque();
    });
  }
  for (int c = 0; c < 3; ++c) pixel[c] = light.color()[c];
  pixel[3] = 1 - light.transmittance();
  return {light.error(), light.evaluations()};
}

/// What the surface sends to the eye.
Vec3d SurfacePainter::color_at(const Vec3d& p, std::size_t surface, const Vec3d& direction) {
  Vec3d rgb = scene_.rgb[surface];
  if (color_point_) {
    const auto position = position_at(scene_.color_filter->hierarchy(), p);
    const auto value = position ? color_point_->value(*position) : std::nullopt;
    if (value) rgb = surface_color(scene_.scene, scene_.color_filter->field().units().value(*value));
  }
  if (scene_.settings.shading == Shading::none && !around_) return rgb;
  const Vec3d normal = normal_at(p);
  if (normal == Vec3d(0)) return rgb;
  const double cosine = glm::dot(normal, direction);
  if (scene_.settings.shading != Shading::none) rgb *= surface_light(cosine);
  return around_ ? rgb * open_share(p, cosine > 0 ? -normal : normal) : rgb;
}

/// Share of the rays from p, cosine-weighted around `up`, that meet no surface within the radius.
double SurfacePainter::open_share(const Vec3d& p, const Vec3d& up) {
  const AmrHierarchy& h = scene_.filter.hierarchy();
  const Vec3d cells_a_length = Vec3d(h.cells(h.finest_level())) / (h.domain_upper() - h.domain_lower());
  const Vec3d right = glm::normalize(glm::cross(up, std::abs(up.x) < 0.7 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0)));
  const Vec3d ahead = glm::cross(up, right);
  const Vec3d from = glm::clamp(p + kAbove * up, scene_.lower, scene_.upper);
  int open = 0;
  for (int i = 0; i < kOpenRays; ++i) {
    const double square = (i + 0.5) / kOpenRays;
    const double angle = i * 3.14159265358979323846 * (3 - std::sqrt(5.0));
    const Vec3d way = (right * std::cos(angle) + ahead * std::sin(angle)) * std::sqrt(square) + up * std::sqrt(1 - square);
    const IndexRay ray{from, way * cells_a_length};
    double end = scene_.settings.ambient_occlusion->radius;
    for (int a = 0; a < 3; ++a)
      if (ray.direction[a] != 0)
        end = std::min(end, ((ray.direction[a] > 0 ? scene_.upper : scene_.lower)[a] - from[a]) / ray.direction[a]);
    end = cut(ray, scene_.planes, {0, end}).to;
    bool met = false;
    SurfaceFinder finder(scene_.settings.values, kJoint * end);
    if (end > 0)
      around_->trace(ray, end, [&](const PieceFunction& f, double t0, double t1) {
        met = !finder.next(f, t0, t1).empty();
        return !met;
      });
    open += met ? 0 : 1;
  }
  return static_cast<double>(open) / kOpenRays;
}

Vec3d SurfacePainter::normal_at(const Vec3d& p) {
  const auto gradient = scene_.settings.shading == Shading::analytic ? point_.derivative(p) : point_.gradient(p);
  return unit(gradient.value_or(Vec3d(0)));
}

}  // namespace amrtex
