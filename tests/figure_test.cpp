// Figures: what their files accept, where lines and panels stand, what the files hold; and pictures of what pixels cost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include <filesystem>
#include <fstream>

#include "bench/figure/layout.hpp"
#include "bench/figure/overlay.hpp"
#include "bench/measure/heat_map.hpp"
#include "bench/records/stored_picture.hpp"
#include "bench/settings/figure_settings.hpp"
#include "bench/verify/pictures.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

/// Cells of level 0 are halves of the unit cube along each axis; the lower corner is refined once.
AmrHierarchy corner_mesh() {
  return verify::MeshBuilder(Vec3i(2), {2})
      .root(verify::constant(1))
      .patch(1, {Vec3i(0), Vec3i(2)}, verify::constant(2))
      .hierarchy();
}

Scene from_above(int pixels) {
  Scene scene;
  scene.view = verify::orthographic({0.5, 0.5, 0.5}, {0, 0, -1}, 1);
  scene.settings.width = scene.settings.height = pixels;
  return scene;
}

class Figures : public testing::Test {
 protected:
  Figures() {
    std::string name = (fs::temp_directory_path() / "amrtex_figure_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw Error("no temporary folder");
    folder_ = name;
    Picture picture(8, 4, 4);
    for (std::size_t i = 0; i < picture.values.size(); ++i) picture.values[i] = i % 4 == 3 ? 1 : static_cast<double>(i % 32) / 32;
    write_npy(picture, folder_ / "a.npy", false);
    Picture numbers(4, 4, 1);
    for (std::size_t i = 0; i < 16; ++i) numbers.values[i] = static_cast<double>(i);
    write_npy(numbers, folder_ / "numbers.npy", false);
  }
  ~Figures() override { fs::remove_all(folder_); }

  FigureSpec read(const Json& json) const {
    std::ofstream(folder_ / "figure.json") << json.dump(1);
    return read_figure(folder_ / "figure.json");
  }
  std::string complaint(const Json& json) const {
    try {
      figure_file(read(json), ".svg");
    } catch (const Error& e) {
      return e.what();
    }
    return "nothing";
  }

  fs::path folder_;
};

// ---- files ----

TEST_F(Figures, WhatIsWrongIsSaidWithItsLineAndWhatIsAccepted) {
  const Json panel = {{"file", "a.npy"}};
  const auto with = [&](const char* key, const Json& value) {
    Json changed = panel;
    changed[key] = value;
    return Json{{"panels", {changed}}};
  };
  const std::vector<std::pair<Json, std::string>> cases = {
      {Json::object(), "0 panels"},
      {{{"panels", Json::array()}}, "0 panels"},
      {{{"panels", {panel}}, {"widht", 3}}, "did you mean 'width'"},
      {{{"panels", {panel}}, {"width", 0}}, "a number above 0"},
      {{{"panels", {panel}}, {"dpi", 1e9}}, "a number from 10 to 2400"},
      {{{"panels", {panel}}, {"width", 3}}, "leave 2.7 mm for a picture"},
      {{{"panels", {panel}}, {"font", "No Such Font 7"}}, "font 'No Such Font 7': this machine has none"},
      {{{"panels", {Json::object()}}}, "comes from nowhere; accepted: one of scene, data, records, file"},
      {with("data", "a.npy"), "comes from data and file"},
      {{{"panels", {{{"file", "b.npy"}}}}}, "b.npy: no such file"},
      {{{"panels", {{{"records", "none"}}}}}, "none: no such file"},
      {with("show", "pictur"), "accepted: picture, reference, error, samples, regions, level, slice"},
      {with("show", "samples"), "of a file there is the picture alone"},
      {with("where", "step = 1"), "goes with records, not with file"},
      {with("axis", "x"), "goes with 'show' slice"},
      {with("range", {2, 1}), "accepted: first < last"},
      {with("color_map", "jet"), "accepted: viridis"},
      {with("overlays", {{{"boxes", "patches"}}}), "goes with scene, data, records, not with file"},
      {with("insets", {{{"box", {0.5, 0, 0.5, 1}}}}), "accepted: left < right"},
      {with("insets", {{{"box", {0, 0, 0.1, 0.9}}, {"size", 0.9}}}), "is higher than its panel"},
      {with("insets", {{{"box", {0, 0, 1, 1}}, {"color", "<script>"}}}), "'<script>' is no colour"}};
  for (const auto& [json, told] : cases) {
    const std::string message = complaint(json);
    EXPECT_THAT(message, HasSubstr(told)) << json.dump();
    EXPECT_THAT(message, AllOf(HasSubstr("figure.json"), Not(HasSubstr("\n"))));
  }
}

TEST_F(Figures, AFileOfTheSameDrawingIsTheSameBytesAndHoldsNoDateAndNoScript) {
  const FigureSpec figure =
      read({{"panels", {{{"file", "a.npy"}, {"caption", "<script>alert(1)</script> \"q\" _%$#&"}}, {{"file", "numbers.npy"}}}},
            {"dpi", 100}});
  for (const char* extension : {".pdf", ".png", ".svg"}) {
    const std::string first = figure_file(figure, extension);
    EXPECT_GT(first.size(), 1000U);
    EXPECT_THAT(first, AllOf(Not(HasSubstr("script>")), Not(HasSubstr("CreationDate"))));
    if (extension == std::string(".svg")) continue;  // Cairo numbers the parts of SVG files through a process: see below
    EXPECT_EQ(first, figure_file(figure, extension));
  }
  EXPECT_THAT(figure_file(figure, ".pdf"), StartsWith("%PDF-"));
}

TEST_F(Figures, APngHasTheSizeAndTheResolutionThatWereAsked) {
  const FigureSpec figure = read({{"panels", {{{"file", "a.npy"}}}}, {"width", 50.8}, {"dpi", 200}});
  const std::string png = figure_file(figure, ".png");
  const auto number = [&](std::size_t at) {
    unsigned n = 0;
    for (std::size_t i = 0; i < 4; ++i) n = n << 8U | static_cast<unsigned char>(png[at + i]);
    return n;
  };
  EXPECT_EQ(number(16), 400U) << "2 inches";
  // 400 pixels less the frame's two lines, at the picture's 2 : 1
  EXPECT_NEAR(number(20), 200, 2);
  const std::size_t physical = png.find("pHYs");
  ASSERT_NE(physical, std::string::npos);
  EXPECT_EQ(number(physical + 4), 7874U) << "200 / 0.0254 pixels a metre";
}

// ---- layout ----

/// Colour bars are one pixel wide or high, and many long.
bool is_bar(const Bitmap& bitmap) {
  return std::min(bitmap.width, bitmap.height) == 1 && std::max(bitmap.width, bitmap.height) > 16;
}

std::vector<Area> images(const Drawing& drawing) {
  std::vector<Area> areas;
  for (const Shape& s : drawing.shapes)
    if (const auto* image = std::get_if<Image>(&s.what);
        image != nullptr && !is_bar(*image->bitmap))
      areas.push_back(image->area);
  return areas;
}

std::vector<std::string> texts(const Drawing& drawing) {
  std::vector<std::string> all;
  for (const Shape& s : drawing.shapes)
    if (const auto* text = std::get_if<Text>(&s.what)) all.push_back(text->text);
  return all;
}

TEST_F(Figures, PicturesOfAllColumnsAreEquallyWideAndNothingIsOutside) {
  for (const char* bars : {"right", "below"}) {
    const FigureSpec figure = read({{"panels", {{{"file", "a.npy"}}, {{"file", "numbers.npy"}}, {{"file", "numbers.npy"}}}},
                                    {"columns", 2},
                                    {"width", 100},
                                    {"gap", 4},
                                    {"color_bars", bars}});
    const Drawing drawing = lay_out(figure, make_panels(figure));
    const std::vector<Area> areas = images(drawing);
    ASSERT_THAT(areas, SizeIs(3));
    EXPECT_EQ(drawing.width, 100);
    for (const Area& a : areas) {
      EXPECT_NEAR(a.width, areas[0].width, 1e-9);
      EXPECT_LE(a.right(), 100);
      EXPECT_LE(a.bottom(), drawing.height);
    }
    EXPECT_NEAR(areas[0].height, areas[0].width / 2, 1e-9);
    EXPECT_NEAR(areas[1].height, areas[1].width, 1e-9);
    EXPECT_GE(areas[2].top, areas[1].bottom()) << "the second row";
    EXPECT_THAT(texts(drawing), testing::IsSupersetOf({"(a)", "(b)", "(c)"}));
  }
}

TEST_F(Figures, AnInsetShowsItsBoxAsLargeAsItSays) {
  const FigureSpec figure =
      read({{"panels",
             {{{"file", "a.npy"}, {"insets", {{{"box", {0.25, 0.25, 0.5, 0.5}}, {"corner", "lower left"}, {"size", 0.5}}}}}}},
            {"width", 80}});
  const std::vector<Area> areas = images(lay_out(figure, make_panels(figure)));
  ASSERT_THAT(areas, SizeIs(2));
  // the box is a quarter of the picture's width and the inset half of it: pixels twice as large, the box's corner in the panel's
  EXPECT_NEAR(areas[1].width / 2, areas[0].width / 2 / 2, 1e-9) << "2 of 8 pixels, twice as large: half of the width";
  EXPECT_NEAR(areas[1].left, areas[0].left, 1e-9);
  EXPECT_NEAR(areas[1].bottom(), areas[0].bottom(), 1e-9);
}

TEST_F(Figures, PanelsOfOneQuantityShareTheirRangeUnlessTheyHaveTheirOwn) {
  write_npy(
      [] {
        Picture p(2, 1, 1);
        p.values = {-5, 40};
        return p;
      }(),
      folder_ / "more.npy", false);
  const auto ranges = [&](const Json& json) {
    const FigureSpec figure = read(json);
    std::vector<std::array<double, 2>> all;
    for (const auto& scale : make_scales(figure, make_panels(figure))) all.push_back({scale->first(), scale->last()});
    return all;
  };
  using Ranges = std::vector<std::array<double, 2>>;
  const Json panels = {{{"file", "numbers.npy"}}, {{"file", "more.npy"}}};
  EXPECT_EQ(ranges({{"panels", panels}}), (Ranges{{-5, 40}, {-5, 40}}));
  EXPECT_EQ(ranges({{"panels", panels}, {"shared_ranges", false}}), (Ranges{{0, 15}, {-5, 40}}));
  Json own = panels;
  own[1]["range"] = {0, 1};
  EXPECT_EQ(ranges({{"panels", own}}), (Ranges{{0, 15}, {0, 1}}));
}

// ---- overlays ----

TEST(Overlay, ASliceCutsPatchesIntoExactRectangles) {
  const AmrHierarchy mesh = corner_mesh();
  OverlaySpec overlay;
  const std::vector<LevelBox> boxes = mesh_boxes(mesh, "patches");
  const CutPlane low{2, 0.25}, high{2, 0.75};
  const std::vector<Line> lines = cut_boxes(mesh, boxes_in_layer(boxes, 2, cut_layer(mesh, low)), 2, overlay);
  ASSERT_THAT(lines, SizeIs(2));
  // level 1 covers [0, 1/2]², its upper edge in the middle of the picture
  EXPECT_EQ(lines[1].points[0].x, 0);
  EXPECT_EQ(lines[1].points[0].y, 0.5);
  EXPECT_EQ(lines[1].points[2].x, 0.5);
  EXPECT_EQ(lines[1].points[2].y, 1);
  EXPECT_THAT(boxes_in_layer(boxes, 2, cut_layer(mesh, high)), SizeIs(1)) << "above the fine patch";
  EXPECT_EQ(cut_layer(mesh, {2, 1}), 3) << "the domain's last face belongs to its last cells";
  EXPECT_THROW(cut_layer(mesh, {2, 1.01}), UsageError);
}

TEST(Overlay, LeafCellsAndRegionsOfAnOctreeAreTheSame) {
  const AmrHierarchy mesh = corner_mesh();
  BuildRequest request;
  request.needs = {Filter::nearest, Filtering::manual, true};
  const EncodedField octree = find_encoding("octree").build(mesh, request);
  EXPECT_THAT(mesh_boxes(mesh, "cells"), SizeIs(7 + 8));
  EXPECT_THAT(structure_boxes(mesh, octree, "regions"), SizeIs(7 + 8));
  EXPECT_THROW(structure_boxes(mesh, octree, "nodes"), UnsupportedError);
}

TEST(Overlay, ABoxSeenFromACornerHasThreeThinEdgesBehindNineOthers) {
  const AmrHierarchy mesh = corner_mesh();
  Scene scene = from_above(16);
  scene.view = verify::perspective({3, 2.5, 2}, {0.5, 0.5, 0.5});
  OverlaySpec overlay;
  const std::vector<Line> lines = seen_boxes(mesh, mesh_boxes(mesh, "domain"), scene, overlay);
  ASSERT_THAT(lines, SizeIs(12));
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(lines[i].width < overlay.line, i < 3);
}

TEST(Overlay, LinesLieWhereTheCameraSeesTheCorners) {
  const AmrHierarchy mesh = corner_mesh();
  OverlaySpec overlay;
  overlay.levels = {1};
  // from above, orthographic, the picture is the domain: the fine patch is its lower left quarter
  for (const Line& line : seen_boxes(mesh, mesh_boxes(mesh, "patches"), from_above(16), overlay))
    for (const Point& p : line.points) {
      EXPECT_TRUE(std::abs(p.x) < 1e-9 || std::abs(p.x - 0.5) < 1e-9) << p.x;
      EXPECT_TRUE(std::abs(p.y - 0.5) < 1e-9 || std::abs(p.y - 1) < 1e-9) << p.y;
    }
}

TEST(Overlay, WhatLiesBehindTheEyeIsCutOff) {
  const AmrHierarchy mesh = corner_mesh();
  Scene scene = from_above(16);
  scene.view = verify::perspective({0.5, 0.5, 0.5}, {1, 0.6, 0.5});  // inside of the domain
  for (const Line& line : seen_boxes(mesh, mesh_boxes(mesh, "domain"), scene, {}))
    for (const Point& p : line.points) EXPECT_TRUE(std::isfinite(p.x) && std::isfinite(p.y));
}

TEST(Overlay, NodesOfATreeAreTheDomainAndWhatItIsDividedInto) {
  const AmrHierarchy mesh = corner_mesh();
  BuildRequest request;
  request.needs = {.filter = Filter::linear_lod, .filtering = Filtering::manual, .draw_boxes = true};
  const std::vector<LevelBox> nodes = structure_boxes(mesh, find_encoding("kd_tree").build(mesh, request), "nodes");
  EXPECT_EQ(nodes.front().cells, mesh.domain(1));
  EXPECT_EQ(nodes.size() % 2, 1U) << "a binary tree of n leaves has 2 n - 1 nodes";
  std::int64_t halves = 0;
  for (const LevelBox& n : nodes) halves += n.level == 1 ? n.cells.cells() : 0;
  EXPECT_EQ(halves, mesh.domain(1).cells());
}

// ---- heat maps ----

TEST(HeatMap, ErrorsAreThoseOfTheChannelWhereTheyAreLargestWithTheirSign) {
  Picture picture(1, 1, 4), reference(1, 1, 4);
  picture.values = {0.5, 0.25, 0.5, 1};
  reference.values = {0.25, 0.75, 0.5, 1};
  EXPECT_EQ(error_picture(picture, reference).values, std::vector<double>{-0.5});
  EXPECT_EQ(around_zero(error_picture(picture, reference)), (std::array{-0.5, 0.5}));
}

TEST(HeatMap, UnknownNamesAreRefusedWithTheNearestOne) {
  EXPECT_EQ(heat_name(parse_heat("level")), "level");
  try {
    parse_heat("sample");
    FAIL();
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("did you mean 'samples'"), HasSubstr("samples, regions, level, error")));
  }
}

