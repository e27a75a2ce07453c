#include "bench/settings/figure_settings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "bench/settings/experiment_parser.hpp"
#include "renderers/scene/color_map.hpp"
#include "renderers/scene/framing.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr double kMostMillimetres = 2000;
constexpr double kMostDpi = 2400;
constexpr int kMostPixels = 16384;
constexpr std::size_t kMostPanels = 26;  ///< letters of labels

constexpr std::array<std::string_view, 7> kShowNames = {"picture", "reference", "error", "samples", "regions", "level", "slice"};
constexpr std::array<std::string_view, 5> kBoxNames = {"patches", "cells", "regions", "nodes", "domain"};
constexpr std::array<std::string_view, 4> kCornerNames = {"upper left", "upper right", "lower left", "lower right"};

template <class Names>
std::vector<std::string> texts(const Names& names) {
  return {names.begin(), names.end()};
}

Show parse_show(const std::string& name) {
  return static_cast<Show>(std::find(kShowNames.begin(), kShowNames.end(), name) - kShowNames.begin());
}

// --- rows ---

template <class T, auto Member>
Setting<T> row(std::string name, ValueType type, std::string help, std::string unit = {}, std::string default_text = {}) {
  using Value = std::remove_cvref_t<decltype(T{}.*Member)>;
  return {{.name = std::move(name),
           .type = std::move(type),
           .reference = AffectsReference::no,
           .help = std::move(help),
           .unit = std::move(unit),
           .default_text = std::move(default_text)},
          [](const T& t) -> Json { return t.*Member; },
          [](T& t, const Json& v) { t.*Member = v.get<Value>(); }};
}

/// Null where there is none.
template <class T, auto Member>
Setting<T> optional_row(std::string name, ValueType type, std::string help, std::string unit = {},
                        std::string default_text = {}) {
  using Value = typename std::remove_cvref_t<decltype(T{}.*Member)>::value_type;
  return {{.name = std::move(name),
           .type = type.or_null(),
           .reference = AffectsReference::no,
           .help = std::move(help),
           .unit = std::move(unit),
           .default_text = std::move(default_text)},
          [](const T& t) { return t.*Member ? Json(*(t.*Member)) : Json(); },
          [](T& t, const Json& v) { t.*Member = v.is_null() ? std::nullopt : std::optional(v.get<Value>()); }};
}

ValueType texts_type(std::string form) {
  ValueType type = list_of(text_type(), 0, std::move(form));
  type.may_be_empty = true;
  return type;
}

const SettingTable<FigureSpec>& figure_table() {
  using F = FigureSpec;
  static const SettingTable<F> table{
      "figure",
      {row<F, &F::width>("width", number_above(0, kMostMillimetres), "of the figure; its height follows", "mm"),
       row<F, &F::columns>("columns", integer_type(0, static_cast<std::int64_t>(kMostPanels)),
                           "panels in a row; 0: all, at most 3"),
       row<F, &F::gap>("gap", number_type(0, kMostMillimetres), "between panels", "mm"),
       row<F, &F::dpi>("dpi", number_type(10, kMostDpi),
                       "of `.png` files, which say it themselves; the others are vectors around the panels' own pixels",
                       "pixels an inch"),
       row<F, &F::font>("font", text_type(), "a font of this machine"),
       row<F, &F::font_size>("font_size", number_type(1, 100), "of all text", "points"),
       row<F, &F::labels>("labels", boolean_type(), "(a), (b), … before the captions, where there is more than one panel"),
       row<F, &F::color_bars>("color_bars", choice_type({"right", "below"}), "where they stand"),
       row<F, &F::shared_ranges>(
           "shared_ranges", boolean_type(),
           "panels that show the same quantity have one range and one colour map, unless they say their own")}};
  return table;
}

const SettingTable<OverlaySpec>& overlay_table() {
  using O = OverlaySpec;
  static const SettingTable<O> table{
      "overlays",
      {row<O, &O::boxes>("boxes", choice_type(texts(kBoxNames)),
                         "`patches` and leaf `cells` of the mesh; `regions` and `nodes` of the scene's encoding; the `domain` "
                         "([what is drawn](#a-mesh-over-its-picture))"),
       row<O, &O::levels>(
           "levels",
           [] {
             ValueType type = list_of(integer_type(0, 63), 0, "a list of levels");
             type.may_be_empty = true;
             return type;
           }(),
           "those that are drawn; of `nodes` their depth below the root", "", "all"),
       row<O, &O::colors>("colors", texts_type("a list of colours \"#rrggbb\""), "of level 0, 1, …; then from the first again",
                          "", "built in"),
       row<O, &O::line>("line", number_above(0, 10), "width", "mm"),
       row<O, &O::opacity>("opacity", number_type(0, 1), "of the lines")}};
  return table;
}

