// What a report's page is made of; tests/report_page_test.py opens the page itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "bench/report/page/facts.hpp"
#include "bench/report/page/gallery.hpp"
#include "bench/report/page/page.hpp"
#include "bench/report/page/shared_parts.hpp"
#include "bench/report/page/shown_pictures.hpp"
#include "structures/mesh/error.hpp"
#include "tests/table_files.hpp"

namespace amrtex {
namespace {

using testing::AllOf;
using testing::ContainsRegex;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// What facts look at, of one scene.
Json measured(const std::string& encoding, double ms, std::int64_t bytes, double decibels) {
  Json r;
  r["status"] = "ok";
  r["experiment"] = "sizes";
  r["dataset"] = {{"name", "blobs"}, {"hash", "h"}, {"exact_hash", "e"}, {"field", "phi"}, {"leaf_cells", 4096}};
  r["encoding"] = encoding;
  r["build_parameters"] = Json::object();
  r["filter"] = "linear_vertex";
  r["storage"] = "r32f";
  r["filtering"] = "hardware";
  r["render"] = {{"mode", "dvr"}, {"step", 1.0}, {"view_name", "corner"}};
  r["memory"] = {{"total_bytes", bytes}, {"by_role", {{"payload", bytes}, {"duplicated", 0}, {"topology", 0}, {"padding", 0}}}};
  r["frame"] = {{"wall_ms", {{"median", ms}, {"mad", ms / 20}, {"ci95", {ms * 0.9, ms * 1.1}}, {"n", 3}}}};
  const double rmse = std::isinf(decibels) ? 0 : std::pow(10, -decibels / 20);
  r["error_common"] = {{"rmse", rmse}, {"psnr_db", std::isinf(decibels) ? Json() : Json(decibels)}, {"filter", "linear_vertex"}};
  r["context"] = test::context_of("llvmpipe");
  return r;
}

SceneFacts facts_of_all(const std::vector<Json>& records) {
  const std::vector<ComparedScene> scenes = compared_scenes(records, true);
  EXPECT_EQ(scenes.size(), 1u);
  return facts_of(scenes.at(0), true);
}

TEST(PageFacts, NameTheSmallestAndTheFastestThatIsExactEnough) {
  const SceneFacts facts = facts_of_all({measured("uniform", 4, 4 << 20, 65), measured("kd_tree", 9, 1 << 20, 35),
                                         measured("octree", 2, 2 << 20, 45), measured("exabricks", 80, 9 << 20, INFINITY)});
  EXPECT_EQ(facts.smallest, "The smallest is kd_tree: 1 MiB, 9 ms, 35.0 dB.");
  EXPECT_EQ(facts.fastest,
            "The fastest is at 40 dB octree (2 MiB, 2 ms, 45.0 dB); at 50 dB and 60 dB uniform (4 MiB, 4 ms, 65.0 dB).");
  EXPECT_THAT(facts.time_front, ElementsAre(2, 0, 3));
  EXPECT_THAT(facts.byte_front, ElementsAre(1, 2, 0, 3));
}

TEST(PageFacts, SayWhatIsNotReachedAndWhatWasNotMeasured) {
  EXPECT_EQ(facts_of_all({measured("uniform", 4, 4 << 20, 45)}).fastest,
            "The fastest is at 40 dB uniform (4 MiB, 4 ms, 45.0 dB); no setting reaches 50 dB or 60 dB.");
  EXPECT_EQ(facts_of_all({measured("uniform", 4, 4 << 20, 25)}).fastest, "No setting reaches 40 dB or 50 dB or 60 dB.");
  Json untimed = measured("uniform", 4, 4 << 20, 45);
  untimed["frame"] = nullptr;
  EXPECT_THAT(facts_of_all({untimed}).fastest, HasSubstr("Times were not measured"));
  Json unjudged = measured("uniform", 4, 4 << 20, 45);
  unjudged["error_common"] = nullptr;
  EXPECT_THAT(facts_of_all({unjudged}).fastest, HasSubstr("Errors were not measured"));
  Json failed = measured("uniform", 4, 4 << 20, 45);
  failed["status"] = "failed";
  EXPECT_EQ(facts_of_all({failed}).smallest, "Nothing was drawn, so nothing can be compared.");
}

TEST(PageFacts, TakeNoNumberThatIsNone) {
  Json bad = measured("octree", kNaN, 1, kNaN);
  bad["error_common"]["rmse"] = kNaN;
  const SceneFacts facts = facts_of_all({bad, measured("uniform", 4, 4 << 20, 45)});
  EXPECT_THAT(facts.time_front, ElementsAre(1));
  EXPECT_THAT(facts.fastest, HasSubstr("at 40 dB uniform"));
}

TEST(PageData, IsMadeOfNumbersThatAreNoneInEveryColumn) {
  const std::vector<Json> good = {measured("uniform", 4, 4 << 20, 45), measured("octree", 2, 1 << 20, 35)};
  const Json flat = good[1].flatten();
  for (const auto& [pointer, value] : flat.items())
    for (const Json& none : {Json(kNaN), Json(INFINITY), Json()}) {
      if (pointer == "/status" || pointer.starts_with("/context")) continue;
      ReportPart part;
      part.records = good;
      part.records[1][Json::json_pointer(pointer)] = none;
      const PageData page = page_data({part}, {.title = "t", .question = "", .conclusion = "", .picked = {}});
      const std::string text = page_html(page, Scripts::inside);
      EXPECT_THAT(text, AllOf(Not(HasSubstr(":nan")), HasSubstr("\"labels\""))) << pointer;
      for (const Plot& plot : report_plots(part.records))
        EXPECT_THAT(to_svg(plot), Not(ContainsRegex("=\"[^\"]*nan"))) << pointer << ": names may be anything, places may not";
    }
}

TEST(PageData, WantsRecords) {
  EXPECT_THROW(page_data({}, {.title = "t", .question = "", .conclusion = "", .picked = {}}), Error);
}

TEST(ScriptJson, EndsNoScript) {
  EXPECT_EQ(script_json({{"a", "</script><!--"}}), R"({"a":"\u003c/script>\u003c!--"})");
  EXPECT_EQ(Json::parse(script_json({{"a", "<&\"'\u2028"}}))["a"], "<&\"'\u2028");
  EXPECT_NO_THROW(script_json({{"a", "\xff no UTF-8"}}));
}

TEST(Templates, AreFilledOnce) {
  EXPECT_EQ(filled("a {{x}} b {{y}} {{none}}c {{", {{"x", "{{y}}"}, {"y", "2"}}), "a {{y}} b 2 c {{");
}

TEST(HtmlTables, EscapeEverything) {
  const std::string html = to_html({"<b>", {{"k\"", "v'"}}, {"n&"}, {{"c", "<i>", "", true}}, {{Cell("</td>")}, {Cell()}}});
  EXPECT_THAT(html, AllOf(HasSubstr("&lt;b&gt;"), HasSubstr("k&quot;: v&#39;"), HasSubstr("n&amp;"), HasSubstr("&lt;i&gt;"),
                          HasSubstr("&lt;/td&gt;"), HasSubstr("–")));
}

// --- shared parts ---

/// What the page's script does.
Json whole(const Json& value, const Json& parts) {
  if (value.is_object() && value.contains(kSharedPart)) return whole(parts[value[kSharedPart].get<std::size_t>()], parts);
  Json copy = value;
  if (value.is_structured())
    for (Json& child : copy) child = whole(child, parts);
  return copy;
}

TEST(SharedParts, PutTogetherAreTheRecords) {
  const std::vector<Json> records = {measured("uniform", 4, 1, 45), measured("octree", 2, 1, 35), measured("octree", 2, 1, 35)};
  std::vector<const Json*> list;
  std::size_t bytes = 0;
  for (const Json& r : records) {
    list.push_back(&r);
    bytes += r.dump().size();
  }
  const Json shared = share_parts(list);
  for (std::size_t i = 0; i < records.size(); ++i) EXPECT_EQ(whole(shared["records"][i], shared["parts"]), records[i]);
  EXPECT_LT(shared.dump().size(), bytes * 2 / 3);
}

// --- pictures ---

Picture picture_of(int width, int height, double value) {
  Picture p(width, height, 4);
  for (double& v : p.values) v = value;
  return p;
}

TEST(ShownPictures, HaveTheDifferenceOfTheChannelThatIsOffMost) {
  Picture difference = picture_of(2, 1, 0);
  difference.pixel(0, 0)[1] = -0.5;
  difference.pixel(0, 0)[2] = 0.25;
  const ShownPicture shown = shown_picture({picture_of(2, 1, 1), difference}, 64);
  EXPECT_EQ(shown.scale, 0.5);
  EXPECT_EQ(shown.largest, 0.5);
  EXPECT_THAT(shown.difference, ElementsAre(0, 127));
  EXPECT_EQ(shown.rgb.size(), 6u);
  EXPECT_EQ(shown.reference.size(), 6u);
}

TEST(ShownPictures, AreAveragedDownToASize) {
  const ShownPicture shown = shown_picture({picture_of(200, 100, 1), std::nullopt}, 64);
  EXPECT_EQ(shown.width, 50);
  EXPECT_EQ(shown.height, 25);
  EXPECT_TRUE(shown.difference.empty());
}

TEST(ShownPictures, TakeWhatIsNoNumber) {
  Picture difference = picture_of(2, 1, kNaN);
  const ShownPicture shown = shown_picture({picture_of(2, 1, kNaN), difference}, 64);
  EXPECT_THAT(shown.difference, ElementsAre(255, 255));
  EXPECT_THAT(picture_png(shown), testing::StartsWith("\x89PNG"));
  EXPECT_THAT(difference_png(shown), testing::StartsWith("\x89PNG"));
}

TEST(DataUris, AreBase64) {
  const auto digits = [](const std::string& bytes) {
    return data_uri(bytes).substr(std::string("data:image/png;base64,").size());
  };
  EXPECT_EQ(digits(""), "");
  EXPECT_EQ(digits("f"), "Zg==");
  EXPECT_EQ(digits("fo"), "Zm8=");
  EXPECT_EQ(digits("foobar"), "Zm9vYmFy");
  EXPECT_EQ(digits("\xff\xfe\xfd"), "//79");
}

// --- plots ---

TEST(Plots, LeaveOutWhatHasNoPlaceOnALogarithmicAxis) {
  Plot plot;
  plot.x = {"x", AxisKind::logarithmic, {}};
  plot.y = {"y", AxisKind::logarithmic, {}};
  plot.marks = {
      {1, 2, kNoValue, kNoValue, "", "", 0}, {0, 2, kNoValue, kNoValue, "", "", 1}, {kNaN, 1, kNoValue, kNoValue, "", "", 2}};
  const Json values = to_vega_lite(plot)["layer"][0]["data"]["values"];
  ASSERT_EQ(values.size(), 1u);
  EXPECT_EQ(values[0]["point"], 0);
  EXPECT_THAT(to_svg(plot), Not(HasSubstr("nan")));
  EXPECT_NO_THROW(to_svg(Plot{}));
}

TEST(LatexTexts, HaveNoLetterThatLatexDoesNot) {
  EXPECT_EQ(escape_latex("[a]*|\"é±中"), "{[}a{]}{*}\\textbar{}''é$\\pm${[}U+4E2D{]}");
}

}  // namespace
}  // namespace amrtex
