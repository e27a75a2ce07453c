// STL: binary (80 bytes of anything, a count, 50 bytes a triangle) and text (solid, facet, outer loop, three vertices).
// Normals are passed over: the corners say it all.
#include <fmt/format.h>

#include <array>
#include <bit>
#include <cctype>
#include <cstring>

#include "renderers/scene/triangle_formats.hpp"
#include "structures/mesh/checked.hpp"

namespace amrtex {
namespace {

static_assert(std::endian::native == std::endian::little, "binary STL is little endian and read as it stands");

constexpr std::size_t kHeaderBytes = 84;
constexpr std::size_t kTriangleBytes = 50;  // a normal, three corners, two bytes of anything

template <class T>
T value_at(std::string_view bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

std::vector<Triangle> read_binary(std::string_view bytes) {
  std::vector<Triangle> triangles((bytes.size() - kHeaderBytes) / kTriangleBytes);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t number = 0; number < 9; ++number)
      triangles[t][number / 3][static_cast<int>(number % 3)] =
          value_at<float>(bytes, kHeaderBytes + t * kTriangleBytes + 12 + 4 * number);
  return triangles;
}

/// Reads line after line, each of which must begin with the words that are due.
class StlText {
 public:
  explicit StlText(const TriangleText& file) : file_(file), lines_(file.bytes) {}

  std::vector<Triangle> read() {
    std::vector<Triangle> triangles;
    for (bool solid = next(); solid; solid = next()) {
      expect({"solid"}, true);
      for (require(); lower(0) != "endsolid"; require()) triangles.push_back(facet());
    }
    return triangles;
  }

 private:
  Triangle facet() {
    expect({"facet", "normal"}, false);
    numbers(2);
    require();
    expect({"outer", "loop"}, false);
    Triangle triangle;
    for (Vec3d& corner : triangle) {
      require();
      expect({"vertex"}, false);
      corner = numbers(1);
    }
    for (const char* word : {"endloop", "endfacet"}) {
      require();
      expect({word}, false);
    }
    return triangle;
  }

  /// Goes to the next line that is not empty.
  bool next() {
    while (const auto line = lines_.next()) {
      words_ = words_of(*line);
      if (!words_.empty()) return true;
    }
    return false;
  }
  void require() {
    if (!next()) throw TriangleFileError("the text ends before `endsolid`");
  }

  std::string lower(std::size_t word) const {
    std::string text(words_[word]);
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
  }

  void expect(std::initializer_list<const char*> due, bool with_name) {
    std::size_t word = 0;
    for (const char* text : due)
      if (word >= words_.size() || lower(word++) != text)
        refuse(fmt::format("expected `{}`; found {}", text,
                           word > words_.size() ? "the line's end" : file_.found(words_[word - 1])));
    if (!with_name && due.size() == 1 && *due.begin() != std::string_view("vertex") && words_.size() > 1)
      refuse(fmt::format("{} stands behind `{}`", file_.found(words_[1]), *due.begin()));
  }

  /// The three numbers that are left of the line behind its first words.
  Vec3d numbers(std::size_t first) const {
    if (words_.size() != first + 3) refuse(fmt::format("{} numbers; three are expected", words_.size() - first));
    Vec3d found(0);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto number = number_of(words_[first + i]);
      if (!number) refuse(fmt::format("{} is not a number", file_.found(words_[first + i])));
      found[static_cast<int>(i)] = rounded(*number);
    }
    return found;
  }

  [[noreturn]] void refuse(const std::string& problem) const {
    throw TriangleFileError(fmt::format("line {}: {}", lines_.number(), problem));
  }

  const TriangleText& file_;
  TextLines lines_;
  std::vector<std::string_view> words_;
};

}  // namespace

std::vector<Triangle> read_stl(const TriangleText& file) {
  const std::string_view bytes = file.bytes;
  if (bytes.size() >= kHeaderBytes) {
    const std::uint32_t count = value_at<std::uint32_t>(bytes, kHeaderBytes - 4);
    const std::uint64_t expected = kHeaderBytes + std::uint64_t{kTriangleBytes} * count;
    if (bytes.size() == expected) return read_binary(bytes);
    if (!bytes.starts_with("solid"))
      throw TriangleFileError(fmt::format("{} bytes; its count of {} triangles asks for {}", bytes.size(), count, expected));
  }
  return StlText(file).read();
}

}  // namespace amrtex
