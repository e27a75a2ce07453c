// The header of NRRD files, https://teem.sourceforge.net/nrrd/format.html.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/raw_volume/volume_file.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostHeaderBytes = std::size_t{1} << 20;

struct TypeNames {
  ValueType type;
  std::vector<std::string_view> names;
};

const std::vector<TypeNames>& nrrd_types() {
  static const std::vector<TypeNames> types = {
      {ValueType::i1, {"signed char", "int8", "int8_t"}},
      {ValueType::u1, {"uchar", "unsigned char", "uint8", "uint8_t"}},
      {ValueType::i2, {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
      {ValueType::u2, {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
      {ValueType::i4, {"int", "signed int", "int32", "int32_t"}},
      {ValueType::u4, {"uint", "unsigned int", "uint32", "uint32_t"}},
      {ValueType::f4, {"float"}},
      {ValueType::f8, {"double"}},
  };
  return types;
}

/// The fields of a header by name, and where it ends.
class NrrdHeader {
 public:
  explicit NrrdHeader(const fs::path& path) : path_(path) {
    const std::uint64_t size = regular_file_size(path);
    text_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(size, kMostHeaderBytes)));
    std::ifstream(path, std::ios::binary).read(text_.data(), static_cast<std::streamsize>(text_.size()));
    const std::string magic = line();
    if (magic.size() != 8 || !magic.starts_with("NRRD000") || magic[7] < '1' || magic[7] > '5')
      refuse(fmt::format("its first line is {}; versions NRRD0001 to NRRD0005 are read", quote(magic)));
    while (at_ < text_.size()) {
      const std::string text = line();
      if (text.empty()) {
        ends_with_blank_ = true;
        break;
      }
      take(text);
    }
  }

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(fmt::format("{}, line {}: {}", path_.string(), lines_, what));
  }
  [[noreturn]] void refuse_field(const std::string& field, const std::string& what) const {
    throw Error(fmt::format("{}: the field '{}' {}", path_.string(), field, what));
  }
  bool has(const std::string& field) const { return fields_.contains(field); }
  const std::string& get(const std::string& field) const {
    const auto found = fields_.find(field);
    if (found == fields_.end()) refuse_field(field, "is missing");
    return found->second;
  }
  /// Numbers between blanks, commas and parentheses.
  std::vector<double> numbers(const std::string& field) const {
    std::string text = get(field);
    for (char& c : text)
      if (c == ',' || c == '(' || c == ')') c = ' ';
    std::vector<double> found;
    for (std::size_t at = text.find_first_not_of(' '); at != std::string::npos; at = text.find_first_not_of(' ', at)) {
      const std::size_t end = std::min(text.find(' ', at), text.size());
      double value = 0;
      const auto [stop, failure] = std::from_chars(text.data() + at, text.data() + end, value);
      if (failure != std::errc() || stop != text.data() + end)
        refuse_field(field, fmt::format("is {}; expected numbers", quote(get(field))));
      found.push_back(value);
      at = end;
    }
    return found;
  }
  /// Whole numbers of any size; one that takes more than 63 bits is the most there is.
  std::vector<std::int64_t> integers(const std::string& field) const {
    std::vector<std::int64_t> found;
    for (const double value : numbers(field)) {
      if (value != std::floor(value)) refuse_field(field, fmt::format("is {}; expected whole numbers", quote(get(field))));
      found.push_back(std::abs(value) < 9e18 ? static_cast<std::int64_t>(value) : std::numeric_limits<std::int64_t>::max());
    }
    return found;
  }
  std::int64_t integer(const std::string& field) const {
    const std::vector<std::int64_t> found = integers(field);
    if (found.size() != 1) refuse_field(field, fmt::format("is {}; expected one number", quote(get(field))));
    return found[0];
  }
  std::uint64_t bytes() const { return at_; }
  bool ends_with_blank() const { return ends_with_blank_; }

 private:
  std::string line() {
    ++lines_;
    const std::size_t end = text_.find('\n', at_);
    if (end == std::string::npos && text_.size() == kMostHeaderBytes) refuse("the header has no end within its first MiB");
    const std::size_t stop = std::min(end, text_.size());
    std::string found = text_.substr(at_, stop - at_);
    at_ = std::min(stop + 1, text_.size());
    if (!found.empty() && found.back() == '\r') found.pop_back();
    return found;
  }

  void take(const std::string& text) {
    if (text.starts_with('#')) return;
    const std::size_t colon = text.find(':');
    if (colon == std::string::npos) refuse(fmt::format("{} is no field", quote(text)));
    if (text.substr(colon).starts_with(":=")) return;  // a note of somebody's own
    std::string name = text.substr(0, colon);
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (name == "datafile") name = "data file";
    if (name == "lineskip") name = "line skip";
    if (name == "byteskip") name = "byte skip";
    const std::size_t begin = std::min(text.find_first_not_of(" \t", colon + 1), text.size());
    const std::size_t end = text.find_last_not_of(" \t") + 1;
    if (!fields_.emplace(name, text.substr(begin, end > begin ? end - begin : 0)).second)
      refuse(fmt::format("the field {} stands twice", quote(name)));
  }

  fs::path path_;
  std::string text_;
  std::size_t at_ = 0;
  int lines_ = 0;
  bool ends_with_blank_ = false;
  std::map<std::string, std::string> fields_;
};

ValueType type_of(const NrrdHeader& header) {
  const std::string& name = header.get("type");
  for (const TypeNames& known : nrrd_types())
    if (std::find(known.names.begin(), known.names.end(), name) != known.names.end()) return known.type;
  header.refuse_field("type", fmt::format("is {}; accepted are 8, 16 and 32-bit integers, float and double", quote(name)));
}

void set_encoding(const NrrdHeader& header, VolumeFile& file) {
  const std::string& encoding = header.get("encoding");
  file.gzip = encoding == "gzip" || encoding == "gz";
  if (!file.gzip && encoding != "raw")
    header.refuse_field("encoding", fmt::format("is {}; accepted: raw, gzip", quote(encoding)));
  if (bytes_of(file.type) == 1) return;
  const std::string& endian = header.get("endian");
  if (endian != "little" && endian != "big")
    header.refuse_field("endian", fmt::format("is {}; accepted: little, big", quote(endian)));
  file.swapped = endian == "big";
}

/// Widths along the axes. Axes that are turned or mirrored are refused.
Vec3d spacing_of(const NrrdHeader& header) {
  Vec3d spacing(1);
  const bool directions = header.has("space directions");
  const std::string field = directions ? "space directions" : "spacings";
  if (!header.has(field)) return spacing;
  const std::vector<double> numbers = header.numbers(field);
  if (numbers.size() != (directions ? 9U : 3U))
    header.refuse_field(field, fmt::format("has {} numbers; three axes need {}", numbers.size(), directions ? 9 : 3));
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    spacing[axis] = directions ? numbers[4 * a] : numbers[a];
    for (std::size_t other = 0; directions && other < 3; ++other)
      if (other != a && numbers[3 * a + other] != 0)
        header.refuse_field(field, "turns the axes; accepted are axes along x, y, z");
    if (!(spacing[axis] > 0) || !std::isfinite(spacing[axis]))
      header.refuse_field(field, fmt::format("has a width of {}; accepted: above 0", spacing[axis]));
  }
  return spacing;
}

