#include "renderers/reference/hierarchy_reference.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <array>
#include <cmath>
#include <map>
#include <mutex>

#include "renderers/reference/filter_reference.hpp"
#include "renderers/reference/reference_clip.hpp"
#include "renderers/reference/reference_fields.hpp"
#include "renderers/reference/reference_light.hpp"
#include "renderers/reference/reference_parts.hpp"
#include "renderers/reference/reference_point.hpp"
#include "renderers/reference/reference_surface.hpp"
#include "renderers/reference/reference_tracer.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "renderers/scene/stored_units.hpp"
#include "renderers/scene/triangle_layer.hpp"

namespace amrtex {
namespace {

constexpr int kTile = 16;  // pixels; neighbouring rays share the cells in the caches

/// What a picture needs besides the field, worked out once.
struct Drawing {
  CameraFrame camera;
  Vec3d lower, upper;    // of what is drawn, finest space
  Vec3d domain_lower;    // world
  Vec3d cells_a_length;  // finest cells a world length, along the axes
  Mode mode;
  RayRule rule;  // without the ray's length
  const TransferTable* table;
  ValueUnits units;               // of the field's numbers
  const AnalyticField* truth;     // drawn instead of the field, where it is not null
  std::vector<ClipPlane> planes;  // finest cells
  std::optional<Mirror> mirror;
};

RayRule ray_rule(const AmrHierarchy& h, const ReferenceRule& rule) {
  if (!rule.step()) return {0, rule.tolerance(), 0};
  const Vec3d spacing = h.spacing(h.finest_level());
  return {*rule.step() * std::min({spacing.x, spacing.y, spacing.z}), 0, 0};
}

Drawing make_drawing(const AmrHierarchy& h, const Scene& scene, const RayRule& rule, const TransferTable* table, const ValueUnits& units,
                     const AnalyticField* truth) {
  const Vec3d domain(h.cells(h.finest_level()));
  Drawing d{camera_frame(scene.view, scene.settings.width, scene.settings.height),
            Vec3d(0),
            domain,
            h.domain_lower(),
            domain / (h.domain_upper() - h.domain_lower()),
            scene.settings.mode,
            rule,
            table,
            units,
            truth,
            {},
            {}};
  d.mirror = scene.settings.mirror;
  for (const ClipPlane& plane : scene.settings.clip_planes) d.planes.push_back(in_finest_cells(h, plane));
  if (scene.region) {
    d.lower = glm::max(d.lower, to_finest_index(h, (*scene.region)[0]));
    d.upper = glm::min(d.upper, to_finest_index(h, (*scene.region)[1]));
  }
  return d;
}

/// The ray's stretch in a closed box, not before its start; nullopt where they do not meet.
std::optional<Span> stretch_in(const IndexRay& ray, const Vec3d& lower, const Vec3d& upper) {
  Span span{0, std::numeric_limits<double>::infinity()};
  for (int a = 0; a < 3; ++a) {
    if (ray.direction[a] == 0) {
      if (ray.origin[a] < lower[a] || ray.origin[a] > upper[a]) return std::nullopt;
      continue;
    }
    const double t0 = (lower[a] - ray.origin[a]) / ray.direction[a];
    const double t1 = (upper[a] - ray.origin[a]) / ray.direction[a];
    span.from = std::max(span.from, std::min(t0, t1));
    span.to = std::min(span.to, std::max(t0, t1));
  }
  if (!(span.to > span.from)) return std::nullopt;
  return span;
}

/// The cubic through the values at 0, 1/3, 2/3 and 1 of a piece.
PieceFunction cubic_through(const std::array<double, 4>& v) {
  PieceFunction f;
  const double d1 = v[1] - v[0], d2 = v[2] - v[0], d3 = v[3] - v[0];
  f.base = v[0];
  f.numerator.c = {0, 9 * d1 - 4.5 * d2 + d3, -22.5 * d1 + 18 * d2 - 4.5 * d3, 13.5 * d1 - 13.5 * d2 + 4.5 * d3};
  f.upper = maximum(f);
  PieceFunction below = f;
  below.base = -f.base;
  below.numerator *= -1;
  f.lower = -maximum(below);
  return f;
}

/// A ray through an analytic field, its pieces those of the mesh in parts of which each is a cubic.
class AnalyticRay {
 public:
  AnalyticRay(const Drawing& drawing, const IndexRay& ray) : drawing_(drawing), ray_(ray) {}

