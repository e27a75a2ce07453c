#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>

#include "bench/cli/commands.hpp"
#include "bench/figure/layout.hpp"
#include "bench/settings/default_scene.hpp"
#include "bench/settings/figure_settings.hpp"
#include "renderers/scene/color_map.hpp"
#include "structures/mesh/filter.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

struct FigureArguments {
  std::string input, output;
};

struct SliceArguments {
  std::string input, output, filter, axis = "z", color_map;
  std::optional<double> at;
  int pixels = PanelSpec{}.pixels;
  double width = 85;
  std::vector<double> range;
  std::vector<std::string> boxes, set;
  bool logarithmic = false;
};

/// Of a file to write, where it is one of `accepted`.
std::string extension_of(const std::string& output, const std::vector<std::string>& accepted) {
  const std::string extension = std::filesystem::path(output).extension();
  if (std::find(accepted.begin(), accepted.end(), extension) == accepted.end())
    throw UsageError(fmt::format("-o {}: accepted: a name ending in {}", clipped(output), fmt::join(accepted, ", ")));
  return extension;
}

int run_figure(const FigureArguments& a) {
  const std::string extension = extension_of(a.output, {".svg", ".pdf", ".png"});
  write_atomically(a.output, figure_file(read_figure(a.input), extension));
  return 0;
}

/// A figure of this slice alone.
FigureSpec slice_figure(const SliceArguments& a) {
  PanelSpec panel;
  (is_data_set(a.input) ? panel.data : panel.scene) = a.input;
  panel.show = Show::slice;
  panel.axis = a.axis;
  panel.at = a.at;
  panel.pixels = a.pixels;
  panel.color_map = a.color_map;
  panel.logarithmic = a.logarithmic;
  if (!a.range.empty()) panel.range = {a.range[0], a.range[1]};
  if (panel.range && !((*panel.range)[0] < (*panel.range)[1]))
    throw UsageError(fmt::format("--range {} {}: accepted: first < last", a.range[0], a.range[1]));
  panel.set = a.set;
  if (!a.filter.empty()) panel.set.push_back("filters=" + a.filter);
  for (const std::string& boxes : a.boxes) panel.overlays.push_back({.boxes = boxes, .levels = {}, .colors = {}});
  panel.place = "slice";
  FigureSpec figure;
  figure.file = "--width";
  figure.width = a.width;
  figure.columns = 1;
  figure.panels = {panel};
  return figure;
}

int run_slice(const SliceArguments& a) {
  const std::string extension = extension_of(a.output, {".png", ".svg", ".pdf", ".npy"});
  const FigureSpec figure = slice_figure(a);
  if (extension == ".npy")
    write_npy(make_panels(figure).front().picture, a.output, true);
  else
    write_atomically(a.output, figure_file(figure, extension));
  return 0;
}

}  // namespace

void add_figure_commands(CLI::App& app, Command& chosen) {
  auto f = std::make_shared<FigureArguments>();
  CLI::App* figure = app.add_subcommand("figure", "panels of pictures, errors, heat maps and slices for a page of paper");
  figure->add_option("input", f->input, "figure file: what stands in its panels (docs/figures.md)")->required();
  figure->add_option("-o,--out", f->output, ".svg, .pdf or .png")->required();
  figure->footer("Example: amrtex figure docs/figures/mesh.json -o figure.pdf");
  figure->callback([f, &chosen] { chosen = [f] { return run_figure(*f); }; });

  auto s = std::make_shared<SliceArguments>();
  CLI::App* slice = app.add_subcommand("slice", "the field on a plane across an axis, with boxes of the mesh where it cuts them");
  slice->add_option("input", s->input, "data set, or scene file")->required();
  slice->add_option("-o,--out", s->output, ".png, .svg or .pdf; .npy for the values, as the filter has them in double precision")
      ->required();
  slice->add_option("--axis", s->axis, "x, y or z, the default")->check(CLI::IsMember({"x", "y", "z"}));
  slice->add_option("--at", s->at, "where on the axis, world units; the middle of the domain otherwise");
  slice->add_option("--filter", s->filter, "nearest, linear_lod, ...; the scene's otherwise");
  slice->add_option("--boxes", s->boxes, "patches, cells, regions, nodes or domain; may be repeated")
      ->check(CLI::IsMember({"patches", "cells", "regions", "nodes", "domain"}));
  slice->add_option("--pixels", s->pixels, "along the longer edge; 512 otherwise")->check(CLI::Range(1, 16384));
  slice->add_option("--width", s->width, "of the figure, mm; 85 otherwise")->check(CLI::Range(10.0, 2000.0));
  slice->add_option("--colormap", s->color_map, fmt::format("{}", fmt::join(color_map_names(), ", ")))
      ->check(CLI::IsMember(std::vector<std::string>(color_map_names().begin(), color_map_names().end())));
  slice->add_option("--range", s->range, "first and last value of the colours")->expected(2);
  slice->add_flag("--log", s->logarithmic, "colours over log10(value)");
  add_set_option(*slice, s->set);
  slice->footer("Example: amrtex slice data/amrex_tiny/plt00008 --boxes patches -o slice.png");
  slice->callback([s, &chosen] { chosen = [s] { return run_slice(*s); }; });
}

}  // namespace amrtex
