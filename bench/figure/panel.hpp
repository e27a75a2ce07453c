// What stands in a figure's panels, before it has a size on paper.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/figure/color_scale.hpp"
#include "bench/figure/drawing.hpp"
#include "bench/settings/figure_settings.hpp"
#include "renderers/scene/picture.hpp"

namespace amrtex {

struct LevelKey {
  int level = 0;
  Ink ink;
};

struct PanelContent {
  Picture picture;          ///< four channels of colour, or one number a pixel
  std::string quantity;     ///< what its colours, or numbers, are
  Vec3d background{1};      ///< linear RGB
  bool is_signed = false;   ///< 0 is the middle of the colours
  int finest_level = -1;    ///< of pictures of levels: their numbers end here
  TransferFunction colors;  ///< of four channels, over values; without points where there are none
  std::vector<Line> lines;  ///< overlays, in parts of the picture's width and height
  std::vector<LevelKey> key;
  double world_width = 0;  ///< that the picture's width shows; 0: not known
};

/// Draws, reads and cuts: in the order of the panels, each scene once. Throws the panels' errors, with their places.
std::vector<PanelContent> make_panels(const FigureSpec& figure);

/// The colours of each panel's numbers, and of what bars beside the others say; null where there is nothing to say. Panels that
/// show the same have the same, where the figure says so.
std::vector<std::unique_ptr<ColorScale>> make_scales(const FigureSpec& figure, const std::vector<PanelContent>& panels);

}  // namespace amrtex