std::string without_quotes(const std::string& text) {
  const bool quoted = text.size() > 1 && text.front() == '"' && text.back() == '"';
  const std::string inner = quoted ? text.substr(1, text.size() - 2) : text;
  return is_utf8(inner) ? inner : "";
}

void set_place(const NrrdHeader& header, VolumeFile& file) {
  if (header.has("sample units")) file.unit = without_quotes(header.get("sample units"));
  file.spacing = spacing_of(header);
  if (!header.has("space origin")) return;
  const std::vector<double> origin = header.numbers("space origin");
  if (origin.size() != 3) header.refuse_field("space origin", fmt::format("has {} numbers; expected 3", origin.size()));
  file.lower = Vec3d(origin[0], origin[1], origin[2]) - file.spacing / 2.0;  // it is the middle of the first cell
}

/// The byte behind the first `lines` lines from `begin` on.
std::uint64_t skip_lines(const fs::path& file, std::uint64_t begin, std::int64_t lines) {
  std::ifstream in(file, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(begin));
  std::uint64_t at = begin;
  for (int c = 0; lines > 0 && (c = in.get()) != std::ifstream::traits_type::eof(); ++at)
    if (c == '\n') --lines;
  if (lines > 0) throw Error(fmt::format("{}: ends within the lines that are to be skipped", file.string()));
  return at;
}

/// Where the values stand.
void set_data(const NrrdHeader& header, const fs::path& path, VolumeFile& file) {
  const bool detached = header.has("data file");
  file.data = path;
  file.offset = header.bytes();
  if (detached) {
    const std::string& name = header.get("data file");
    if (name.empty() || name.starts_with("LIST") || name.find('%') != std::string::npos)
      header.refuse_field("data file", fmt::format("is {}; accepted is the name of one file", quote(name)));
    file.data = path.parent_path() / name;
    file.offset = 0;
    file.exact = false;
    static_cast<void>(regular_file_size(file.data));
  } else if (!header.ends_with_blank()) {
    throw Error(fmt::format("{}: its header has no end: no blank line, and no field 'data file'", path.string()));
  }
  if (header.has("line skip")) {
    const std::int64_t lines = header.integer("line skip");
    if (lines < 0) header.refuse_field("line skip", "is negative");
    file.offset = skip_lines(file.data, file.offset, lines);
  }
  if (!header.has("byte skip")) return;
  const std::int64_t bytes = header.integer("byte skip");
  if (bytes < -1 || (bytes == -1 && file.gzip))
    header.refuse_field("byte skip", fmt::format("is {}; accepted: 0 or more, and -1 where values are raw", bytes));
  if (bytes == -1)
    file.ends_with_values = true;
  else if (file.gzip)
    file.inner_offset = static_cast<std::uint64_t>(bytes);
  else
    file.offset += static_cast<std::uint64_t>(bytes);
}

}  // namespace

VolumeFile describe_nrrd(const fs::path& path) {
  const NrrdHeader header(path);
  VolumeFile file;
  file.type = type_of(header);
  if (const std::int64_t axes = header.integer("dimension"); axes != 3)
    header.refuse_field("dimension", fmt::format("is {}; accepted: 3", axes));
  file.cells = volume_shape(path, header.integers("sizes"));
  set_encoding(header, file);
  set_place(header, file);
  set_data(header, path, file);
  file.field = header.has("content") && !header.get("content").empty() ? header.get("content") : path.stem().string();
  return file;
}

}  // namespace amrtex
