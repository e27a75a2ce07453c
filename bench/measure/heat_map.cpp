#include "bench/measure/heat_map.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "bench/records/stored_picture.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

double value_of(Heat heat, const PixelWork& work) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (!work.met) return kNone;
  if (heat == Heat::samples) return static_cast<double>(work.samples);
  if (heat == Heat::regions) return static_cast<double>(work.regions);
  return work.finest_level < 0 ? kNone : work.finest_level;
}

}  // namespace

const std::vector<std::string>& heat_names() {
  static const std::vector<std::string> names = {"samples", "regions", "level", "error"};
  return names;
}

std::string_view heat_name(Heat heat) { return heat_names()[static_cast<std::size_t>(heat)]; }

Heat parse_heat(std::string_view name) {
  const std::vector<std::string>& names = heat_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<Heat>(found - names.begin());
  const std::vector<std::string_view> views(names.begin(), names.end());
  throw UsageError(fmt::format("no heat map {}{}; accepted: {}", quote(name), suggestion(name, views), fmt::join(names, ", ")));
}

Picture counted_picture(Heat heat, const std::vector<PixelWork>& work, int width, int height) {
  Picture picture(width, height, 1);
  std::transform(work.begin(), work.end(), picture.values.begin(), [&](const PixelWork& w) { return value_of(heat, w); });
  return picture;
}

Picture largest_difference(const Picture& difference) {
  Picture largest(difference.width, difference.height, 1);
  for (int y = 0; y < difference.height; ++y)
    for (int x = 0; x < difference.width; ++x) {
      const double* channels = difference.pixel(x, y);
      *largest.pixel(x, y) = *std::max_element(channels, channels + difference.channels,
                                               [](double a, double b) { return std::abs(a) < std::abs(b); });
    }
  return largest;
}

Picture error_picture(const Picture& picture, const Picture& reference) {
  return largest_difference(difference_of(picture, reference));
}

std::array<double, 2> around_zero(const Picture& picture) {
  double most = 0;
  for (const double v : picture.values)
    if (std::isfinite(v)) most = std::max(most, std::abs(v));
  return most > 0 ? std::array{-most, most} : std::array{-1.0, 1.0};
}

}  // namespace amrtex