  template <class Visit>
  bool visit_parts(double from, double to, Visit&& visit) const {
    const double part = drawing_.rule.part;
    const int count = part > 0 ? static_cast<int>(std::max(std::ceil((to - from) / part), 1.0)) : 1;
    const double length = (to - from) / count;
    for (int i = 0; i < count; ++i) {
      const double start = from + length * i;
      const std::array<double, 4> values{value(start), value(start + length / 3), value(start + 2 * length / 3),
                                         value(start + length)};
      if (!visit_part({start, from + length * (i + 1)}, values, part > 0 ? 0 : kHalvings, visit)) return false;
    }
    return true;
  }

 private:
  static constexpr int kHalvings = 16;  // where the field jumps

  /// The part, or its halves where the cubic misses the values between: these and those before are all that the halves need.
  template <class Visit>
  bool visit_part(const RaySpan& span, const std::array<double, 4>& v, int halvings, Visit&& visit) const {
    const PieceFunction f = cubic_through(v);
    if (halvings == 0) return visit(f, span.from, span.to);
    std::array<double, 3> between{};
    double off = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double s = (static_cast<double>(k) * 2 + 1) / 6;
      between[k] = value(span.from + s * span.length());
      off = std::max(off, std::abs(f(s) - between[k]));
    }
    if (off <= drawing_.rule.tolerance * f.largest()) return visit(f, span.from, span.to);
    const double middle = span.from + span.length() / 2;
    return visit_part({span.from, middle}, {v[0], between[0], v[1], between[1]}, halvings - 1, visit) &&
           visit_part({middle, span.to}, {between[1], v[2], between[2], v[3]}, halvings - 1, visit);
  }

  double value(double t) const {
    const Vec3d p = drawing_.domain_lower + (ray_.origin + t * ray_.direction) / drawing_.cells_a_length;
    return drawing_.units.number(drawing_.truth->value(p));
  }

  const Drawing& drawing_;
  const IndexRay& ray_;
};

/// Pieces of the field, or of the analytic one in its place, through all parts of a ray; places count from its first.
template <class Visit>
void trace(ReferenceTracer& tracer, const std::vector<RayPart>& parts, const Drawing& drawing, Visit&& visit) {
  bool more = true;
  for (const RayPart& part : parts) {
    if (!more) return;
    const auto visit_piece = [&](const PieceFunction& f, double from, double to) {
      more = visit(f, part.start + from, part.start + to);
      return more;
    };
    if (drawing.truth == nullptr) {
      tracer.trace(part.ray, part.length, visit_piece);
      continue;
    }
    const AnalyticRay analytic(drawing, part.ray);
    tracer.trace(part.ray, part.length,
                 [&](const PieceFunction&, double from, double to) { return analytic.visit_parts(from, to, visit_piece); });
  }
}

/// What rays may be off by, and what they took.
struct Cost {
  double error = 0;
  std::int64_t evaluations = 0;
};

RayRule rule_of(const Drawing& drawing, const std::vector<RayPart>& parts) {
  RayRule rule = drawing.rule;
  rule.length = parts.back().start + parts.back().length;
  return rule;
}

Cost write_light(const LightIntegral& light, double* pixel) {
  for (int c = 0; c < 3; ++c) pixel[c] = light.color()[c];
  pixel[3] = 1 - light.transmittance();
  return {light.error(), light.evaluations()};
}

Cost draw_light(ReferenceTracer& tracer, const std::vector<RayPart>& parts, const Drawing& drawing, LightIntegral::Arriving lamp,
                double* pixel) {
  LightIntegral light(rule_of(drawing, parts), drawing.table, std::move(lamp));
  trace(tracer, parts, drawing, [&](const PieceFunction& f, double from, double to) {
    light.add(f, {from, to});
    return !light.opaque();
  });
  return write_light(light, pixel);
}

/// A further field of a volume.
struct OtherField {
  const FilterReference* filter;
  TransferTable table;
};

/// draw_light() of several fields.
Cost draw_fields(ReferenceTracer& first, std::vector<ReferenceTracer>& others, const std::vector<RayPart>& parts,
                 const Drawing& drawing, const std::vector<OtherField>& other_fields, double* pixel) {
  std::vector<const TransferTable*> tables{drawing.table};
  for (const OtherField& other : other_fields) tables.push_back(&other.table);
  FieldsLight fields(std::move(tables));
  for (std::size_t i = 0; i < 1 + others.size(); ++i)
    trace(i == 0 ? first : others[i - 1], parts, drawing, [&](const PieceFunction& f, double from, double to) {
      fields.add(i, f, from, to);
      return true;
    });
  LightIntegral light(rule_of(drawing, parts));
  fields.drain(light);
  return write_light(light, pixel);
}

/// With the sum's own roundings taken back (A. Neumaier 1974).
Cost line_integral(ReferenceTracer& tracer, const std::vector<RayPart>& parts, const Drawing& drawing, double* pixel) {
  const double part = drawing.rule.part;
  double sum = 0, lost = 0;
  double passed = 0;  // what has values
  Cost cost;
  trace(tracer, parts, drawing, [&](const PieceFunction& f, double from, double to) {
    const Mean m = part > 0 ? Mean{mean(f, static_cast<int>(std::clamp(std::ceil((to - from) / part), 1.0, 16.0)))}
                            : mean_within(f, kLineTolerance);
    const double value = (to - from) * m.value;
    const double next = sum + value;
    lost += std::abs(sum) >= std::abs(value) ? sum - next + value : value - next + sum;
    sum = next;
    passed += to - from;
    cost.error += (to - from) * m.error;
    cost.evaluations += m.evaluations;
    return true;
  });
  if (std::isfinite(sum)) sum += lost;
  const ValueUnits& units = drawing.units;
  *pixel = units.offset == 0 ? units.scale * sum : units.scale * sum + units.offset * passed;
  cost.error *= units.scale;
  return cost;
}

Cost line_maximum(ReferenceTracer& tracer, const std::vector<RayPart>& parts, const Drawing& drawing, double* pixel) {
  double best = -std::numeric_limits<double>::infinity();
  double largest = 0;
  trace(tracer, parts, drawing, [&](const PieceFunction& f, double, double) {
    if (!(f.upper > best)) return true;
    best = std::max(best, maximum(f));
    largest = std::max(largest, f.largest());
    return true;
  });
  *pixel = std::isfinite(best) ? drawing.units.value(best) : 0;
  // the roundings of a cubic's terms at its extremum
  return {8 * std::numeric_limits<double>::epsilon() * largest * drawing.units.scale, 0};
}

/// What one thread draws with.
struct Worker {
  ReferenceTracer tracer;
  std::optional<SurfacePainter> painter;  // where there are surfaces
  std::optional<LampTracer> lamp;         // where there is one
  std::vector<ReferenceTracer> others;    // of further fields
  Cost cost;                              // the worst pixel's error; evaluations of all

