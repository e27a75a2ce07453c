// Transfer functions of the ExaBricks family, colour tables of VisIt, Gaussians as yt adds them.
#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <pugixml.hpp>
#include <sstream>

#include "renderers/scene/import_formats.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex::import_formats {
namespace {

constexpr double kOnALine = 1e-6;  ///< of opacity: what a point may be off that lies between others

template <class T>
T little_endian(std::string_view bytes, std::size_t at) {
  static_assert(std::endian::native == std::endian::little);
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

/// 128 opacities and nothing else.
ImportedTransfer read_alphas(std::string_view bytes, const Source& source) {
  ImportedTransfer transfer;
  const std::size_t count = bytes.size() / sizeof(float);
  for (std::size_t i = 0; i < count; ++i)
    transfer.opacity.push_back(
        {static_cast<double>(i) / static_cast<double>(count - 1), little_endian<float>(bytes, i * sizeof(float))});
  transfer.opacity = checked_opacity(std::move(transfer.opacity), kOnALine, source);
  transfer.relative = true;
  return transfer;
}

}  // namespace

ImportedTransfer read_xf(std::string_view bytes, const Source& source) {
  constexpr std::uint64_t kMagic = 0x1235abc000;
  constexpr std::size_t kHeader = 32, kEntry = 4 * sizeof(float), kAlphas = 512;
  const bool header = bytes.size() >= kHeader && little_endian<std::uint64_t>(bytes, 0) == kMagic;
  if (!header && bytes.size() == kAlphas) return read_alphas(bytes, source);
  if (!header) source.fail("no .xf file: neither 512 bytes of opacities nor one that begins with the number 0x1235abc000");
  const double low = little_endian<float>(bytes, 12), high = little_endian<float>(bytes, 16);
  const double from = little_endian<float>(bytes, 20) / 100.0, to = little_endian<float>(bytes, 24) / 100.0;
  const auto count = little_endian<std::int32_t>(bytes, 28);
  if (count < 2 || (bytes.size() - kHeader) / kEntry != static_cast<std::size_t>(count) || (bytes.size() - kHeader) % kEntry != 0)
    source.fail(fmt::format("{} entries of 16 bytes are announced, {} bytes follow", count, bytes.size() - kHeader));
  const double first = low + from * (high - low), last = low + to * (high - low);
  if (!(first < last)) source.fail(fmt::format("a range from {} to {}", first, last));
  std::vector<Node> nodes;
  ImportedTransfer transfer;
  for (std::int32_t i = 0; i < count; ++i) {
    const double w = static_cast<double>(i) / (count - 1);
    const double value = (1 - w) * first + w * last;
    const auto number = [&](std::size_t c) {
      return static_cast<double>(little_endian<float>(bytes, kHeader + static_cast<std::size_t>(i) * kEntry + c * sizeof(float)));
    };
    nodes.push_back({value, {number(0), number(1), number(2)}});
    transfer.opacity.push_back({value, number(3)});
  }
  transfer.colors = joined(std::move(nodes), Space::rgb, source);
  transfer.opacity = checked_opacity(std::move(transfer.opacity), kOnALine, source);
  return transfer;
}

ImportedTransfer read_visit(const pugi::xml_document& document, const Source& source) {
  const pugi::xml_node table = document.document_element();
  const pugi::xml_node list = table.find_child_by_attribute("Object", "name", "ColorControlPointList");
  if (std::string_view(table.attribute("name").value()) != "ColorTable" || !list)
    source.fail("no colour table of VisIt: an Object 'ColorTable' with a 'ColorControlPointList'");
  const auto field = [](const pugi::xml_node& node, const char* name) {
    return node.find_child_by_attribute("Field", "name", name).text();
  };
  std::vector<Node> nodes;
  std::vector<OpacityPoint> opacity;
  bool transparent = false;
  for (const pugi::xml_node point : list.children("Object")) {
    std::istringstream in(field(point, "colors").get());
    double r = -1, g = -1, b = -1, a = 255;
    in >> r >> g >> b;
    if (!in) source.fail(fmt::format("colour {}: 'colors' holds no three numbers", nodes.size()));
    if (!(in >> a)) a = 255;
    const double place = field(point, "position").as_double(0);
    nodes.push_back({place, Vec3d(r, g, b) / 255.0});
    opacity.push_back({place, a / 255});
    transparent = transparent || a != 255;
  }
  if (field(list, "equalSpacingFlag").as_bool(false) && nodes.size() > 1)
    for (std::size_t i = 0; i < nodes.size(); ++i)
      nodes[i].value = opacity[i].value = static_cast<double>(i) / static_cast<double>(nodes.size() - 1);
  ImportedTransfer transfer;
  transfer.colors = joined(std::move(nodes), Space::rgb, source);
  if (transparent) transfer.opacity = checked_opacity(std::move(opacity), kOnALine, source);
  transfer.relative = true;
  return transfer;
}

namespace {

struct Gaussian {
  double location, width;
  Vec3d rgb;
  double opacity;
  double at(double x) const { return std::exp(-(x - location) * (x - location) / width); }
};

double number_at(const Json& json, const std::string& place, const Source& source) {
  if (!json.is_number()) source.fail(fmt::format("{}: {} is no number", place, shown(json)));
  return json.get<double>();
}

Gaussian gaussian_of(const Json& json, std::size_t i, const Source& source) {
  const auto place = [&](const char* key) { return fmt::format("gaussians[{}].{}", i, key); };
  for (const char* key : {"location", "width", "height"})
    if (!json.is_object() || !json.contains(key)) source.fail(fmt::format("{} is missing", place(key)));
  const Json& height = json["height"];
  if (!height.is_array() || height.size() != 4) source.fail(fmt::format("{}: accepted: [r, g, b, opacity]", place("height")));
  Gaussian g{number_at(json["location"], place("location"), source), number_at(json["width"], place("width"), source), {}, 0};
  if (!(g.width > 0)) source.fail(fmt::format("{}: {}; accepted: above 0", place("width"), g.width));
  for (int c = 0; c < 3; ++c) g.rgb[c] = number_at(height[static_cast<std::size_t>(c)], place("height"), source);
  g.opacity = number_at(height[3], place("height"), source);
  return g;
}

}  // namespace

ImportedTransfer read_gaussians(const Json& json, const Source& source) {
  constexpr double kBound = 1.0 / 1024;  // of opacity
  constexpr std::size_t kMost = 64;
  const Json bounds = json.value("bounds", Json());
  if (!bounds.is_array() || bounds.size() != 2) source.fail("'bounds' is no list of two numbers");
  const double lower = number_at(bounds[0], "bounds", source), upper = number_at(bounds[1], "bounds", source);
  if (!(lower < upper)) source.fail(fmt::format("bounds: {} to {}; accepted: the smaller one first", lower, upper));
  const Json& list = json["gaussians"];
  if (!list.is_array() || list.empty() || list.size() > kMost)
    source.fail(fmt::format("'gaussians': accepted: a list of 1 to {}", kMost));
  std::vector<Gaussian> gaussians;
  for (std::size_t i = 0; i < list.size(); ++i) gaussians.push_back(gaussian_of(list[i], i, source));
  std::vector<double> places;
  for (int i = 0; i <= 64; ++i) places.push_back(lower + (upper - lower) * i / 64);
  for (const Gaussian& g : gaussians)
    for (int i = -40; i <= 40; ++i) places.push_back(g.location + i / 10.0 * std::sqrt(g.width / 2));
  std::erase_if(places, [&](double x) { return !(x >= lower && x <= upper); });
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  ImportedTransfer transfer;
  transfer.logarithmic = json.value("log", Json(false)) == Json(true);
  std::vector<Node> nodes;
  for (const double x : places) {
    Vec3d rgb(0);
    double weight = 0, most = 0;
    for (const Gaussian& g : gaussians) {
      const double a = std::max(1e-300, g.opacity * g.at(x));
      rgb += g.rgb * a;
      weight += a;
      most = std::max(most, a);
    }
    nodes.push_back({x, rgb / weight});
    transfer.opacity.push_back({x, most > 1e-6 ? most : 0});
  }
  transfer.colors = joined(std::move(nodes), Space::rgb, source);
  transfer.opacity = checked_opacity(std::move(transfer.opacity), kBound, source);
  if (!transfer.logarithmic) return transfer;
  for (auto& p : transfer.colors) p.value = std::pow(10, p.value);
  for (auto& p : transfer.opacity) p.value = std::pow(10, p.value);
  return transfer;
}

}  // namespace amrtex::import_formats
