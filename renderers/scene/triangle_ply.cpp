// PLY 1.0 (Turk 1994), as text and in both binary byte orders: a header that says what follows, then the elements one behind
// the other. Used are x, y, z of `vertex` and the list vertex_indices (or vertex_index) of `face`; the rest is passed over.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "renderers/scene/triangle_formats.hpp"

namespace amrtex {
namespace {

constexpr int kMostHeaderLines = 10000;

enum class Type { i8, u8, i16, u16, i32, u32, f32, f64 };
struct TypeName {
  std::string_view name;
  Type type;
};
constexpr std::array kTypeNames{
    TypeName{"char", Type::i8},   TypeName{"uchar", Type::u8},   TypeName{"short", Type::i16},   TypeName{"ushort", Type::u16},
    TypeName{"int", Type::i32},   TypeName{"uint", Type::u32},   TypeName{"float", Type::f32},   TypeName{"double", Type::f64},
    TypeName{"int8", Type::i8},   TypeName{"uint8", Type::u8},   TypeName{"int16", Type::i16},   TypeName{"uint16", Type::u16},
    TypeName{"int32", Type::i32}, TypeName{"uint32", Type::u32}, TypeName{"float32", Type::f32}, TypeName{"float64", Type::f64}};

bool is_real(Type type) { return type == Type::f32 || type == Type::f64; }
std::size_t bytes_of(Type type) {
  constexpr std::array<std::size_t, 8> kBytes{1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}
/// Lowest and highest value of an integer type.
std::pair<double, double> range_of(Type type) {
  constexpr std::array<std::pair<double, double>, 6> kRanges{
      {{-128, 127}, {0, 255}, {-32768, 32767}, {0, 65535}, {-2147483648.0, 2147483647.0}, {0, 4294967295.0}}};
  return kRanges[static_cast<std::size_t>(type)];
}

struct Property {
  std::string name;
  Type type = Type::f32;
  std::optional<Type> count;  ///< of a list: of what its length is
};

struct Element {
  std::string name;
  std::int64_t count = 0;
  std::vector<Property> properties;
};

enum class Format { text, little, big };

struct Header {
  Format format = Format::text;
  std::vector<Element> elements;
  std::size_t end = 0;  ///< where the elements begin, in bytes
  int lines = 0;
};

// ---- header ----

class HeaderReader {
 public:
  explicit HeaderReader(const TriangleText& file) : file_(file), lines_(file.bytes) {}

  Header read() {
    if (words_of(line("`ply`")) != std::vector<std::string_view>{"ply"}) refuse("its first line is not `ply`");
    read_format(words_of(line("the format")));
    for (auto words = words_of(line("`end_header`"));; words = words_of(line("`end_header`"))) {
      if (words.size() == 1 && words[0] == "end_header") break;
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "element")
        read_element(words);
      else if (words[0] == "property")
        read_property(words);
      else
        refuse(fmt::format("expected an element, a property or `end_header`; found {}", file_.found(words[0])));
    }
    header_.end = lines_.position();
    header_.lines = lines_.number();
    return std::move(header_);
  }

 private:
  [[noreturn]] void refuse(const std::string& problem) const {
    throw TriangleFileError(fmt::format("line {}: {}", lines_.number(), problem));
  }

  std::string_view line(std::string_view due) {
    if (lines_.number() == kMostHeaderLines) refuse(fmt::format("a header of more than {} lines", kMostHeaderLines));
    if (const auto next = lines_.next()) return *next;
    throw TriangleFileError(fmt::format("the header ends before {}", due));
  }

  void read_format(const std::vector<std::string_view>& words) {
    constexpr std::array<std::string_view, 3> kNames{"ascii", "binary_little_endian", "binary_big_endian"};
    const auto name = words.size() == 3 ? std::find(kNames.begin(), kNames.end(), words[1]) : kNames.end();
    if (name == kNames.end() || words[0] != "format" || words[2] != "1.0")
      refuse("expected `format` with ascii, binary_little_endian or binary_big_endian, and 1.0");
    header_.format = static_cast<Format>(name - kNames.begin());
  }

  void read_element(const std::vector<std::string_view>& words) {
    const auto count = words.size() == 3 ? integer_of(words[2]) : std::nullopt;
    if (!count || *count < 0) refuse("expected `element`, a name and a count");
    header_.elements.push_back({std::string(words[1]), *count, {}});
  }

  Type type(std::string_view name) const {
    for (const TypeName& known : kTypeNames)
      if (known.name == name) return known.type;
    refuse(fmt::format("unknown type {}; accepted: char, uchar, short, ushort, int, uint, float, double", file_.found(name)));
  }

  void read_property(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) refuse("a property before the first element");
    Property property;
    const bool list = words.size() > 1 && words[1] == "list";
    if (words.size() != (list ? 5U : 3U))
      refuse("expected `property`, a type and a name, or `property list`, two types and a name");
    if (list) {
      property.count = type(words[2]);
      if (is_real(*property.count)) refuse("the length of a list is a real number; an integer is expected");
    }
    property.type = type(words[words.size() - 2]);
    property.name = words.back();
    header_.elements.back().properties.push_back(std::move(property));
  }

