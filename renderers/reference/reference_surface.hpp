// Isosurfaces along a ray, alone or inside the volume. Private to the reference.
#pragma once

#include <cstdint>
#include <vector>

#include "renderers/reference/ray_integral.hpp"
#include "renderers/reference/reference_parts.hpp"
#include "renderers/reference/reference_point.hpp"
#include "renderers/reference/reference_tracer.hpp"

namespace amrtex {

/// Where a ray changes from one side of an isovalue to the other.
struct Crossing {
  double s;             ///< in the piece; 0: at the face to the piece before
  std::size_t surface;  ///< index of the isovalue
  bool rising;
};

/// Finds the crossings of isosurfaces along one ray, piece after piece. A side is that of an
/// open stretch, so to touch an isovalue in one point is no crossing; f >= isovalue is above.
class SurfaceFinder {
 public:
  /// `isovalues` outlive the finder. What is at most `joint` long (world) is rounding: pieces
  /// that lie no further apart are adjacent; beyond wider gaps, where there is no mesh, sides start anew.
  SurfaceFinder(const std::vector<double>& isovalues, double joint)
      : isovalues_(isovalues), joint_(joint), sides_(isovalues.size(), Side::unknown) {}

  /// The crossings of the next piece in the order in which the ray meets them.
  const std::vector<Crossing>& next(const PieceFunction& f, double from, double to);

 private:
  enum class Side : std::uint8_t { unknown, below, above };
  void enter(std::size_t surface, Side side, double s);
  void cross(const PieceFunction& f, double length, std::size_t surface);

  const std::vector<double>& isovalues_;
  double joint_;
  double end_ = 0;  // of the piece before
  std::vector<Side> sides_;
  std::vector<Crossing> crossings_;
};

/// What the rays of one picture share.
struct SurfaceScene {
  /// `stored`: the scene in the field's units.
  SurfaceScene(const Scene& scene, const Scene& stored, const FilterReference& filter, const FilterReference* color_filter,
               const TransferTable* volume, const RayRule& rule);

  const Scene& scene;
  const Isosurfaces& settings;  ///< in the field's units
  const FilterReference& filter;
  const FilterReference* color_filter;  ///< over a second field; null: the isovalue gives the colour
  const TransferTable* volume;          ///< null: surfaces alone
  RayRule rule;                         ///< of the volume, without the ray's length
  std::vector<Vec3d> rgb;               ///< one an isovalue
  Vec3d lower{0}, upper{0};             ///< of what is drawn, finest cells
  std::vector<ClipPlane> planes;        ///< that cut it, finest cells
};

/// Draws rays; of one thread.
class SurfacePainter {
 public:
  explicit SurfacePainter(const SurfaceScene& scene) : scene_(scene), point_(scene.filter) {
    if (scene.color_filter != nullptr) color_point_.emplace(*scene.color_filter);
    if (scene.settings.ambient_occlusion) around_.emplace(scene.filter);
  }

  /// What the volume between the surfaces of a ray may be off by, and what it took.
  struct Cost {
    double error = 0;
    std::int64_t evaluations = 0;
  };
  /// `start`: world distance from the eye to the first part; `lamp`: see LightIntegral.
  Cost draw(ReferenceTracer& tracer, const std::vector<RayPart>& parts, const std::optional<Mirror>& mirror, double start,
            const LightIntegral::Arriving& lamp, double* pixel);

 private:
  Cost draw_color(ReferenceTracer& tracer, const std::vector<RayPart>& parts, const LightIntegral::Arriving& lamp, double* pixel);
  Vec3d color_at(const Vec3d& p, std::size_t surface, const Vec3d& direction);
  double open_share(const Vec3d& p, const Vec3d& up);
  Vec3d normal_at(const Vec3d& p);

  const SurfaceScene& scene_;
  ReferencePoint point_;
  std::optional<ReferencePoint> color_point_;
  std::optional<ReferenceTracer> around_;  // of secondary rays
};

}  // namespace amrtex
