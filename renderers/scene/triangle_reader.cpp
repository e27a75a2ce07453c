#include "renderers/scene/triangle_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string>
#include <string_view>
#include <utility>

#include "renderers/scene/triangle_formats.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostBytes = std::uint64_t{8} << 30;  // some 160 million triangles of binary STL

struct Format {
  std::string_view ending;
  std::vector<Triangle> (*read)(const TriangleText& file);
};
constexpr std::array kFormats{Format{".obj", read_obj}, Format{".ply", read_ply}, Format{".stl", read_stl}};

[[noreturn]] void refuse(const fs::path& path, std::string_view problem) {
  throw Error(fmt::format("{}: {}; accepted: OBJ, PLY or STL with triangles or polygons", path.string(), problem));
}

const Format& format_of(const fs::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const auto format = std::find_if(kFormats.begin(), kFormats.end(), [&](const Format& f) { return f.ending == ending; });
  if (format == kFormats.end()) refuse(path, fmt::format("the ending {} is not one of .obj, .ply, .stl", quote(ending)));
  return *format;
}

}  // namespace

TriangleMesh read_triangles(const fs::path& path) {
  return read_triangles(path, path.has_parent_path() ? path.parent_path() : fs::path("."));
}

TriangleMesh read_triangles(const fs::path& path, const fs::path& folder) {
  const Format& format = format_of(path);
  const std::string bytes = load_bytes(path, kMostBytes);
  try {
    return TriangleMesh(format.read({bytes, !leads_out_of(folder, path)}));
  } catch (const Error& e) {
    refuse(path, e.what());
  }
}

}  // namespace amrtex