const SettingTable<InsetSpec>& inset_table() {
  using I = InsetSpec;
  static const SettingTable<I> table{
      "insets",
      {{{.name = "box",
         .type = list_of(number_type(0, 1), 4, "four numbers [left, top, right, bottom]"),
         .reference = AffectsReference::no,
         .help = "the part that is enlarged, in parts of the picture's width and height from its upper left corner",
         .required = true},
        [](const I& i) -> Json { return i.box; },
        [](I& i, const Json& v) { i.box = v.get<std::array<double, 4>>(); },
        [](const I& i) -> std::string {
          return i.box[0] < i.box[2] && i.box[1] < i.box[3] ? "" : "is empty; accepted: left < right and top < bottom";
        }},
       row<I, &I::corner>("corner", choice_type(texts(kCornerNames)), "of the panel, which it covers"),
       row<I, &I::size>("size", number_type(0.05, 0.95), "its width, of the panel's width"),
       row<I, &I::color>("color", text_type(), "of its frame and of the box that it shows, \"#rrggbb\"")}};
  return table;
}

const SettingTable<RaySpec>& ray_table() {
  using R = RaySpec;
  const auto end = [](Setting<R> row) {
    row.key.required = true;
    return row;
  };
  const ValueType place = list_of(number_type(), 3, "three numbers [x, y, z]");
  static const SettingTable<R> table{"rays",
                                     {end(row<R, &R::from>("from", place, "where it begins", "world units")),
                                      end(row<R, &R::to>("to", place, "where its line ends", "world units")),
                                      row<R, &R::sampling>("sampling", choice_type({"lattice", "adaptive"}),
                                                           "which places are marked ([sampling](sampling.md))"),
                                      row<R, &R::step>("step", number_above(0), "as `step` of a scene", "cell widths"),
                                      row<R, &R::color>("color", text_type(), "of the marks, \"#rrggbb\"")}};
  return table;
}

Setting<PanelSpec> show_row() {
  return {
      {.name = "show",
       .type = choice_type(texts(kShowNames)),
       .reference = AffectsReference::no,
       .help =
           "the `picture`; its double `reference`; `error`: picture − reference, of each pixel that of the channel where it is "
           "largest, with its sign; what the shader counted: `samples`, `regions`, and the finest `level` that was sampled; or a "
           "`slice` through the field"},
      [](const PanelSpec& p) -> Json { return show_name(p.show); },
      [](PanelSpec& p, const Json& v) { p.show = parse_show(v.get<std::string>()); }};
}

Setting<PanelSpec> range_row() {
  auto range = optional_row<PanelSpec, &PanelSpec::range>("range", list_of(number_type(), 2, "two numbers [first, last]"),
                                                          "of the colours of one number a pixel", "",
                                                          "of the values; of errors the same on both sides of 0");
  range.problem = [](const PanelSpec& p) -> std::string {
    if (p.range && !((*p.range)[0] < (*p.range)[1])) return "is empty; accepted: first < last";
    return p.range && p.logarithmic && !((*p.range)[0] > 0) ? "with 'logarithmic' values are above 0" : "";
  };
  return range;
}

std::vector<Setting<PanelSpec>> source_rows() {
  using P = PanelSpec;
  return {
      row<P, &P::scene>("scene", text_type(), "a scene file; as all paths, beside the figure's file or in the current folder", "",
                        "this or one of the next three"),
      row<P, &P::data>("data", text_type(), "a data set, drawn as `amrtex render` draws it", "", "none"),
      row<P, &P::records>("records", text_type(),
                          "a folder that `amrtex run` wrote: `picture` and `error` as they are stored there, the rest drawn "
                          "again from what the record says",
                          "", "none"),
      row<P, &P::file>("file", text_type(), "a picture that `amrtex render` wrote as `.npy`", "", "none"),
      row<P, &P::where>("where", text_type(),
                        "of `records`: a [condition](experiments.md) that leaves one of them", "", "none"),
      row<P, &P::set>("set", texts_type("a list of texts \"key=value\""),
                      "of `scene`, `data`, `records`: as [`--set`](experiments.md)", "", "none"),
      row<P, &P::field>("field", text_type(), "of `data`", "", "the first"),
      row<P, &P::view>("view", choice_type(texts(framing_names())), "of `data`: from where it is seen"),
      row<P, &P::size>("size", list_of(integer_type(1, kMostPixels), 2, "two numbers [width, height]"), "of `data`", "pixels")};
}

