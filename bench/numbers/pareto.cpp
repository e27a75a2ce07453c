#include "bench/numbers/pareto.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace amrtex {
namespace {

bool measured(const CostPoint& p) { return std::isfinite(p.time) && std::isfinite(p.error); }

/// Indices of the measured points whose error is at most `bound`, by time, then error, then place.
std::vector<std::size_t> by_time(std::span<const CostPoint> points, double bound) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (measured(points[i]) && points[i].error <= bound) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::tie(points[a].time, points[a].error) < std::tie(points[b].time, points[b].error);
  });
  return order;
}

}  // namespace

std::vector<std::size_t> pareto_front(std::span<const CostPoint> points) {
  std::vector<std::size_t> front;
  for (const std::size_t i : by_time(points, std::numeric_limits<double>::infinity()))
    if (front.empty() || points[i].error < points[front.back()].error) front.push_back(i);
  return front;
}

std::optional<std::size_t> fastest_within(std::span<const CostPoint> points, double bound) {
  const std::vector<std::size_t> order = by_time(points, bound);
  return order.empty() ? std::nullopt : std::optional(order.front());
}

std::optional<std::size_t> most_exact(std::span<const CostPoint> points) {
  const std::vector<std::size_t> front = pareto_front(points);
  return front.empty() ? std::nullopt : std::optional(front.back());
}

double relative_rmse(double psnr_db) { return std::pow(10.0, -psnr_db / 20); }

}  // namespace amrtex
