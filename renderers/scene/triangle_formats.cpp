#include "renderers/scene/triangle_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr std::string_view kSpace = " \t\r\v\f";

/// Twice the area of the polygon as a vector (Newell).
Vec3d area_vector(std::span<const Vec3d> p) {
  Vec3d sum(0);
  for (std::size_t i = 1; i + 1 < p.size(); ++i) sum += glm::cross(p[i] - p[0], p[i + 1] - p[0]);
  return sum;
}

/// Do the triangles of a fan around corner `from` all turn the polygon's way?
bool sees_all(std::span<const Vec3d> p, std::size_t from, const Vec3d& area) {
  constexpr double kRounding = 1e-6;  // of corners on a line: coordinates have 24 bits
  const double least = -kRounding * glm::dot(area, area);
  for (std::size_t i = 1; i + 1 < p.size(); ++i) {
    const Vec3d a = p[(from + i) % p.size()] - p[from];
    const Vec3d b = p[(from + i + 1) % p.size()] - p[from];
    if (glm::dot(glm::cross(a, b), area) < least) return false;
  }
  return true;
}

void add_fan(std::span<const Vec3d> polygon, std::size_t face, std::vector<Triangle>& triangles) {
  const Vec3d area = area_vector(polygon);
  std::size_t from = 0;
  while (from < polygon.size() && !sees_all(polygon, from, area)) ++from;
  if (from == polygon.size())
    throw TriangleFileError(fmt::format("face {} of {} corners bends so that no corner sees all others; cut it into triangles",
                                        face, polygon.size()));
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i)
    triangles.push_back({polygon[from], polygon[(from + i) % polygon.size()], polygon[(from + i + 1) % polygon.size()]});
}

template <class T>
std::optional<T> parsed(std::string_view token) {
  if (token.starts_with('+')) {
    token.remove_prefix(1);
    if (token.starts_with('-')) return std::nullopt;
  }
  T value{};
  const auto [end, failure] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (end != token.data() + token.size()) return std::nullopt;
  if (failure == std::errc()) return value;
  if (failure != std::errc::result_out_of_range || !std::is_floating_point_v<T>) return std::nullopt;
  return std::numeric_limits<T>::infinity();
}

}  // namespace

std::string TriangleText::found(std::string_view text) const { return shown ? quote(text) : "something else"; }

std::vector<Triangle> triangles_of(const Faces& faces) {
  std::vector<Triangle> triangles;
  std::vector<Vec3d> polygon;
  std::size_t begin = 0;
  for (std::size_t face = 0; face < faces.ends.size(); ++face) {
    polygon.clear();
    for (std::size_t i = begin; i < faces.ends[face]; ++i) {
      const std::int64_t corner = faces.corners[i];
      if (corner < 0 || corner >= std::ssize(faces.vertices))
        throw TriangleFileError(fmt::format("face {} names the vertex {} of {}", face, corner, faces.vertices.size()));
      polygon.push_back(faces.vertices[static_cast<std::size_t>(corner)]);
    }
    begin = faces.ends[face];
    if (polygon.size() >= 3) add_fan(polygon, face, triangles);
  }
  return triangles;
}

std::optional<double> number_of(std::string_view token) { return parsed<double>(token); }
std::optional<std::int64_t> integer_of(std::string_view token) { return parsed<std::int64_t>(token); }

std::optional<std::string_view> TextLines::next() {
  if (at_ >= text_.size()) return std::nullopt;
  ++number_;
  const std::size_t end = text_.find('\n', at_);
  if (end == std::string_view::npos)
    throw TriangleFileError(
        fmt::format("its last line, {}, does not end: the file may be cut; if it is whole, add the line's end", number_));
  const std::string_view line = text_.substr(at_, end - at_);
  at_ = end + 1;
  return line;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = line.find_first_not_of(kSpace); at < line.size(); at = line.find_first_not_of(kSpace, at)) {
    const std::size_t end = std::min(line.find_first_of(kSpace, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

}  // namespace amrtex
