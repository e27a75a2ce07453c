// What is drawn and how, independent of any encoding: view, transfer function, settings.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/domain_geometry.hpp"
#include "structures/mesh/json.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// A camera. The picture's first row is its top.
struct View {
  Vec3d eye{0, 0, 3};  ///< world
  Vec3d at{0};         ///< world
  Vec3d up{0, 0, 1};   ///< any length, not parallel to at - eye
  double fov_y = 35;   ///< vertical field of view, degrees; perspective only
  bool orthographic = false;
  double height = 1;  ///< world height of the picture; orthographic only
};

/// A view resolved for a picture size. The ray of pixel (x, y), y from the top, with
/// u = 2 (x + 1/2) / width - 1 and v = 1 - 2 (y + 1/2) / height, is
///   perspective:  eye + t normalise(forward + u right + v up)
///   orthographic: eye + u right + v up + t forward
struct CameraFrame {
  Vec3d eye{0};
  Vec3d forward{0};  ///< unit length
  Vec3d right{0};    ///< half of the picture's width at distance 1 (perspective) or in world units (orthographic)
  Vec3d up{0};       ///< half of the picture's height, likewise
  bool orthographic = false;
};

/// Throws Error when the view is degenerate.
CameraFrame camera_frame(const View& view, int width, int height);

struct WorldRay {
  Vec3d origin;
  Vec3d direction;  ///< unit length
};
WorldRay camera_ray(const CameraFrame& camera, int x, int y, int width, int height);

/// Value -> emitted colour and extinction, both piecewise linear over the value or
/// its logarithm; constant beyond the first and last point.
struct TransferFunction {
  struct ExtinctionPoint {
    double value;
    double extinction;  ///< per length, see length_unit
  };
  struct ColorPoint {
    double value;
    Vec3d rgb;  ///< linear, in [0, 1]
  };
  enum class LengthUnit { longest_edge, world };

  std::vector<ExtinctionPoint> extinction;            ///< ascending values
  std::vector<ColorPoint> color;                      ///< ascending values
  bool logarithmic = false;                           ///< points are joined over log10(value); values <= 0 take the first point's
  LengthUnit length_unit = LengthUnit::longest_edge;  ///< of 1 / extinction: the domain's longest edge, or the file's world unit

  double axis(double value) const;  ///< value, or log10 of it
  double extinction_at(double value) const;
  Vec3d color_at(double value) const;
  /// Largest extinction over [min, max].
  double max_extinction(double min, double max) const;
};

/// What is wrong with a curve (points not ascending, negative or NaN extinction, none at all, log axis with values <= 0), and
/// nothing where it is right.
std::string extinction_problem(const TransferFunction& transfer_function);
std::string color_problem(const std::vector<TransferFunction::ColorPoint>& points, bool logarithmic);
/// Throws Error that names the curve.
void validate(const TransferFunction& transfer_function);

/// `iso` draws isosurfaces, `dvr_iso` isosurfaces inside the volume.
enum class Mode { dvr, projection, mip, iso, dvr_iso };
/// Samples at equal distances along a ray; at distances of the region's own cells; or at distances of which the host says for each
/// place how far a budget lets them be apart.
enum class Sampling { lattice, adaptive, planned };
/// How rays pass what is hidden (the numbers of AMRTEX_LEAPS_... in shaders/block_maps.h): region by region, by one map of
/// distances, or by one for each octant of directions.
enum class Leap { off, cube, octant };
/// Who draws: the raycaster in one pass, or one of those that draw the field's boxes one by one (box_consumer.hpp).
enum class ConsumerKind { raycast, multipass, slices, stencil_slices };
/// How the raycaster's rays are started: a fragment each, or tiles of 8 x 8 pixels by a compute shader. One text either way.
enum class Dispatch { fragment, compute };
/// What slices are blended in. Eight bits a channel are the historical control: 256 slices are off by 0.1.
enum class SliceTarget { rgba32f, rgba8 };
/// How the light of an interval follows from samples (docs/integrators.md). `euler` and `left` are controls
/// of order one; `tolerance` chooses its intervals itself.
enum class Integrator { exponential_midpoint, euler, left, preintegrated, tolerance };
/// What a picture of isosurfaces holds: colour; world distance from the ray's origin to the first surface,
/// 0 where there is none; or the unit normal there (the gradient's direction), alpha 1, else all 0.
enum class Output { color, depth, normal };
/// Light on isosurfaces: none, or a lamp at the eye that lights both sides. Its gradient: the encoding's stored one, else central
/// differences; central differences; the same inside of the region that holds the hit; the derivative of f.
enum class Shading { none, gradient, central, clamped, analytic };
std::string_view mode_name(Mode mode);
std::string_view sampling_name(Sampling sampling);
std::string_view leap_name(Leap leap);
std::string_view consumer_name(ConsumerKind consumer);
std::string_view slice_target_name(SliceTarget target);
std::string_view dispatch_name(Dispatch dispatch);
std::string_view integrator_name(Integrator integrator);
std::string_view output_name(Output output);
std::string_view shading_name(Shading shading);
/// These throw UsageErrors that name the accepted ones.
Mode parse_mode(std::string_view name);
Sampling parse_sampling(std::string_view name);
Leap parse_leap(std::string_view name);
ConsumerKind parse_consumer(std::string_view name);
SliceTarget parse_slice_target(std::string_view name);
Dispatch parse_dispatch(std::string_view name);
Integrator parse_integrator(std::string_view name);
Output parse_output(std::string_view name);
Shading parse_shading(std::string_view name);