const SettingTable<PanelSpec>& panel_table() {
  using P = PanelSpec;
  static const SettingTable<P> table = [] {
    std::vector<Setting<P>> rows = source_rows();
    rows.push_back(show_row());
    rows.push_back(row<P, &P::axis>("axis", choice_type({"x", "y", "z"}), "what a `slice` stands across"));
    rows.push_back(optional_row<P, &P::at>("at", number_type(), "where a `slice` stands on its axis", "world units",
                                           "the middle of the domain"));
    rows.push_back(row<P, &P::pixels>("pixels", integer_type(1, kMostPixels), "along the longer edge of a `slice`"));
    rows.push_back(row<P, &P::caption>("caption", text_type(), "below the panel", "", "none"));
    rows.push_back(row<P, &P::color_map>("color_map", choice_type(texts(color_map_names())), "of one number a pixel", "",
                                         "`viridis`, of errors `cool_warm`"));
    rows.push_back(range_row());
    rows.push_back(row<P, &P::logarithmic>("logarithmic", boolean_type(), "colours over log10 of one number a pixel"));
    rows.push_back(row<P, &P::color_bar>("color_bar", boolean_type(), "a bar with the colours' values"));
    rows.push_back(row<P, &P::bar_label>("bar_label", text_type(), "what the bar's values are", "", "what is shown"));
    rows.push_back(optional_row<P, &P::scale_bar>(
        "scale_bar", number_above(0), "a bar of this length; in a perspective view, as long as it is in the middle of the domain",
        "world units", "none"));
    rows.push_back(row<P, &P::scale_label>("scale_label", text_type(), "beside it", "", "its length"));
    rows.push_back(row<P, &P::background>("background", choice_type({"scene", "white", "black"}),
                                          "behind what is transparent: as `amrtex render` has it, or this"));
    rows.push_back(row<P, &P::level_key>("level_key", boolean_type(), "below overlays, which colour stands for which level"));
    return SettingTable<P>{"panels", std::move(rows)};
  }();
  return table;
}

// --- files ---

const std::vector<Key>& structure_keys() {
  const auto key = [](std::string name, std::string help, bool required) {
    return Key{.name = std::move(name),
               .type = list_of(object_type({}), 0, "a list of objects"),
               .reference = AffectsReference::no,
               .help = std::move(help),
               .default_text = required ? "" : "none",
               .required = required};
  };
  static const std::vector<Key> keys = {key("panels", "what stands in the figure, row by row: [panels](#panels)", true),
                                        key("overlays", "boxes over it: [overlays](#overlays)", false),
                                        key("rays", "and where they are sampled: [rays](#rays)", false),
                                        key("insets", "parts of it, enlarged: [insets](#insets)", false)};
  return keys;
}

template <class T>
T parse_object(const JsonNode& node, const SettingTable<T>& table, std::vector<std::string_view> others = {}) {
  std::vector<std::string_view> keys = names_of(table.keys());
  keys.insert(keys.end(), others.begin(), others.end());
  node.accept_keys(keys);
  const Choice choice = node.members();
  T parsed;
  read_settings(node, choice, table, parsed);
  return parsed;
}

std::vector<JsonNode> list_at(const JsonNode& node, std::string_view key) {
  const auto found = node.find(key);
  if (!found) return {};
  if (!found->json().is_array()) found->fail("accepted: a list of objects");
  return found->json().empty() ? std::vector<JsonNode>() : found->items();
}

void require_color(const JsonNode& node, const std::string& text) {
  const bool ok = text.size() == 7 && text[0] == '#' && text.find_first_not_of("0123456789abcdefABCDEF", 1) == std::string::npos;
  if (!ok) node.fail(fmt::format("{} is no colour; accepted: \"#rrggbb\" in hexadecimal digits", quote(text)));
}

OverlaySpec parse_overlay(const JsonNode& node) {
  OverlaySpec overlay = parse_object(node, overlay_table());
  for (const std::string& color : overlay.colors) require_color(node.require("colors"), color);
  return overlay;
}

