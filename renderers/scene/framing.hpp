// Views that show the whole domain, and camera lines of other programs.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "renderers/scene/scene.hpp"

namespace amrtex {

/// corner, +x, -x, +y, -y, +z, -z.
const std::vector<std::string_view>& framing_names();

/// A perspective view of the box from where the name says: `corner` is a three-quarter view, "+x" stands on the side of large x
/// and looks at smaller ones. z is up; seen along z, y is. The projected box fills a picture of this shape, width over height,
/// up to a margin, on at least two opposite sides. Throws UsageError for another name.
View framing_view(const Vec3d& lower, const Vec3d& upper, std::string_view name, double aspect);

/// The edges of a box in a picture, in pixels from its upper left corner: x0, y0, x1, y1. Those that reach behind the eye are
/// left out.
std::vector<std::array<double, 4>> box_edges(const Vec3d& lower, const Vec3d& upper, const View& view, int width, int height);

/// Does a ray meet a box, in front of its origin?
bool meets_box(const WorldRay& ray, const Vec3d& lower, const Vec3d& upper);

/// "ex ey ez ax ay az ux uy uz", and then, if one likes, "-fovy degrees" or "--fov degrees" (ExaBricks, hayStack). Throws
/// UsageError.
View parse_camera_line(const std::string& line);
/// The same of its numbers and words.
View parse_camera_line(const std::vector<std::string>& words);
std::string camera_line(const View& view);

}  // namespace amrtex
