// From numbers to colours, and back to what a bar beside them says.
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "bench/figure/drawing.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/scene.hpp"
#include "renderers/scene/ticks.hpp"

namespace amrtex {

class ColorScale {
 public:
  /// A named map laid over first to last, first < last. `whole`: each whole number from first to last has a colour of its own.
  ColorScale(std::string_view map, double first, double last, bool logarithmic, bool whole);
  /// The colours of a volume or of surfaces: over values.
  explicit ColorScale(TransferFunction colors);

  double first() const { return first_; }
  double last() const { return last_; }
  Vec3d linear(double value) const;  ///< of a finite value; its nearest end's beyond
  /// Colour at a place of the bar, 0 to 1, and the place of a value on it.
  Vec3d at_place(double place) const;
  double place(double value) const;
  std::vector<Tick> ticks(int most) const;

 private:
  TransferFunction colors_;
  double first_, last_;  ///< ends of the bar
  bool whole_ = false;
};

/// Of the values that have a place on the axis; absent where there are none.
std::optional<std::array<double, 2>> value_range(const Picture& picture, bool logarithmic);

/// Premultiplied colour over a background, or, with a scale, one number a pixel; what is no number is background (linear RGB).
Bitmap to_bitmap(const Picture& picture, const ColorScale* scale, const Vec3d& background);

}  // namespace amrtex