RaySpec parse_ray(const JsonNode& node) {
  RaySpec ray = parse_object(node, ray_table());
  if (node.find("color")) require_color(node.require("color"), ray.color);
  if (ray.from == ray.to) node.require("to").fail("a ray of no length; accepted: another place than 'from'");
  return ray;
}

InsetSpec parse_inset(const JsonNode& node) {
  InsetSpec inset = parse_object(node, inset_table());
  if (node.find("color")) require_color(node.require("color"), inset.color);
  return inset;
}

constexpr std::array<std::string_view, 4> kSources = {"scene", "data", "records", "file"};

/// Exactly one source, which exists, and no key that belongs to another one.
void require_source(const JsonNode& node, const JsonFile& file, PanelSpec& panel) {
  std::vector<std::string_view> given;
  for (const std::string_view key : kSources)
    if (node.find(key)) given.push_back(key);
  if (given.size() != 1)
    node.fail(fmt::format("what it shows comes from {}; accepted: one of {}",
                          given.empty() ? "nowhere" : fmt::format("{}", fmt::join(given, " and ")), fmt::join(kSources, ", ")));
  const auto belongs = [&](std::string_view key, std::vector<std::string_view> sources) {
    if (const auto found = node.find(key); found && std::find(sources.begin(), sources.end(), given[0]) == sources.end())
      found->fail(fmt::format("goes with {}, not with {}", fmt::join(sources, ", "), given[0]));
  };
  belongs("where", {"records"});
  belongs("set", {"scene", "data", "records"});
  for (const std::string_view key : {"field", "view", "size"}) belongs(key, {"data"});
  for (const std::string_view key : {"overlays", "rays", "scale_bar"}) belongs(key, {"scene", "data", "records"});
  if (given[0] == "file" && panel.show != Show::picture)
    node.require("show").fail(fmt::format("of a file there is the picture alone; accepted: {}", show_name(Show::picture)));
  std::string* const places[] = {&panel.scene, &panel.data, &panel.records, &panel.file};
  std::string& path = *places[std::find(kSources.begin(), kSources.end(), given[0]) - kSources.begin()];
  path = existing_path(node.require(given[0]), file).path.string();
}

PanelSpec parse_panel(const JsonNode& node, const JsonFile& file) {
  PanelSpec panel = parse_object(node, panel_table(), {"overlays", "rays", "insets"});
  panel.place = file.position(node.place()) + node.place();
  for (const std::string_view key : {"axis", "at", "pixels"})
    if (const auto found = node.find(key); found && panel.show != Show::slice) found->fail("goes with 'show' slice");
  for (const JsonNode& item : list_at(node, "overlays")) panel.overlays.push_back(parse_overlay(item));
  for (const JsonNode& item : list_at(node, "rays")) panel.rays.push_back(parse_ray(item));
  for (const JsonNode& item : list_at(node, "insets")) panel.insets.push_back(parse_inset(item));
  require_source(node, file, panel);
  return panel;
}

}  // namespace

std::string_view show_name(Show show) { return kShowNames[static_cast<std::size_t>(show)]; }

FigureSpec read_figure(const std::filesystem::path& path) {
  const JsonFile file = JsonFile::read(path);
  const JsonNode root = file.root();
  FigureSpec figure = parse_object(root, figure_table(), {"panels"});
  figure.file = path;
  const std::vector<JsonNode> panels = list_at(root, "panels");
  if (panels.empty() || panels.size() > kMostPanels)
    root.fail(fmt::format("{} panels; accepted: 'panels', a list of 1 to {}", panels.size(), kMostPanels));
  for (const JsonNode& panel : panels) figure.panels.push_back(parse_panel(panel, file));
  if (figure.columns == 0) figure.columns = static_cast<int>(std::min<std::size_t>(3, figure.panels.size()));
  return figure;
}

std::span<const Section> figure_sections() {
  static const std::vector<Section> sections = [] {
    std::vector<const Key*> figure = {&structure_keys()[0]}, panels = panel_table().keys();
    for (const Key* key : figure_table().keys()) figure.push_back(key);
    panels.push_back(&structure_keys()[1]);
    panels.push_back(&structure_keys()[2]);
    panels.push_back(&structure_keys()[3]);
    return std::vector<Section>{{"figure", "", figure},
                                {"panels", "panels", panels},
                                {"overlays", "panels.overlays", overlay_table().keys()},
                                {"rays", "panels.rays", ray_table().keys()},
                                {"insets", "panels.insets", inset_table().keys()}};
  }();
  return sections;
}

}  // namespace amrtex
