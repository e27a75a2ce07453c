// Round numbers along an axis.
#pragma once

#include <string>
#include <vector>

namespace amrtex {

struct Tick {
  double value;
  std::string text;
};

/// At most `most` of them (at least 2) between lower and upper, lower < upper: multiples of 1, 2 or 5 times a power of ten, or on
/// a logarithmic axis powers of ten, with 2 and 5 times these, or as on a linear one, where there are few. As many digits as
/// tell them apart.
std::vector<Tick> ticks(double lower, double upper, bool logarithmic, int most);

}  // namespace amrtex
