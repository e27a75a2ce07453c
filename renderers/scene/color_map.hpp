// Colour maps by name, and curves of colour made of few points.
#pragma once

#include <string_view>
#include <vector>

#include "renderers/scene/scene.hpp"

namespace amrtex {

using ColorPoints = std::vector<TransferFunction::ColorPoint>;

/// One channel of sRGB, 0 to 1, and what light it stands for.
double srgb_from_linear(double linear);
double linear_from_srgb(double srgb);
Vec3d srgb_from_linear(const Vec3d& linear);
Vec3d linear_from_srgb(const Vec3d& srgb);

/// How far a channel of a named map may be from its definition, in sRGB: nobody sees 2 of 255.
inline constexpr double kColorBound = 2.0 / 255;

/// viridis, inferno, magma, plasma, turbo, cool_warm, gray.
const std::vector<std::string_view>& color_map_names();
/// Linear RGB over 0 to 1, of as few points as `kColorBound` takes. Throws a UsageError that names the maps.
ColorPoints color_map(std::string_view name);

/// The fewest of these points whose curve, linear in light, is nowhere farther than `bound` in a channel of sRGB from any of
/// them; ends stay, and of more than 512 points every 512th. Values ascend.
ColorPoints fewest_points(const ColorPoints& dense, double bound);

/// A map from 0 to 1 laid over lower to upper, or over their logarithms.
ColorPoints stretch(const ColorPoints& map, double lower, double upper, bool logarithmic);

/// Two colours joined through white or gray as Moreland (Diverging Color Maps for Scientific Visualization, 2009) does, in his
/// space Msh; `share` from 0 to 1, sRGB.
Vec3d diverging_color(const Vec3d& first, const Vec3d& last, double share);

/// CIELAB under D65; back, what no screen shows is cut to its colours.
Vec3d lab_from_linear(const Vec3d& linear);
Vec3d linear_from_lab(const Vec3d& lab);
/// Lightness L* of CIELAB, 0 to 100.
double lightness(const Vec3d& linear);

}  // namespace amrtex