  void count(Cost pixel) {
    if (lamp) pixel.error += lamp->take_error();
    if (!(pixel.error <= cost.error)) cost.error = pixel.error;
    cost.evaluations += pixel.evaluations;
  }
};

/// Light of the lamp along a ray; empty where there is no lamp.
LightIntegral::Arriving arriving_light(Worker& worker, const IndexRay& ray) {
  if (!worker.lamp) return {};
  return [&lamp = *worker.lamp, &ray](double t) { return lamp.light_at(ray.origin + t * ray.direction); };
}

/// A ray from where it enters what is drawn, and its way through the mirror there may be; world length from the eye to there.
struct Way {
  const IndexRay& ray;
  const std::vector<RayPart>& parts;
  double start;
};

Cost draw_ray(Worker& worker, const Drawing& drawing, const std::vector<OtherField>& others, const Way& way, double* pixel) {
  switch (drawing.mode) {
    case Mode::dvr:
      if (!others.empty()) return draw_fields(worker.tracer, worker.others, way.parts, drawing, others, pixel);
      return draw_light(worker.tracer, way.parts, drawing, arriving_light(worker, way.ray), pixel);
    case Mode::projection:
      return line_integral(worker.tracer, way.parts, drawing, pixel);
    case Mode::mip:
      return line_maximum(worker.tracer, way.parts, drawing, pixel);
    case Mode::iso:
    case Mode::dvr_iso: {
      const SurfacePainter::Cost cost =
          worker.painter->draw(worker.tracer, way.parts, drawing.mirror, way.start, arriving_light(worker, way.ray), pixel);
      return {cost.error, cost.evaluations};
    }
  }
  return {};
}

/// `most`: world length of the ray at which it ends at the latest.
void draw_pixel(Worker& worker, const Drawing& drawing, const std::vector<OtherField>& others, int x, int y, double most,
                Picture& picture) {
  const WorldRay world = camera_ray(drawing.camera, x, y, picture.width, picture.height);
  IndexRay ray{(world.origin - drawing.domain_lower) * drawing.cells_a_length, world.direction * drawing.cells_a_length};
  Vec3d lower = drawing.lower;
  Vec3d upper = drawing.upper;
  double face = 0;
  if (drawing.mirror) {  // the image is drawn too
    const int axis = drawing.mirror->axis;
    face = drawing.mirror->upper ? upper[axis] : lower[axis];
    (drawing.mirror->upper ? upper : lower)[axis] += (drawing.mirror->upper ? 1 : -1) * (upper[axis] - lower[axis]);
  }
  auto span = stretch_in(ray, lower, upper);
  if (span) span = cut(ray, drawing.planes, {span->from, std::min(span->to, most)});
  if (!span || !(span->to > span->from)) return;
  ray.origin += span->from * ray.direction;  // from here on no digits are spent on the way to the mesh
  const std::vector<RayPart> parts = parts_of(ray, world.direction, span->to - span->from, drawing.mirror, face);
  worker.count(draw_ray(worker, drawing, others, {ray, parts, span->from}, picture.pixel(x, y)));
}

/// What is left of a triangle's light behind the volume; pictures of one channel have no place for it.
void draw_triangle(const RenderSettings& s, const TriangleLayer::Pixel& first, double* pixel) {
  if (first.object < 0 || s.picture_channels() == 1) return;
  const Vec3d rgb = s.triangles[static_cast<std::size_t>(first.object)].color * first.light;
  for (int c = 0; c < 3; ++c) pixel[c] += (1 - pixel[3]) * rgb[c];
  pixel[3] = 1;
}

void check(const Scene& scene, const ReferenceRule& rule) {
  if (rule.step() && !(*rule.step() > 0))
    throw Error(fmt::format("reference step {}: must be a positive number of cell widths", *rule.step()));
  if (!rule.step() && !(rule.tolerance() >= ReferenceTolerance::kLeast && rule.tolerance() <= 1))
    throw Error(fmt::format("reference tolerance {}: accepted: a number from {} to 1, the largest error of a channel",
                            rule.tolerance(), ReferenceTolerance::kLeast));
  if (scene.settings.width < 1 || scene.settings.height < 1)
    throw Error(fmt::format("picture of {} x {} pixels: both must be at least 1", scene.settings.width, scene.settings.height));
  if (scene.settings.draws_volume()) validate(scene.transfer_function);
  validate(scene);
}

Picture draw_pixels(const Scene& scene, const Drawing& drawing, const std::vector<OtherField>& others,
                    tbb::enumerable_thread_specific<Worker>& workers) {
  std::optional<TriangleLayer> triangles;
  if (!scene.settings.triangles.empty()) triangles = trace_triangles(scene);
  Picture picture(scene.settings.width, scene.settings.height, scene.settings.picture_channels());
  const int columns = ceil_div(picture.width, kTile);
  tbb::parallel_for(0, columns * ceil_div(picture.height, kTile), [&](int tile) {
    Worker& worker = workers.local();
    const int x0 = tile % columns * kTile;
    const int y0 = tile / columns * kTile;
    for (int y = y0; y < std::min(y0 + kTile, picture.height); ++y)
      for (int x = x0; x < std::min(x0 + kTile, picture.width); ++x) {
        const TriangleLayer::Pixel first = triangles ? triangles->at(x, y) : TriangleLayer::Pixel{};
        draw_pixel(worker, drawing, others, x, y, first.distance, picture);
        draw_triangle(scene.settings, first, picture.pixel(x, y));
      }
  });
  return picture;
}

/// Are all errors of the picture those of integrals? Hits of surfaces are exact but for rounding, which at a silhouette is all or
/// nothing; ambient occlusion takes a fixed number of rays.
bool knows_error(const RenderSettings& s) {
  return s.mode != Mode::iso && !(s.draws_surfaces() && s.isosurfaces.ambient_occlusion);
}

double extinction_scale(const AmrHierarchy& h, const TransferFunction& tf) {
  const Vec3d edges = h.domain_upper() - h.domain_lower();
  return tf.length_unit == TransferFunction::LengthUnit::world ? 1 : 1 / std::max({edges.x, edges.y, edges.z});
}

}  // namespace