inline constexpr std::size_t kMostIsovalues = 16;
inline constexpr std::size_t kMostSurfaceColors = 16;

/// Light that reaches a surface from around it: the share of `rays` from a hit, cosine-weighted over the hemisphere on the eye's
/// side, that meet no isosurface within `radius`. A surface's colour is multiplied by it.
struct AmbientOcclusion {
  int rays = 16;           ///< 1 to kMostOcclusionRays
  double radius = 0;       ///< world, above 0
  std::uint32_t seed = 0;  ///< of a turn of the rays around the normal, one a pixel
};
inline constexpr int kMostOcclusionRays = 1024;

/// Isosurfaces of the drawn field (modes `iso` and `dvr_iso`).
struct Isosurfaces {
  std::vector<double> values;   ///< isovalues in field units, ascending; 1 to kMostIsovalues
  std::vector<double> opacity;  ///< one a value, in (0, 1]; empty = 1
  std::vector<TransferFunction::ColorPoint>
      color;                      ///< colour over the isovalue, or over the second field; empty = the transfer function's
  std::string color_field;        ///< second field whose value on the surface gives its colour; empty = none
  double tolerance = 1.0 / 1024;  ///< bound on a hit's position along the ray, cell widths as `step`
  Shading shading = Shading::gradient;
  Output output = Output::color;
  std::optional<AmbientOcclusion> ambient_occlusion;  ///< absent: surfaces take no light from one another; output `color`
};

/// A lamp in a volume (modes `dvr` and `dvr_iso`). What a place sends on is multiplied by
/// ambient + (1 - ambient) exp(-optical depth of the drawn volume between the place and the lamp).
struct PointLight {
  Vec3d position{0};       ///< world; inside of the domain or not
  double ambient = 0.1;    ///< light where the lamp does not reach, in [0, 1]
  double shadow_step = 1;  ///< of the secondary ray: cell widths of each region (smallest edge)
};

/// A plane that cuts what is drawn: points with dot(normal, p) >= distance are kept.
struct ClipPlane {
  Vec3d normal{1, 0, 0};  ///< world, of any length but 0
  double distance = 0;    ///< from the world's origin, in lengths of the normal
};
inline constexpr std::size_t kMostClipPlanes = 8;
/// The same plane in cells of the finest level, with a normal whose largest component is 1.
ClipPlane in_finest_cells(const DomainGeometry& geometry, const ClipPlane& plane);

/// A face of what is drawn (the domain, or the sub-box) behind which its mirror image is drawn too.
struct Mirror {
  int axis = 0;        ///< 0 to 2
  bool upper = false;  ///< the face at the axis's upper end
  bool operator==(const Mirror&) const = default;
};
/// "-x", "+x", "-y", "+y", "-z", "+z"; the second throws a UsageError that names these.
std::string mirror_name(const Mirror& mirror);
Mirror parse_mirror(std::string_view name);

class TriangleMesh;

/// Triangles that end the rays which meet them; in pictures of colours they are seen behind what lies in front of them, lit from
/// the eye on both sides (surface_light).
struct TriangleObject {
  std::shared_ptr<const TriangleMesh> mesh;  ///< world; never null
  Vec3d color{0.8};                          ///< linear, in [0, 1]
  std::string file;                          ///< as the scene names it; empty where there is none
};
inline constexpr std::size_t kMostTriangleObjects = 16;

