// Files that `amrtex figure` draws: what stands in each panel, and how large it is on paper (docs/figures.md).
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bench/settings/settings_table.hpp"

namespace amrtex {

/// What a panel shows.
enum class Show { picture, reference, error, samples, regions, level, slice };
std::string_view show_name(Show show);

/// Boxes over a panel, in the colours of their levels.
struct OverlaySpec {
  std::string boxes = "patches";    ///< patches, cells, regions, nodes or domain
  std::vector<int> levels;          ///< those that are drawn; empty: all
  std::vector<std::string> colors;  ///< of level 0, 1, ...; empty: the built-in ones
  double line = 0.15;               ///< mm
  double opacity = 1;
};

/// A ray, and where the march samples it in the scene's structure.
struct RaySpec {
  std::array<double, 3> from{}, to{};  ///< world
  std::string sampling = "adaptive";
  double step = 1;  ///< as `render.step`
  std::string color = "#1f4e9c";
};

/// A part of a panel's picture, enlarged over one of its corners.
struct InsetSpec {
  std::array<double, 4> box{};  ///< left, top, right, bottom; parts of the picture's width and height
  std::string corner = "upper right";
  double size = 0.4;  ///< of the panel's width
  std::string color = "#e69f00";
};

struct PanelSpec {
  std::string scene, data, records, file;  ///< one of them
  std::string where;                       ///< of `records`: which of them
  std::vector<std::string> set;            ///< of `scene` and `data`: as `--set`
  std::string field, view = "corner";      ///< of `data`
  std::array<int, 2> size{512, 512};       ///< of `data`, pixels
  Show show = Show::picture;
  std::string axis = "z";    ///< of a slice: what it stands across
  std::optional<double> at;  ///< of a slice: where on that axis, world; absent: the middle of the domain
  int pixels = 512;          ///< of a slice, along its longer edge
  std::string caption;
  std::string color_map;  ///< empty: viridis, of signed values cool_warm
  std::optional<std::array<double, 2>> range;
  bool logarithmic = false;
  bool color_bar = true;
  std::string bar_label;             ///< empty: what is shown
  std::optional<double> scale_bar;   ///< world length
  std::string scale_label;           ///< empty: its length
  std::string background = "scene";  ///< scene, white or black
  bool level_key = true;             ///< what the colours of levels mean, below overlays
  std::vector<OverlaySpec> overlays;
  std::vector<RaySpec> rays;
  std::vector<InsetSpec> insets;
  std::string place;  ///< "figure.json:12: panels[1]"
};

struct FigureSpec {
  std::filesystem::path file;
  double width = 160;  ///< mm
  int columns = 0;     ///< 0: as many as there are panels, at most 3
  double gap = 4;      ///< between panels, mm
  double dpi = 300;    ///< of .png
  std::string font = "DejaVu Sans";
  double font_size = 8;              ///< points
  bool labels = true;                ///< (a), (b), ...
  std::string color_bars = "right";  ///< right or below
  bool shared_ranges = true;         ///< panels that show the same have one range
  std::vector<PanelSpec> panels;
};

/// Throws UsageErrors that name file, line and key, and Error where the file cannot be read.
FigureSpec read_figure(const std::filesystem::path& path);

/// Keys of these files, as all_sections() has those of experiments: figure, panels, overlays, rays, insets.
std::span<const Section> figure_sections();

}  // namespace amrtex