struct HierarchyReference::Data {
  Data(const AmrHierarchy& hierarchy, int field, const FilterDefinition& definition)
      : filter(make_filter_reference(hierarchy, field, definition)), points([this] { return ReferencePoint(*filter); }) {}

  std::unique_ptr<FilterReference> filter;
  tbb::enumerable_thread_specific<ReferencePoint> points;
  std::mutex mutex;
  std::map<int, std::unique_ptr<FilterReference>> others;  // over further fields, made when a scene first asks for them

  const FilterReference* color_filter(const Scene& scene);
  const FilterReference* other_filter(const std::string& field);
};

/// Over the field that colours the scene's surfaces; null where the isovalue does.
const FilterReference* HierarchyReference::Data::color_filter(const Scene& scene) {
  const std::string& name = scene.settings.isosurfaces.color_field;
  if (!scene.settings.draws_surfaces() || name.empty()) return nullptr;
  return other_filter(name);
}

const FilterReference* HierarchyReference::Data::other_filter(const std::string& field) {
  const AmrHierarchy& hierarchy = filter->hierarchy();
  const int index = hierarchy.field_index(field);
  const std::lock_guard lock(mutex);
  std::unique_ptr<FilterReference>& other = others[index];
  // while it waits for its own tasks this thread must not take up another picture, which would lock again
  if (!other) tbb::this_task_arena::isolate([&] { other = make_filter_reference(hierarchy, index, filter->definition()); });
  return other.get();
}

