#include "renderers/scene/ticks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace amrtex {
namespace {

/// The smallest round number above `least`.
double round_step(double least) {
  const double power = std::pow(10, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= least * (1 - 1e-6)) return factor * power;
  return 10 * power;
}

/// 1e-8 rather than 1e-08.
std::string number_text(double value, int digits) {
  std::string text = fmt::format("{:.{}g}", value, digits);
  const std::size_t e = text.find('e');
  if (e == std::string::npos) return text;
  const bool whole = std::abs(value - std::round(value)) <= 1e-9 * std::abs(value);
  if (std::abs(value) >= 1 && std::abs(value) < 1e6 && whole) return fmt::format("{:.0f}", value);
  if (text[e + 1] == '+') text.erase(e + 1, 1);
  const std::size_t first = text[e + 1] == '-' ? e + 2 : e + 1;
  while (first + 1 < text.size() && text[first] == '0') text.erase(first, 1);
  return text;
}

/// Multiples of `step` in the range.
double multiples(double lower, double upper, double step) {
  return std::floor(upper / step + 1e-6) - std::ceil(lower / step - 1e-6) + 1;
}

std::vector<Tick> linear_ticks(double lower, double upper, int most) {
  double step = round_step((upper / 2 - lower / 2) / (most + 1) * 2);
  std::vector<Tick> list;
  if (!(step > 0) || !std::isfinite(step)) return list;
  while (multiples(lower, upper, step) > most) step = round_step(1.5 * step);
  const double first = std::ceil(lower / step - 1e-6);
  const double largest = std::max(std::abs(lower), std::abs(upper));
  const int digits = std::clamp(1 + static_cast<int>(std::floor(std::log10(largest)) - std::floor(std::log10(step))), 1, 15);
  for (int k = 0; k < most; ++k) {
    const double value = (first + k) * step;
    if (value > upper + 1e-6 * step) break;
    list.push_back({value, number_text(std::abs(value) < 1e-9 * step ? 0.0 : value, digits)});
  }
  return list;
}

std::vector<Tick> decade_ticks(double lower, double upper, int most) {
  const auto first = static_cast<int>(std::ceil(std::log10(lower) - 1e-9));
  const auto last = static_cast<int>(std::floor(std::log10(upper) + 1e-9));
  const int every = std::max(1, (last - first + most - 1) / most);
  const bool between = 3 * (last - first + 1) < most;
  std::vector<Tick> list;
  const auto add = [&](double value) {
    if (value >= lower * (1 - 1e-9) && value <= upper * (1 + 1e-9)) list.push_back({value, number_text(value, 6)});
  };
  for (int p = first - 1; p <= last; ++p) {
    if (!between && (p < first || (p - first) % every != 0)) continue;
    const double decade = std::pow(10, p);
    add(decade);
    if (between)
      for (const double factor : {2.0, 5.0}) add(factor * decade);
  }
  return list;
}

}  // namespace

std::vector<Tick> ticks(double lower, double upper, bool logarithmic, int most) {
  if (!(lower < upper) || !std::isfinite(lower) || !std::isfinite(upper)) return {};
  if (logarithmic) {
    std::vector<Tick> list = decade_ticks(lower, upper, std::max(2, most));
    if (list.size() >= 2) return list;
  }
  return linear_ticks(lower, upper, std::max(2, most));
}

}  // namespace amrtex
