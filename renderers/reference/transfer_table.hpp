// A transfer function as the reference reads it: segments between the points of both its curves. Private to the reference.
#pragma once

#include <vector>

#include "renderers/reference/piece_function.hpp"
#include "renderers/scene/scene.hpp"

namespace amrtex {

class TransferTable {
 public:
  /// `extinction_scale` turns the transfer function's extinction into one per world length.
  TransferTable(const TransferFunction& transfer_function, double extinction_scale);

  struct Light {
    double extinction;  ///< per world length
    Vec3d rgb;
  };
  struct Segment {
    double value_lower;        ///< where it begins
    double axis_lower, width;  ///< of value or log10(value); 0 where the segment is constant
    Light lower, upper;
    bool constant;  ///< both curves
    bool one_color;
    bool visible;  ///< extinction is not 0 throughout
    double most() const { return lower.extinction > upper.extinction ? lower.extinction : upper.extinction; }
  };

  const std::vector<double>& knots() const { return knots_; }
  bool logarithmic() const { return logarithmic_; }
  /// Largest difference that two of its colours have in a channel.
  double color_range() const { return color_range_; }
  /// Segment k lies between knots k - 1 and k.
  std::size_t segment_of(double value) const;
  const Segment& segment(std::size_t k) const { return segments_[k]; }
  bool visible(std::size_t first, std::size_t last) const { return visible_before_[last + 1] > visible_before_[first]; }
  /// Where f lies in this segment.
  Light light(const Segment& segment, const PieceFunction& f, double s) const;

 private:
  bool logarithmic_;
  double color_range_ = 0;
  std::vector<double> knots_;
  std::vector<Segment> segments_;
  std::vector<int> visible_before_;  // visible segments below each
};

}  // namespace amrtex
