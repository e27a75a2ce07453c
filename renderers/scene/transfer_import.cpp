#include "renderers/scene/transfer_import.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <pugixml.hpp>

#include "renderers/scene/import_formats.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

using import_formats::Source;

constexpr const char* kFormats =
    "accepted: a colour map of ParaView (JSON, XML), .xf of the ExaBricks family, .ct of VisIt, a list of Gaussians (JSON)";

std::string bytes_of(const Source& source) {
  constexpr std::uintmax_t kMost = 64 << 20;
  std::error_code failure;
  if (std::filesystem::is_directory(source.file, failure)) source.fail("a folder; accepted: the name of a colour map, or a file");
  const auto size = std::filesystem::is_regular_file(source.file, failure) ? std::filesystem::file_size(source.file, failure) : 0;
  if (const std::string reason = why_absent(source.file); !reason.empty())
    source.fail(fmt::format("{}; accepted: a file, or the name of a colour map: {}", reason, fmt::join(color_map_names(), ", ")));
  if (size > kMost) source.fail(fmt::format("{} bytes; no colour map is that large", size));
  std::ifstream in(source.file, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(in), {});
  if (!in && bytes.empty()) source.fail("cannot be read");
  return bytes;
}

ImportedTransfer read_xml(const std::string& bytes, const Source& source) {
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(bytes.data(), bytes.size());
  if (!result) source.fail(fmt::format("no XML: {} at byte {}", result.description(), result.offset));
  const std::string root = document.document_element().name();
  if (root == "ColorMaps" || root == "ColorMap") return import_formats::read_paraview_xml(document, source);
  if (root == "Object") return import_formats::read_visit(document, source);
  source.fail(fmt::format("XML of the element {}; {}", quote(root), kFormats));
}

ImportedTransfer read_json(const std::string& bytes, const Source& source) {
  const Json json = Json::parse(bytes, nullptr, false);
  if (json.is_discarded()) source.fail(fmt::format("no JSON; {}", kFormats));
  if (json.is_object() && json.contains("gaussians")) return import_formats::read_gaussians(json, source);
  return import_formats::read_paraview_json(json, source);
}

ImportedTransfer read_any(const Source& source) {
  const std::string bytes = bytes_of(source);
  constexpr std::size_t kAlphas = 512;
  const bool text = bytes.find('\0') == std::string::npos;
  const std::size_t first = bytes.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (text && first != std::string::npos && bytes[first] == '<') return read_xml(bytes, source);
  if (text && first != std::string::npos && (bytes[first] == '{' || bytes[first] == '[')) return read_json(bytes, source);
  if (bytes.size() == kAlphas || !text) return import_formats::read_xf(bytes, source);
  source.fail(kFormats);
}

/// Extinction over 1 of an opacity.
double depth_of(double opacity) { return -std::log1p(-std::min(opacity, 1 - 0x1p-24)); }

/// Does a straight line follow depth_of between two opacities?
bool straight(double from, double to) {
  constexpr int kPlaces = 15;
  constexpr double kSafe = 0.95;  // of the bound: the places lie beside the largest difference
  for (int i = 1; i <= kPlaces; ++i) {
    const double w = static_cast<double>(i) / (kPlaces + 1);
    const double exact = depth_of(from + w * (to - from));
    const double line = (1 - w) * depth_of(from) + w * depth_of(to);
    if (std::abs(line - exact) > kSafe * std::max(kExtinctionShare * exact, kExtinctionDepth)) return false;
  }
  return true;
}

}  // namespace

ImportedTransfer import_transfer(const std::string& file) {
  const std::size_t mark = file.rfind('#');
  const bool named = mark != std::string::npos && !std::filesystem::exists(file);
  const Source source{named ? file.substr(0, mark) : file, named ? file.substr(mark + 1) : ""};
  ImportedTransfer imported = read_any(source);
  const auto [first, last] = imported.range();
  if (!(first < last)) source.fail(fmt::format("all of it lies at the value {}; accepted: a range", first));
  if (imported.logarithmic && !(first > 0))
    source.fail(fmt::format("a logarithmic axis from {}; accepted: values above 0", first));
  return imported;
}

std::vector<TransferFunction::ExtinctionPoint> extinction_of(const std::vector<OpacityPoint>& opacity, double length) {
  std::vector<TransferFunction::ExtinctionPoint> points;
  const auto add = [&](double value, double a) {
    if (points.empty() || value > points.back().value) points.push_back({value, depth_of(a) / length});
  };
  for (std::size_t i = 0; i < opacity.size(); ++i) {
    if (i == 0) add(opacity[0].value, opacity[0].opacity);
    if (i == 0) continue;
    const auto [v0, a0] = opacity[i - 1];
    const auto [v1, a1] = opacity[i];
    double done = 0;
    while (done < 1) {
      const auto at = [a = a0, b = a1](double w) { return a + w * (b - a); };
      double good = done, bad = 1;
      if (straight(at(done), a1)) good = 1;
      while (good < 1 && bad - good > 1e-12) {
        const double middle = (good + bad) / 2;
        (straight(at(done), at(middle)) ? good : bad) = middle;
      }
      done = good > done ? good : 1;
      add(done == 1 ? v1 : v0 + done * (v1 - v0), done == 1 ? a1 : at(done));
    }
  }
  return points;
}

}  // namespace amrtex
