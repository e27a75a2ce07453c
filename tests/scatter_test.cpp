// Tables and diagrams of one quantity against others, from made-up records whose line is known.
#include "bench/report/scatter.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bench/records/record.hpp"
#include "structures/mesh/error.hpp"
#include "tests/table_files.hpp"

namespace amrtex {
namespace {

using test::cells;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr const char* kTables = R"json([{"title": "Figure 11", "notes": ["paper: another GPU"],
  "scatter": {"label": "frame (ms)", "value": "/frame/wall_ms",
              "against": [{"label": "samples a ray", "value": "/work/samples", "over": "/work/rays"},
                          {"label": "regions (1000)", "value": "/work/regions", "scale": 0.001}]}}])json";

/// A frame time and what a hundred rays did for it.
Json record(const std::string& dataset, const std::string& view, double wall_ms, int samples, int regions) {
  Json r = blank_record(Status::ok);
  r["experiment"] = "test";
  r["dataset"] = {{"name", dataset}, {"hash", dataset}, {"leaf_cells", 8}, {"stored_cells", 9},
                  {"levels", 2},     {"patches", 2},    {"field", "phi"}};
  r["encoding"] = "exabricks";
  r["build_parameters"] = Json::object();
  r["filter"] = "basis";
  r["storage"] = "r32f";
  r["filtering"] = "hardware";
  r["render"] = {{"mode", "dvr"}, {"view", {{"eye", view}}}, {"view_name", view}};
  r["work"] = {{"rays", 100}, {"samples", samples}, {"regions", regions}, {"regions_skipped", 0}};
  r["frame"] = {{"wall_ms", timing_json(std::vector<double>{wall_ms})}};
  r["context"] = {{"renderer", "llvmpipe"}};
  return r;
}

/// time = 2 + 3 samples a ray; regions are the same in all but one view of "many".
const std::vector<Json>& seven_views() {
  static const std::vector<Json> records = {record("few", "a", 5, 100, 7000),   record("few", "b", 8, 200, 7000),
                                            record("few", "c", 11, 300, 7000),  record("many", "a", 5, 100, 1000),
                                            record("many", "b", 11, 300, 1000), record("many", "c", 8, 200, 4000),
                                            record("lone", "a", 1, 100, 1)};
  return records;
}

class ScatterTest : public test::TablesFileTest {
 protected:
  Scatter made(const std::vector<Json>& records, const std::string& tables = kTables) const {
    return make_scatter(tables_file(tables), records);
  }
};

TEST_F(ScatterTest, ShowsCorrelationAndLineOfEverySettingOverItsViews) {
  const Scatter result = made(seven_views());
  ASSERT_THAT(result.tables, SizeIs(1));
  const Table& table = result.tables[0];
  EXPECT_EQ(table.title, "Figure 11");
  EXPECT_THAT(cells(table, "dataset"), ElementsAre("few", "few", "many", "many"));
  EXPECT_THAT(cells(table, "against"), ElementsAre("samples a ray", "regions (1000)", "samples a ray", "regions (1000)"));
  EXPECT_THAT(cells(table, "mean"), ElementsAre("2", "7", "2", "2"));
  EXPECT_THAT(cells(table, "least"), ElementsAre("1", "7", "1", "1"));
  EXPECT_THAT(cells(table, "most"), ElementsAre("3", "7", "3", "4"));
  EXPECT_THAT(cells(table, "y_mean"), ElementsAre("8", "8", "8", "8"));
  EXPECT_THAT(cells(table, "correlation"), ElementsAre("1", "–", "1", "0")) << "equal regions have no line";
  EXPECT_THAT(cells(table, "slope"), ElementsAre("3", "–", "3", "0"));
  EXPECT_THAT(cells(table, "at_zero"), ElementsAre("2", "–", "2", "8"));
  EXPECT_THAT(table.notes, Contains("paper: another GPU"));
  EXPECT_THAT(table.notes, Contains("1 settings with fewer than three views are left out"));
  EXPECT_THAT(table.constants, Contains(testing::Pair("view", "3 views")));
}