HierarchyReference::HierarchyReference(const AmrHierarchy& hierarchy, int field, FilterDefinition definition)
    : data_(new Data(hierarchy, field, definition)) {}
HierarchyReference::~HierarchyReference() = default;

std::optional<double> HierarchyReference::sample(const FinestPosition& p) const {
  const std::optional<double> number = data_->points.local().value(p);
  return number ? std::optional(data_->filter->field().units().value(*number)) : std::nullopt;
}

std::optional<double> HierarchyReference::sample(const Vec3d& p_world) const {
  const auto p = finest_position(data_->filter->hierarchy(), p_world);
  return p ? sample(*p) : std::nullopt;
}

ReferencePicture HierarchyReference::draw(const Scene& scene, const ReferenceRule& rule) const {
  return draw(scene, rule, nullptr);
}

Picture HierarchyReference::render(const Scene& scene, const ReferenceRule& rule, const AnalyticField& truth) const {
  if (scene.settings.draws_surfaces())
    throw UsageError(
        fmt::format("mode {}: an analytic field is drawn in the modes dvr, projection and mip", mode_name(scene.settings.mode)));
  if (!scene.more_fields.empty()) throw UsageError("an analytic field is drawn alone, without further fields");
  return draw(scene, rule, &truth).picture;
}

ReferencePicture HierarchyReference::draw(const Scene& given, const ReferenceRule& rule, const AnalyticField* truth) const {
  check(given, rule);
  const AmrHierarchy& h = data_->filter->hierarchy();
  require_resolved(h, given);
  const Scene scene = in_units(given, [&](int number) {
    return number == 0 ? data_->filter->field().units()
                       : data_->other_filter(given.more_fields[static_cast<std::size_t>(number) - 1].field)->field().units();
  });
  const FilterReference* color_filter = data_->color_filter(scene);
  std::optional<TransferTable> table;
  if (scene.settings.draws_volume()) table.emplace(scene.transfer_function, extinction_scale(h, scene.transfer_function));
  const Drawing drawing = make_drawing(h, scene, ray_rule(h, rule), table ? &*table : nullptr, data_->filter->field().units(), truth);
  std::optional<SurfaceScene> surfaces;
  if (scene.settings.draws_surfaces())
    surfaces.emplace(given, scene, *data_->filter, color_filter, drawing.table, drawing.rule);
  if (surfaces) {
    surfaces->lower = drawing.lower;
    surfaces->upper = drawing.upper;
    surfaces->planes = drawing.planes;
  }
  std::optional<LampScene> lamp;
  if (scene.settings.point_light)
    lamp.emplace(scene, *data_->filter, extinction_scale(h, scene.transfer_function), drawing.lower, drawing.upper, drawing.rule);
  std::vector<OtherField> others;
  for (const FieldTransfer& f : scene.more_fields)
    others.push_back(
        {data_->other_filter(f.field), TransferTable(f.transfer_function, extinction_scale(h, f.transfer_function))});
  tbb::enumerable_thread_specific<Worker> workers([&] {
    Worker worker{ReferenceTracer(*data_->filter), std::nullopt, std::nullopt, {}, {}};
    for (const OtherField& other : others) worker.others.emplace_back(*other.filter);
    if (surfaces) worker.painter.emplace(*surfaces);
    if (lamp) worker.lamp.emplace(*lamp);
    return worker;
  });
  ReferencePicture result;
  result.picture = draw_pixels(scene, drawing, others, workers);
  Cost cost;
  for (const Worker& worker : workers) {
    if (!(worker.cost.error <= cost.error)) cost.error = worker.cost.error;
    cost.evaluations += worker.cost.evaluations + (worker.lamp ? worker.lamp->evaluations() : 0);
  }
  result.evaluations = cost.evaluations;
  if (!rule.step() && truth == nullptr && knows_error(scene.settings)) result.error = cost.error;
  return result;
}

}  // namespace amrtex