struct RenderSettings {
  ConsumerKind consumer = ConsumerKind::raycast;
  SliceTarget slice_target = SliceTarget::rgba32f;  ///< consumers `slices` and `stencil_slices`
  Mode mode = Mode::dvr;
  Sampling sampling = Sampling::adaptive;
  Integrator integrator = Integrator::exponential_midpoint;
  Dispatch dispatch = Dispatch::fragment;  ///< consumer `raycast`
  double tolerance = 1e-3;          ///< error asked of every channel of a pixel; integrator `tolerance` alone
  double budget = 1e-2;             ///< what the intervals of a ray may add to the error of a channel; sampling `planned` alone
  double step = 1;                  ///< cell widths (smallest edge): of the finest level for lattice, of the region for adaptive
  int width = 512;                  ///< pixels
  int height = 512;                 ///< pixels
  bool skip = true;                 ///< regions that the transfer function makes invisible are skipped
  Leap leap = Leap::octant;         ///< and many of them at a time
  std::optional<double> early_end;  ///< opacity at which a ray ends; off when absent
  bool prune = false;               ///< what the transfer function hides is not even built (mode dvr); then it may not change
  bool everything = false;          ///< structures hold also what the scene does not need, to see what leaving out saves
  Isosurfaces isosurfaces;
  std::optional<PointLight> point_light;  ///< absent: light of all places alike
  std::vector<ClipPlane> clip_planes;     ///< at most kMostClipPlanes; drawn is what all of them keep, and a cut is no surface
  /// Seed of a random offset for each ray, by which its intervals are moved (Wald et al. 2020, section 4.2); off when absent.
  std::optional<std::uint32_t> ray_offset;
  std::optional<Mirror> mirror;  ///< absent: the field alone
  /// At most kMostTriangleObjects; neither cut nor mirrored, and no part of what lights or shadows anything.
  std::vector<TriangleObject> triangles;
  /// Refined cells are drawn themselves where they are smaller on the picture, pixels; off when absent.
  std::optional<double> level_of_detail;
  std::optional<int> max_level;  ///< nothing finer is drawn where a cell of this level or a coarser one lies; off when absent

  bool prunes_levels() const { return level_of_detail || max_level; }
  bool draws_volume() const { return mode == Mode::dvr || (mode == Mode::dvr_iso && isosurfaces.output == Output::color); }
  bool draws_slices() const { return consumer == ConsumerKind::slices || consumer == ConsumerKind::stencil_slices; }
  bool draws_surfaces() const { return mode == Mode::iso || mode == Mode::dvr_iso; }
  /// Premultiplied colour (4 channels), or one raw number.
  int picture_channels() const;
};

/// A further field of the volume with its own transfer function.
struct FieldTransfer {
  std::string field;
  TransferFunction transfer_function;
};

struct Scene {
  View view;
  TransferFunction transfer_function;
  RenderSettings settings;
  std::optional<std::array<Vec3d, 2>> region;  ///< sub-box to draw: lower and upper, world
  /// Drawn with the field of `transfer_function` in one volume (mode dvr): extinctions add, and the emitted colour is their mean
  /// weighted by extinction.
  std::vector<FieldTransfer> more_fields = {};
};

/// Throws UnsupportedError where doubles do not tell the places of a scene apart: an eye too far away, a domain too large or
/// small.
void require_resolved(const DomainGeometry& geometry, const Scene& scene);

/// Points of each curve of a transfer function that shaders evaluate as they are. More make a table, and are refused with several
/// fields.
inline constexpr std::size_t kMostExactPoints = 16;  ///< of extinction
inline constexpr std::size_t kMostExactColors = 32;  ///< of colour: named maps take up to 26

/// Colours of surfaces: their own, or the transfer function's, or else one grey.
TransferFunction surface_colors(const Scene& scene);
/// Colour of a surface where the isovalue, or with a colour field its value there, is `value`.
Vec3d surface_color(const Scene& scene, double value);
/// Light that a surface reflects: `cosine` between its normal and the ray; 1 where it has no normal.
constexpr double surface_light(double cosine) { return 0.1 + 0.9 * (cosine < 0 ? -cosine : cosine); }

/// JSON as in experiment and scene files; Errors name the key and what it accepts.
View parse_view(const Json& json);
TransferFunction parse_transfer_function(const Json& json);
Json to_json(const View& view);
Json to_json(const TransferFunction& transfer_function);
/// [{"field", "extinction", ...}, ...], as in experiment files.
Json to_json(const std::vector<FieldTransfer>& more_fields);

}  // namespace amrtex