  const TriangleText& file_;
  TextLines lines_;
  Header header_;
};

// ---- numbers of the elements ----

/// Hands out the numbers of the elements in their order. One element of a text stands on one line.
class Numbers {
 public:
  virtual ~Numbers() = default;
  virtual void begin_element(const Element&, std::int64_t) {}
  virtual double next(Type type) = 0;
  virtual void end_element() {}
  /// Throws where fewer numbers follow than a list is said to have.
  virtual void require(double length, Type type) const = 0;
  /// Throws where something follows.
  virtual void finish() = 0;
};

class BinaryNumbers final : public Numbers {
 public:
  BinaryNumbers(std::string_view bytes, bool swap) : bytes_(bytes), swap_(swap) {}

  void begin_element(const Element& element, std::int64_t number) override {
    element_ = &element;
    number_ = number;
  }

  double next(Type type) override {
    switch (type) {
      case Type::i8:
        return raw<std::int8_t>();
      case Type::u8:
        return raw<std::uint8_t>();
      case Type::i16:
        return raw<std::int16_t>();
      case Type::u16:
        return raw<std::uint16_t>();
      case Type::i32:
        return raw<std::int32_t>();
      case Type::u32:
        return raw<std::uint32_t>();
      case Type::f32:
        return static_cast<double>(raw<float>());
      default:
        return raw<double>();
    }
  }

  void require(double length, Type type) const override {
    if (length < 0 || length * static_cast<double>(bytes_of(type)) > static_cast<double>(bytes_.size() - at_)) refuse_end();
  }

  void finish() override {
    if (at_ < bytes_.size()) throw TriangleFileError(fmt::format("{} bytes stand behind its last element", bytes_.size() - at_));
  }

 private:
  template <class T>
  T raw() {
    if (bytes_.size() - at_ < sizeof(T)) refuse_end();
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), bytes_.data() + at_, sizeof(T));
    if (swap_) std::reverse(bytes.begin(), bytes.end());
    at_ += sizeof(T);
    return std::bit_cast<T>(bytes);
  }

  [[noreturn]] void refuse_end() const {
    throw TriangleFileError(
        fmt::format("it ends inside {} {} of {}", element_->name == "face" ? "face" : "element", number_, element_->count));
  }

  std::string_view bytes_;
  bool swap_;
  std::size_t at_ = 0;
  const Element* element_ = nullptr;
  std::int64_t number_ = 0;
};

class TextNumbers final : public Numbers {
 public:
  TextNumbers(const TriangleText& file, const Header& header) : file_(file), lines_(file.bytes.substr(header.end), header.lines) {
    for (const Element& element : header.elements) told_ += element.count;
  }

  void begin_element(const Element&, std::int64_t) override {
    at_ = 0;
    if (!next_line())
      throw TriangleFileError(fmt::format("it ends after {} lines of vertices and faces; its header tells of {}", read_, told_));
    ++read_;
  }

  double next(Type type) override {
    if (at_ == words_.size()) refuse("a number is missing at the line's end");
    const std::string_view word = words_[at_++];
    const auto number = number_of(word);
    if (!number) refuse(fmt::format("{} is not a number", file_.found(word)));
    if (is_real(type)) return *number;
    const auto [lowest, highest] = range_of(type);
    if (!integer_of(word) || *number < lowest || *number > highest)
      refuse(fmt::format("{} is not a whole number from {} to {}", file_.found(word), lowest, highest));
    return *number;
  }

