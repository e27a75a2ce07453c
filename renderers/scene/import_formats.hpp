// What the readers of colour maps share, and one reader a format.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "renderers/scene/imported_transfer.hpp"
#include "structures/mesh/json.hpp"

namespace pugi {
class xml_document;
}

namespace amrtex::import_formats {

/// A file that is read, for messages.
struct Source {
  std::string file;
  std::string wanted;  ///< name of one of several maps; empty: the first
  [[noreturn]] void fail(std::string_view problem) const;
};

/// A colour as it is written: sRGB.
struct Node {
  double value;
  Vec3d srgb;
};

enum class Space { rgb, hsv, lab, diverging };
Space parse_space(const std::string& name, const Source& source);

/// The nodes joined in a colour space, as linear light of few points. Equal values stand for a jump.
ColorPoints joined(std::vector<Node> nodes, Space space, const Source& source);
/// Ascending values, opacities in [0, 1], no points that lie on a line between others.
std::vector<OpacityPoint> checked_opacity(std::vector<OpacityPoint> points, double bound, const Source& source);

ImportedTransfer read_paraview_json(const Json& json, const Source& source);
ImportedTransfer read_paraview_xml(const pugi::xml_document& document, const Source& source);
ImportedTransfer read_visit(const pugi::xml_document& document, const Source& source);
ImportedTransfer read_xf(std::string_view bytes, const Source& source);
ImportedTransfer read_gaussians(const Json& json, const Source& source);

}  // namespace amrtex::import_formats