TEST(HeatMap, ThePixelsOfAnAxisParallelViewCountTheCellsBelowThem) {
  const AmrHierarchy mesh = corner_mesh();
  const auto context = make_context(parse_context("egl"));
  Scene scene = from_above(4);
  scene.view.height = 2;  // the domain is the middle half of the picture
  scene.settings.mode = Mode::projection;
  scene.settings.sampling = Sampling::adaptive;
  scene.settings.step = 0.5;
  scene.settings.skip = false;
  BuildRequest request;
  request.needs = {Filter::nearest, Filtering::manual, true};
  const Structure structure(*context, find_encoding("octree").build(mesh, request));
  Raycaster raycaster(*context, mesh, structure, scene);
  const std::vector<PixelWork> work = raycaster.count_pixels();
  // two samples a cell; below the fine patch's pixel lie one coarse cell and two fine ones, elsewhere two coarse ones
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) {
      const PixelWork& w = work[static_cast<std::size_t>(4 * y + x)];
      const bool inside = (x == 1 || x == 2) && (y == 1 || y == 2), fine = x == 1 && y == 2;
      EXPECT_EQ(w.met, inside);
      EXPECT_EQ(w.regions, !inside ? 0 : fine ? 3 : 2) << x << ' ' << y;
      EXPECT_EQ(w.samples, !inside ? 0 : fine ? 6 : 4) << x << ' ' << y;
      EXPECT_EQ(w.finest_level, !inside ? -1 : fine ? 1 : 0) << x << ' ' << y;
    }
  const WorkCounts sums = raycaster.count();
  EXPECT_EQ(sums.rays, 4);
  EXPECT_EQ(sums.samples, 6 + 3 * 4);
  EXPECT_EQ(sums.regions, 3 + 3 * 2);
}

}  // namespace
}  // namespace amrtex
