// Tables and diagrams of work-precision from made-up records whose answer can be seen.
#include "bench/report/work_precision.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bench/numbers/pareto.hpp"
#include "bench/records/record.hpp"
#include "structures/mesh/error.hpp"
#include "tests/table_files.hpp"

namespace amrtex {
namespace {

using test::cells;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// What differs between the records here: a setting, its time and its error.
struct Setting {
  std::string encoding;
  std::string storage;
  double step;
  double wall_ms;
  double db;  ///< PSNR against the common reference
};

Json record(const Setting& s, const std::string& view = "front") {
  Json r = blank_record(Status::ok);
  r["experiment"] = "test";
  r["dataset"] = {{"name", "shell"},   {"source", nullptr}, {"hash", "h"},  {"exact_hash", "e"}, {"leaf_cells", 8},
                  {"stored_cells", 9}, {"levels", 2},       {"patches", 2}, {"field", "phi"}};
  r["check_reason"] = "no reference of its own filter";
  r["encoding"] = s.encoding;
  r["build_parameters"] = Json::object();
  r["filter"] = "linear_vertex";
  r["storage"] = s.storage;
  r["filtering"] = "hardware";
  r["render"] = {{"consumer", "raycast"},
                 {"mode", "dvr"},
                 {"sampling", "adaptive"},
                 {"step", s.step},
                 {"integrator", "exponential_midpoint"},
                 {"width", 64},
                 {"height", 64},
                 {"view", {{"eye", view}}},
                 {"view_name", view},
                 {"transfer_function", Json::object()},
                 {"transfer_function_name", "ramp"}};
  r["memory"] = {{"total_bytes", 1 << 20},
                 {"by_role", {{"payload", 1 << 20}, {"duplicated", 0}, {"topology", 0}, {"padding", 0}}},
                 {"texels_by_texture", nullptr},
                 {"texels_per_cell", nullptr},
                 {"host_peak_bytes", nullptr}};
  const std::vector<double> samples = {s.wall_ms};
  r["frame"] = {{"wall_ms", timing_json(samples)}, {"gpu_ms", nullptr}, {"all_wall_ms", samples}};
  const double rmse = relative_rmse(s.db);
  r["error_common"] = error_json({.rmse = rmse, .max = 4 * rmse, .psnr_db = s.db, .mrse = 0}, "r");
  r["error_common"]["filter"] = "linear_vertex";
  r["error_common"]["p95"] = 2 * rmse;
  r["context"] = test::context_of("llvmpipe");
  validate_record(r);
  return r;
}

Json not_measured(Json r, Status status, const std::string& reason) {
  r["status"] = status_name(status);
  r["reason"] = reason;
  for (const char* key : {"memory", "frame", "error_common"}) r[key] = nullptr;
  validate_record(r);
  return r;
}

/// An exact picture: no number of decibels.
Json exact(Json r) {
  r["error_common"]["rmse"] = 0;
  r["error_common"]["psnr_db"] = nullptr;
  return r;
}

class WorkPrecisionTest : public test::TablesFileTest {
 protected:
  WorkPrecision made(const std::vector<Json>& records, const std::string& tables = R"([{"work_precision": {}}])") const {
    return make_work_precision(tables_file(tables), records);
  }
};

const std::vector<Json>& four_settings() {
  static const std::vector<Json> records = {record({"uniform", "r32f", 1, 8, 45}), record({"uniform", "r32f", 0.25, 30, 65}),
                                            record({"kd_tree", "r32f", 1, 4, 45}), record({"kd_tree", "r8", 1, 3, 35}),
                                            record({"kd_tree", "r32f", 0.25, 40, 65})};
  return records;
}

TEST_F(WorkPrecisionTest, NamesTheFastestSettingForEachErrorAndWhatADenseOneTakes) {
  // dense: 8 ms reach 30 and 40 dB, 30 ms reach 50 and 60 dB
  const WorkPrecision result = made(four_settings());
  ASSERT_THAT(result.tables, SizeIs(3));
  const Table& table = result.tables[0];
  EXPECT_EQ(table.title, "work-precision: the fastest setting, shell, front, ramp, dvr");
  EXPECT_THAT(cells(table, "asked"), ElementsAre("30 dB", "40 dB", "50 dB", "60 dB"));
  EXPECT_THAT(cells(table, "encoding"), ElementsAre("kd_tree", "kd_tree", "uniform", "uniform"));
  EXPECT_THAT(cells(table, "storage"), ElementsAre("r8", "r32f", "r32f", "r32f"));
  EXPECT_THAT(cells(table, "step"), ElementsAre("1", "1", "0.25", "0.25"));
  EXPECT_THAT(cells(table, "over_dense"), ElementsAre("0.375", "0.5", "1", "1"));
  EXPECT_THAT(table.notes, Contains(HasSubstr("reference of linear_vertex")));
}

TEST_F(WorkPrecisionTest, KeepsARowForAnErrorThatNothingReaches) {
  const WorkPrecision result = made(four_settings(), R"([{"work_precision": {"reach": [60, 70]}}])");
  EXPECT_THAT(cells(result.tables[0], "encoding"), ElementsAre("uniform", "–"));
  EXPECT_THAT(result.tables[0].notes, Contains("no setting reaches 70 dB"));
}

TEST_F(WorkPrecisionTest, ReachesTolerancesOfNinetyFivePercentOfThePixels) {
  // p95 is twice the rmse here: 2 * 10^(-45/20) = 0.0112, 2 * 10^(-65/20) = 0.0011
  const WorkPrecision result = made(four_settings(), R"([{"work_precision": {"reach": [30], "reach_p95": [0.012, 0.011]}}])");
  EXPECT_THAT(cells(result.tables[0], "wall"), ElementsAre("3 ± 0", "4 ± 0", "30 ± 0"));
}

TEST_F(WorkPrecisionTest, ShowsTheFrontInTheOrderOfTime) {
  const Table table = made(four_settings()).tables[1];
  EXPECT_THAT(cells(table, "wall"), ElementsAre("3 ± 0", "4 ± 0", "30 ± 0"));
  EXPECT_THAT(table.notes, Contains("3 of 5 points"));
}

TEST_F(WorkPrecisionTest, ShowsWhatEachEncodingNeedsForEachError) {
  const Table table = made(four_settings()).tables[2];
  EXPECT_THAT(cells(table, "encoding"), ElementsAre("kd_tree", "uniform"));
  EXPECT_THAT(cells(table, "30 dB"), ElementsAre("3", "8"));
  EXPECT_THAT(cells(table, "40 dB"), ElementsAre("4", "8"));
  EXPECT_THAT(cells(table, "60 dB"), ElementsAre("40", "30"));
  const Table beyond = made(four_settings(), R"([{"work_precision": {"reach": [70]}}])").tables[2];
  EXPECT_THAT(cells(beyond, "70 dB"), ElementsAre("–", "–"));
}

TEST_F(WorkPrecisionTest, ShowsTheFastestSettingOfEachEncodingWhereItIsAskedFor) {
  const WorkPrecision result = made(four_settings(), R"([{"work_precision": {"each_at": [30, 70]}}])");
  ASSERT_THAT(result.tables, SizeIs(5));
  const Table& at_30 = result.tables[3];
  EXPECT_EQ(at_30.title, "work-precision: the fastest setting of each encoding at 30 dB, shell, front, ramp, dvr");
  EXPECT_THAT(cells(at_30, "encoding"), ElementsAre("uniform", "kd_tree")) << "in the order of all tables";
  EXPECT_THAT(cells(at_30, "storage"), ElementsAre("r32f", "r8"));
  EXPECT_THAT(cells(at_30, "wall"), ElementsAre("8 ± 0", "3 ± 0"));
  EXPECT_THAT(result.tables[4].rows, IsEmpty());
  EXPECT_THAT(result.tables[4].notes, Contains("no setting of kd_tree reaches 70 dB"));
}

TEST_F(WorkPrecisionTest, CountsAnExactPictureAsReachingEverything) {
  const WorkPrecision result = made({exact(record({"uniform", "r32f", 1, 8, 45}))});
  EXPECT_THAT(cells(result.tables[0], "encoding"), ElementsAre("uniform", "uniform", "uniform", "uniform"));
  const Json point = result.diagrams[0].specification["vconcat"][0]["data"]["values"][0];
  EXPECT_EQ(point["error"], 0);
  EXPECT_GT(point["drawn"].get<double>(), 0) << "a logarithmic axis has no 0";
}

TEST_F(WorkPrecisionTest, KeepsScenesApart) {
  const WorkPrecision result =
      made({record({"uniform", "r32f", 1, 8, 45}, "front"), record({"uniform", "r32f", 1, 1, 45}, "side")});
  ASSERT_THAT(result.diagrams, SizeIs(2));
  EXPECT_EQ(result.diagrams[0].name, "work_precision_shell_front_ramp_dvr");
  EXPECT_EQ(result.diagrams[1].name, "work_precision_shell_side_ramp_dvr");
  EXPECT_THAT(cells(result.tables[0], "wall"), Contains("8 ± 0"));
}

TEST_F(WorkPrecisionTest, KeepsFiltersApartWhereErrorsAreTheirOwn) {
  std::vector<Json> records = {record({"uniform", "r32f", 1, 8, 45}), record({"uniform", "r32f", 1, 4, 45})};
  records[1]["filter"] = "linear_page";
  EXPECT_THAT(made(records).diagrams, SizeIs(1)) << "against one reference they compete";
  for (Json& r : records) std::swap(r["error"], r["error_common"]);
  for (Json& r : records) r["error"]["split"] = nullptr;
  const WorkPrecision own = made(records, R"([{"work_precision": {"error": "own"}}])");
  ASSERT_THAT(own.diagrams, SizeIs(2));
  EXPECT_EQ(own.diagrams[0].name, "work_precision_shell_front_ramp_dvr_linear_page");
  EXPECT_THAT(cells(own.tables[0], "wall"), Contains("4 ± 0"));
}

TEST_F(WorkPrecisionTest, KeepsWhatWasNotMeasuredInSight) {
  std::vector<Json> records = four_settings();
  for (const double step : {1.0, 0.5})
    records.push_back(not_measured(record({"octree", "r32f", step, 1, 0}), Status::unsupported, "no such filter"));
  records.push_back(not_measured(record({"kd_tree", "r16", 1, 1, 0}), Status::failed, "wrong picture"));
  const WorkPrecision result = made(records);
  ASSERT_THAT(result.tables, SizeIs(4));
  EXPECT_THAT(cells(result.tables[3], "encoding"), ElementsAre("kd_tree", "octree"));
  EXPECT_THAT(cells(result.tables[3], "reason"), ElementsAre("wrong picture", "no such filter"));
  EXPECT_THAT(cells(result.tables[3], "points"), ElementsAre("1", "2"));
  const Json plots = result.diagrams[0].specification["vconcat"];
  EXPECT_THAT(plots[0]["data"]["values"], SizeIs(5));
  EXPECT_THAT(plots[1].dump(), HasSubstr("2 x octree unsupported: no such filter"));
}

TEST_F(WorkPrecisionTest, DrawsPointsAndFrontOnLogarithmicAxes) {
  const Json s = made(four_settings()).diagrams[0].specification;
  EXPECT_EQ(s["$schema"], "https://vega.github.io/schema/vega-lite/v6.json");
  const Json& plot = s["vconcat"][0];
  ASSERT_THAT(plot["layer"], SizeIs(2));
  for (const Json& layer : plot["layer"])
    for (const char* axis : {"x", "y"}) {
      EXPECT_EQ(layer["encoding"][axis]["scale"]["type"], "log");
      EXPECT_TRUE(plot["data"]["values"][0].contains(layer["encoding"][axis]["field"].get<std::string>()));
    }
  EXPECT_EQ(plot["layer"][1]["encoding"]["color"]["field"], "structure");
  int on_front = 0;
  for (const Json& point : plot["data"]["values"]) on_front += point["front"].get<bool>() ? 1 : 0;
  EXPECT_EQ(on_front, 3);
}

TEST_F(WorkPrecisionTest, LeavesOtherEntriesAlone) {
  EXPECT_THAT(made(four_settings(), R"([{"title": "a paper's"}])").tables, SizeIs(0));
}

TEST_F(WorkPrecisionTest, RefusesABadQuestionWithFileLineAndKey) {
  struct Case {
    const char *entry, *place, *says;
  };
  for (const Case& c : std::initializer_list<Case>{{R"({"work_precision": {"reach": "much"}})", "reach:", "number"},
                                                   {R"({"work_precision": {"reach": [-1]}})", "reach[0]:", "0"},
                                                   {R"({"work_precision": {"reached": 1}})", "reached:", "did you mean 'reach'?"},
                                                   {R"({"work_precision": {"error": "both"}})", "error:", "common, own"},
                                                   {R"({"work_precision": {}, "rows": []})", "rows:", "title"}}) {
    try {
      made({}, fmt::format("[{}]", c.entry));
      FAIL() << c.entry;
    } catch (const UsageError& e) {
      EXPECT_THAT(e.what(), testing::AllOf(HasSubstr("tables.json:1:"), HasSubstr(c.place), HasSubstr(c.says)));
    }
  }
}

}  // namespace
}  // namespace amrtex
