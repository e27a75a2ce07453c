#include "bench/figure/color_scale.hpp"

#include <algorithm>
#include <cmath>

#include "renderers/scene/color_map.hpp"

namespace amrtex {
namespace {

TransferFunction colors_of(std::string_view map, double first, double last, bool logarithmic) {
  TransferFunction colors;
  colors.color = stretch(color_map(map), first, last, logarithmic);
  colors.logarithmic = logarithmic;
  return colors;
}

}  // namespace

ColorScale::ColorScale(std::string_view map, double first, double last, bool logarithmic, bool whole)
    : colors_(colors_of(map, first, last, logarithmic)),
      first_(whole ? first - 0.5 : first),
      last_(whole ? last + 0.5 : last),
      whole_(whole) {}

ColorScale::ColorScale(TransferFunction colors)
    : colors_(std::move(colors)), first_(colors_.color.front().value), last_(colors_.color.back().value) {}

Vec3d ColorScale::linear(double value) const { return colors_.color_at(whole_ ? std::round(value) : value); }

Vec3d ColorScale::at_place(double place) const {
  const double a = colors_.axis(first_), b = colors_.axis(last_);
  const double x = a + place * (b - a);
  if (whole_) return linear(std::clamp(std::round(x), first_ + 0.5, last_ - 0.5));
  return linear(colors_.logarithmic ? std::pow(10, x) : x);
}

double ColorScale::place(double value) const {
  const double a = colors_.axis(first_), b = colors_.axis(last_);
  return (colors_.axis(value) - a) / (b - a);
}

std::vector<Tick> ColorScale::ticks(int most) const {
  std::vector<Tick> all = amrtex::ticks(first_, last_, colors_.logarithmic, most);
  if (whole_) std::erase_if(all, [](const Tick& t) { return t.value != std::round(t.value); });
  return all;
}

std::optional<std::array<double, 2>> value_range(const Picture& picture, bool logarithmic) {
  std::optional<std::array<double, 2>> range;
  for (const double v : picture.values) {
    if (!std::isfinite(v) || (logarithmic && !(v > 0))) continue;
    if (!range) range = {v, v};
    range = {std::min((*range)[0], v), std::max((*range)[1], v)};
  }
  return range;
}

Bitmap to_bitmap(const Picture& picture, const ColorScale* scale, const Vec3d& background) {
  Bitmap bitmap{picture.width, picture.height, {}};
  bitmap.rgb.reserve(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height) * 3);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double* p = picture.pixel(x, y);
      Vec3d linear = background;
      if (picture.channels == 4)
        linear = Vec3d(p[0], p[1], p[2]) + (1 - p[3]) * background;
      else if (scale != nullptr && std::isfinite(*p))
        linear = scale->linear(*p);
      const Vec3d srgb = srgb_from_linear(linear);
      for (int c = 0; c < 3; ++c)
        bitmap.rgb.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(srgb[c], 0.0, 1.0))));
    }
  return bitmap;
}

}  // namespace amrtex
