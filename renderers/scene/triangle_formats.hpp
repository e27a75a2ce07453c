// One reader a format of triangle files, and what they share. Files are taken as hostile: every count is held against the
// bytes that are there before anything is allocated for it, every index against what it names, and the last line must end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "renderers/scene/triangle_mesh.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {

/// What is wrong with a file, without its name: read_triangles puts it in front.
class TriangleFileError : public Error {
 public:
  using Error::Error;
};

/// The bytes of a file, and whether messages may quote them.
struct TriangleText {
  std::string_view bytes;
  bool shown = true;

  /// What was found, for a message.
  std::string found(std::string_view text) const;
};

std::vector<Triangle> read_obj(const TriangleText& file);
std::vector<Triangle> read_ply(const TriangleText& file);
std::vector<Triangle> read_stl(const TriangleText& file);

/// Corners of all faces, one face behind the other.
struct Faces {
  std::vector<Vec3d> vertices;
  std::vector<std::int64_t> corners;  ///< in `vertices`
  std::vector<std::size_t> ends;      ///< a face, in `corners`
};

/// Cuts every face into triangles that share one of its corners; faces of fewer than three corners are points and lines, and
/// are left out. Throws where a face names a vertex that does not exist, or bends so that no corner sees all others.
std::vector<Triangle> triangles_of(const Faces& faces);

/// A coordinate as all formats round it: to 32 bits.
inline double rounded(double coordinate) { return static_cast<double>(static_cast<float>(coordinate)); }

/// A whole token as a number; nullopt where it is none. Numbers too large for a double are infinite.
std::optional<double> number_of(std::string_view token);
/// A whole token as an integer of 64 bits.
std::optional<std::int64_t> integer_of(std::string_view token);

/// Lines of a text that must all end, without their ends.
class TextLines {
 public:
  /// `before`: lines of the file in front of the text.
  explicit TextLines(std::string_view text, int before = 0) : text_(text), number_(before) {}

  /// The next line; nullopt behind the last. Throws where it does not end.
  std::optional<std::string_view> next();
  int number() const { return number_; }  ///< of the last line read, from 1
  std::size_t position() const { return at_; }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  int number_;
};

/// The words of a line, between white space.
std::vector<std::string_view> words_of(std::string_view line);

}  // namespace amrtex
