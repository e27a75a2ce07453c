// Units in which floats hold a field's values.
#pragma once

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// A value is offset + scale * number. `scale` is a power of two, so that it costs no digit.
struct ValueUnits {
  double offset = 0;
  double scale = 1;

  /// 0 and 1: numbers are values, to the bit.
  bool plain() const { return offset == 0 && scale == 1; }
  double number(double value) const { return (value - offset) / scale; }
  double value(double number) const { return offset == 0 ? scale * number : offset + scale * number; }
  bool operator==(const ValueUnits&) const = default;
};

/// The units of a field: they follow from its values alone, so that they are the same for all encodings, filters and scenes.
/// Plain, but where a float would lose more than 2^-20 of the range of the values (then the offset is the smallest one and
/// numbers go from 0 to at most 2), or where values, or products that shaders make of them, leave the normal range of a float
/// (then they are scaled alone).
ValueUnits value_units(const FieldStatistics& statistics);

/// Smallest and largest number that a float holds at full precision with room for sums and products.
inline constexpr double kLeastNumber = 0x1p-126;
inline constexpr double kMostNumber = 0x1p126;

/// Does a float hold these values as `value_units` asks: none that it loses more than 2^-20 of their range of, or all of?
/// `least`: smallest magnitude above 0; 0 where there is none.
bool floats_hold(double min, double max, double least);

}  // namespace amrtex
