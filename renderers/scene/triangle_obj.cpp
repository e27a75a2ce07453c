// OBJ through the library tinyobjloader, which takes whatever stands where a number should and 0 for what is missing: so
// lines of vertices and faces are checked first. It gets no reader of materials: a file of triangles opens no other file.
#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <array>
#include <cmath>
#include <sstream>

#include "renderers/scene/triangle_formats.hpp"

namespace amrtex {
namespace {

constexpr std::size_t kMostNumbers = 8;  // of a vertex: x y z, w, and colours as some write them

[[noreturn]] void refuse(int line, const std::string& problem) {
  throw TriangleFileError(fmt::format("line {}: {}", line, problem));
}

void check_vertex(const TriangleText& file, std::span<const std::string_view> words, int line) {
  const auto numbers = words.subspan(1);
  if (numbers.size() < 3 || numbers.size() > kMostNumbers)
    refuse(line, fmt::format("a vertex of {} numbers; three are expected", numbers.size()));
  for (const std::string_view word : numbers) {
    const auto number = number_of(word);
    if (!number) refuse(line, fmt::format("{} is not a number of a vertex", file.found(word)));
    if (!std::isfinite(*number)) refuse(line, fmt::format("{}, a number of a vertex, is not finite", file.found(word)));
  }
}

/// `7`, `7/1`, `7//3` or `7/1/3`; of these only the vertex is used. Counted from 1, or backwards from -1.
void check_corner(const TriangleText& file, std::string_view word, int line) {
  std::size_t parts = 0;
  for (std::string_view rest = word;; ++parts) {
    const std::size_t slash = rest.find('/');
    const std::string_view part = rest.substr(0, slash);
    const auto index = integer_of(part);
    const bool left_out = part.empty() && parts == 1 && slash != std::string_view::npos;
    if (parts > 2 || (!left_out && (!index || *index == 0 || std::abs(*index) > std::numeric_limits<int>::max())))
      refuse(line, fmt::format("{} names no vertex of a face", file.found(word)));
    if (slash == std::string_view::npos) return;
    rest = rest.substr(slash + 1);
  }
}

void check_lines(const TriangleText& file) {
  TextLines lines(file.bytes);
  while (const auto line = lines.next()) {
    // the library would see a line end here
    if (line->find('\0') != std::string_view::npos) refuse(lines.number(), "a NUL character");
    const auto words = words_of(*line);
    if (words.empty()) continue;
    if (words[0] == "v") check_vertex(file, words, lines.number());
    if (words[0] == "f")
      for (const std::string_view word : std::span(words).subspan(1)) check_corner(file, word, lines.number());
  }
}

}  // namespace

std::vector<Triangle> read_obj(const TriangleText& file) {
  check_lines(file);
  Faces faces;
  tinyobj::callback_t found;
  found.vertex_cb = [](void* to, tinyobj::real_t x, tinyobj::real_t y, tinyobj::real_t z, tinyobj::real_t) {
    static_cast<Faces*>(to)->vertices.push_back({rounded(x), rounded(y), rounded(z)});
  };
  found.index_cb = [](void* to, tinyobj::index_t* corners, int count) {
    Faces& all = *static_cast<Faces*>(to);
    for (int i = 0; i < count; ++i) {
      const std::int64_t named = corners[i].vertex_index;
      all.corners.push_back(named > 0 ? named - 1 : std::ssize(all.vertices) + named);
    }
    all.ends.push_back(all.corners.size());
  };
  std::istringstream text{std::string(file.bytes)};
  tinyobj::LoadObjWithCallback(text, found, &faces, nullptr, nullptr, nullptr);
  return triangles_of(faces);
}

}  // namespace amrtex