  void end_element() override {
    if (at_ < words_.size()) refuse(fmt::format("{} stands behind the last number", file_.found(words_[at_])));
  }

  void require(double length, Type) const override {
    if (length < 0 || length > static_cast<double>(words_.size() - at_))
      refuse(fmt::format("a list of {} numbers; {} follow", length, words_.size() - at_));
  }

  void finish() override {
    if (next_line()) refuse("text behind the last element");
  }

 private:
  bool next_line() {
    while (const auto line = lines_.next()) {
      words_ = words_of(*line);
      if (!words_.empty()) return true;
    }
    return false;
  }

  [[noreturn]] void refuse(const std::string& problem) const {
    throw TriangleFileError(fmt::format("line {}: {}", lines_.number(), problem));
  }

  const TriangleText& file_;
  TextLines lines_;
  std::int64_t told_ = 0;  ///< lines, by the header
  std::int64_t read_ = 0;
  std::vector<std::string_view> words_;
  std::size_t at_ = 0;  ///< next word
};

// ---- elements ----

/// Reads one element after the other, and keeps what is used of it.
class ElementReader {
 public:
  ElementReader(Numbers& numbers, std::size_t bytes) : numbers_(numbers), bytes_(bytes) {}

  void read(const Element& element) {
    const bool vertices = element.name == "vertex";
    const bool faces = element.name == "face";
    if (vertices) require_coordinates(element);
    if (element.properties.empty() || element.count == 0) return;
    // each takes a byte at least
    if (static_cast<std::uint64_t>(element.count) > bytes_)
      throw TriangleFileError(
          fmt::format("its header tells of {} elements of one kind; the file has only {} bytes", element.count, bytes_));
    for (std::int64_t i = 0; i < element.count; ++i) {
      numbers_.begin_element(element, i);
      Vec3d vertex(0);
      bool cornered = false;
      for (const Property& property : element.properties) {
        if (property.count)
          cornered = read_list(property, faces && !cornered && is_corners(property)) || cornered;
        else
          read_number(property, vertices, vertex);
      }
      numbers_.end_element();
      if (vertices) found_.vertices.push_back(vertex);
      if (faces) found_.ends.push_back(found_.corners.size());
    }
  }

  Faces take() { return std::move(found_); }

 private:
  static bool is_corners(const Property& p) { return p.name == "vertex_indices" || p.name == "vertex_index"; }

  static void require_coordinates(const Element& element) {
    for (const char* axis : {"x", "y", "z"}) {
      const auto same = [&](const Property& p) { return p.name == axis && !p.count; };
      if (std::count_if(element.properties.begin(), element.properties.end(), same) != 1)
        throw TriangleFileError(fmt::format("its vertices have no {}, or more than one", axis));
    }
  }

  void read_number(const Property& property, bool vertices, Vec3d& vertex) {
    const double value = numbers_.next(property.type);
    if (!vertices || property.name.size() != 1 || property.name[0] < 'x' || property.name[0] > 'z') return;
    vertex[property.name[0] - 'x'] = rounded(value);
  }

  /// Returns whether it holds corners.
  bool read_list(const Property& property, bool corners) {
    const double length = numbers_.next(*property.count);
    numbers_.require(length, property.type);
    if (corners && is_real(property.type))
      throw TriangleFileError("its faces name vertices by real numbers; integers are expected");
    for (auto left = static_cast<std::int64_t>(length); left > 0; --left) {
      const double value = numbers_.next(property.type);
      if (corners) found_.corners.push_back(static_cast<std::int64_t>(value));
    }
    return corners;
  }

  Numbers& numbers_;
  std::size_t bytes_;
  Faces found_;
};

}  // namespace

std::vector<Triangle> read_ply(const TriangleText& file) {
  const Header header = HeaderReader(file).read();
  const std::string_view bytes = file.bytes.substr(header.end);
  BinaryNumbers binary(bytes, (header.format == Format::big) != (std::endian::native == std::endian::big));
  TextNumbers text(file, header);
  Numbers& numbers = header.format == Format::text ? static_cast<Numbers&>(text) : binary;
  ElementReader reader(numbers, bytes.size());
  for (const Element& element : header.elements) reader.read(element);
  numbers.finish();
  return triangles_of(reader.take());
}

}  // namespace amrtex