TEST_F(ScatterTest, DrawsAPointAViewAndTheLine) {
  const Scatter result = made(seven_views());
  ASSERT_THAT(result.diagrams, SizeIs(2));
  EXPECT_EQ(result.diagrams[0].name, "scatter_few_exabricks");
  const Json s = result.diagrams[0].specification;
  EXPECT_EQ(s["$schema"], "https://vega.github.io/schema/vega-lite/v6.json");
  ASSERT_THAT(s["hconcat"], SizeIs(2));
  const Json& line = s["hconcat"][0]["layer"][0]["data"]["values"];
  const Json& points = s["hconcat"][0]["layer"][1]["data"]["values"];
  ASSERT_THAT(points, SizeIs(3));
  EXPECT_EQ(points[1]["view"], "b");
  EXPECT_EQ(points[1]["x"], 2);
  EXPECT_EQ(points[1]["y"], 8);
  ASSERT_THAT(line, SizeIs(2));
  EXPECT_NEAR(line[1]["x"].get<double>(), 3, 1e-12);
  EXPECT_NEAR(line[1]["y"].get<double>(), 11, 1e-12);
  EXPECT_THAT(s["hconcat"][1]["layer"][0]["data"]["values"], SizeIs(0)) << "all views pass as many regions";
}

TEST_F(ScatterTest, KeepsSettingsApartAndTakesThoseThatAreAskedFor) {
  std::vector<Json> records = seven_views();
  for (std::size_t i = 3; i < 6; ++i) {
    records.push_back(records[i]);
    records.back()["build_parameters"] = {{"locate", "cells"}};
  }
  EXPECT_THAT(made(records).diagrams, SizeIs(3));
  std::string tables = kTables;
  tables.replace(tables.find("\"against\""), 0, R"("where": {"/build_parameters/locate": "cells"}, )");
  const Scatter cells_only = made(records, tables);
  ASSERT_THAT(cells_only.diagrams, SizeIs(1));
  EXPECT_THAT(cells(cells_only.tables[0], "correlation"), ElementsAre("1", "0"));
}

TEST_F(ScatterTest, PassesOverViewsWithoutNumbers) {
  std::vector<Json> records = seven_views();
  records[0]["frame"] = nullptr;
  EXPECT_THAT(made(records).diagrams, SizeIs(1)) << "two views of few are left";
  records[3]["work"]["rays"] = 0;
  EXPECT_THAT(made(records).diagrams, SizeIs(0));
  EXPECT_THAT(made(records).tables, SizeIs(0));
}

TEST_F(ScatterTest, LeavesOtherEntriesAlone) {
  EXPECT_THAT(made(seven_views(), R"([{"title": "a paper's"}])").tables, SizeIs(0));
}

TEST_F(ScatterTest, RefusesABadQuestionWithFileLineAndKey) {
  struct Case {
    const char *scatter, *place, *says;
  };
  for (const Case& c : std::initializer_list<Case>{
           {R"({"value": "/frame/wall_ms", "against": []})", "scatter", "'label'"},
           {R"({"label": "t", "value": "/frames/wall_ms", "against": []})", "value:", "/frame"},
           {R"({"label": "t", "value": "/frame/wall_ms"})", "scatter", "'against'"},
           {R"({"label": "t", "value": "/frame/wall_ms", "against": []})", "against:", "empty"},
           {R"({"label": "t", "value": "/frame/wall_ms", "against": [{"label": "x", "value": "/work/x", "per": 1}]})",
            "per:", "over"},
           {R"({"label": "t", "value": "/frame/wall_ms", "scale": 0, "against": []})", "scale:", "above 0"}}) {
    try {
      made({}, fmt::format(R"([{{"title": "t", "scatter": {}}}])", c.scatter));
      FAIL() << c.scatter;
    } catch (const UsageError& e) {
      EXPECT_THAT(e.what(), testing::AllOf(HasSubstr("tables.json:1:"), HasSubstr(c.place), HasSubstr(c.says)));
    }
  }
}

}  // namespace
}  // namespace amrtex
