// Letters of 5 x 7 dots for what stands beside a picture.
#pragma once

#include <array>
#include <string_view>

namespace amrtex {

inline constexpr int kDotColumns = 5, kDotRows = 7;

/// Five columns from the left; bit 0 is the top row, bit 6 the line that letters stand on. A box for a character that is not
/// there.
std::array<unsigned char, kDotColumns> dot_glyph(char ch);

}  // namespace amrtex
