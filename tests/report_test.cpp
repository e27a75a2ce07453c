#include "bench/report/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "bench/records/record.hpp"
#include "bench/report/paper_tables.hpp"
#include "structures/mesh/error.hpp"
#include "tests/table_files.hpp"

namespace amrtex {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr std::int64_t kMebibyte = 1 << 20;

/// A measured record of 1 MiB payload and 2 ms a frame, to be changed.
Json record(const std::string& encoding, double wall_ms) {
  Json r = blank_record(Status::ok);
  r["experiment"] = "sizes";
  r["dataset"] = {{"name", "blobs_&_shell"}, {"source", nullptr}, {"hash", "h1"},  {"exact_hash", "e1"}, {"leaf_cells", 1000},
                  {"stored_cells", 1100},    {"levels", 3},       {"patches", 10}, {"field", "phi"}};
  r["check"] = {{"psnr_db", 48.5}, {"from", "default"}, {"why", nullptr}};
  r["encoding"] = encoding;
  r["build_parameters"] = Json::object();
  r["filter"] = "linear_page";
  r["storage"] = "r32f";
  r["filtering"] = "hardware";
  r["render"] = {{"consumer", "raycast"},  {"mode", "dvr"},
                 {"sampling", "adaptive"}, {"step", 1.0},
                 {"integrator", "i"},      {"width", 64},
                 {"height", 32},           {"view", Json::object()},
                 {"view_name", "view 1"},  {"transfer_function", Json::object()}};
  r["memory"] = {
      {"total_bytes", 2 * kMebibyte},
      {"by_role", {{"payload", kMebibyte}, {"duplicated", kMebibyte / 2}, {"topology", kMebibyte / 2}, {"padding", 0}}},
      {"texels_by_texture", nullptr},
      {"texels_per_cell", 1.25},
      {"host_peak_bytes", nullptr}};
  r["build_seconds"] = 0.125;
  const std::vector<double> samples = {wall_ms - 0.5, wall_ms, wall_ms + 0.5};
  r["frame"] = {{"wall_ms", timing_json(samples)}, {"gpu_ms", nullptr}, {"all_wall_ms", samples}};
  r["work"] = {{"rays", 2048}, {"samples", 123456}, {"regions", 789}, {"regions_skipped", 1}};
  r["error"] = error_json({.rmse = 0, .max = 0, .psnr_db = std::nullopt, .mrse = 0}, "r");
  for (const char* key : {"split", "reference_error", "limited_by_reference", "within_tolerance_seen"}) r["error"][key] = nullptr;
  r["error_common"] = error_json({.rmse = 1.25e-7, .max = 1, .psnr_db = 42.5, .mrse = 0}, "r");
  r["error_common"]["filter"] = "linear_vertex";
  r["context"] = test::context_of("llvmpipe");
  validate_record(r);
  return r;
}

Json page_table(int page_size, double wall_ms) {
  Json r = record("page_table", wall_ms);
  r["build_parameters"] = {{"page_size", page_size}, {"centring", "cell"}};
  return r;
}

Json not_measured(Json r, Status status, const std::string& reason) {
  r["status"] = status_name(status);
  r["reason"] = reason;
  for (const char* key : {"memory", "build_seconds", "frame", "work", "error", "error_common"}) r[key] = nullptr;
  validate_record(r);
  return r;
}

std::vector<Json> sizes() {
  return {page_table(16, 3), not_measured(page_table(4, 1), Status::unsupported, "needs <x> & 50% more_bits"), page_table(8, 4),
          record("uniform", 2)};
}

std::vector<std::string> keys(const Table& table) {
  std::vector<std::string> list;
  for (const Column& column : table.columns) list.push_back(column.key);
  return list;
}

std::vector<std::string> cells(const Table& table, const std::string& key) {
  const auto all = keys(table);
  const auto column = std::find(all.begin(), all.end(), key);
  if (column == all.end()) return {"no such column"};
  std::vector<std::string> list;
  for (const auto& row : table.rows) list.push_back(format_cell(row[static_cast<std::size_t>(column - all.begin())]));
  return list;
}

Table only_table(const std::vector<Json>& records, const ReportOptions& options = {}) {
  const auto tables = make_tables(records, options);
  EXPECT_EQ(tables.size(), 1u);
  return tables.at(0);
}

TEST(Tables, ShowWhatVariesAndSayTheRestOnce) {
  const Table table = only_table(sizes());
  EXPECT_THAT(keys(table), ElementsAre("encoding", "total", "payload", "duplicated", "topology", "padding", "texels_per_cell",
                                       "build", "wall", "relative", "samples", "regions", "rmse", "psnr_common", "status"));
  EXPECT_THAT(cells(table, "encoding"),
              ElementsAre("uniform", "page_table (page_size 4)", "page_table (page_size 8)", "page_table (page_size 16)"));
  EXPECT_THAT(table.constants, testing::IsSupersetOf({std::pair<std::string, std::string>("renderer", "llvmpipe"),
                                                      {"filter", "linear_page"},
                                                      {"picture (pixels)", "64 x 32"},
                                                      {"page_table", "centring cell"}}));
  EXPECT_THAT(table.notes, ElementsAre("no values: frame GPU (ms), draws in a GPU query (above 1: throughput), PSNR (dB)", "of 4 points: 3 ok, 1 unsupported"));
}

Json unchecked(Json r) {
  r["check"] = nullptr;
  r["check_reason"] = "no reference";
  validate_record(r);
  return r;
}

TEST(Tables, MarkRowsWhosePictureWasNotChecked) {
  std::vector<Json> records = {record("uniform", 2), unchecked(page_table(8, 4)),
                               not_measured(page_table(4, 1), Status::failed, "no")};
  for (const ReportOptions& options : {ReportOptions{}, ReportOptions{{{"sizes", {"encoding", "wall"}}}}}) {
    const Table table = only_table(records, options);
    EXPECT_THAT(cells(table, "check"), ElementsAre("48.5 dB (default)", "48.5 dB (default)", "unchecked"));
    EXPECT_THAT(table.notes, testing::Contains("unchecked, 1 of 3 points: no reference"));
  }
  records.erase(records.begin() + 1);
  EXPECT_THAT(keys(only_table(records)), Not(testing::Contains("check")));
}

TEST(Tables, KeepRowsThatWereNotMeasuredWithTheirReason) {
  const Table table = only_table(sizes());
  EXPECT_EQ(cells(table, "status")[1], "unsupported: needs <x> & 50% more_bits");
  EXPECT_EQ(cells(table, "total")[1], "–");
  EXPECT_EQ(cells(table, "wall")[1], "–");
  EXPECT_EQ(cells(table, "relative")[1], "–");
}

TEST(Tables, AnErrorOfZeroIsANumber) { EXPECT_EQ(cells(only_table(sizes()), "rmse")[0], "0"); }

TEST(Tables, TimesAreRelativeToUniformOfTheSameScene) {
  std::vector<Json> records = sizes();
  EXPECT_THAT(cells(only_table(records), "relative"), ElementsAre("1", "–", "2", "1.5"));
  records[0]["render"]["step"] = 0.5;  // uniform has no record of this scene
  EXPECT_THAT(cells(only_table(records), "relative"), ElementsAre("1", "–", "2", "–"));
}

TEST(Tables, TheBaselineHasTheSameFilterWhereThereIsOne) {
  Json nearest = record("uniform", 1), linear = record("uniform", 2), lod = page_table(16, 8), flat = page_table(16, 8);
  nearest["filter"] = flat["filter"] = "nearest";
  lod["filter"] = "linear_lod";
  const Table table = only_table({nearest, linear, lod, flat});
  EXPECT_THAT(cells(table, "filter"), ElementsAre("nearest", "linear_page", "nearest", "linear_lod"));
  EXPECT_THAT(cells(table, "relative"), ElementsAre("1", "1", "8", "4"));
}

TEST(Tables, DoNotDependOnTheOrderOfRecords) {
  std::vector<Json> records = sizes();
  const std::string first = to_markdown(only_table(records));
  std::sort(records.begin(), records.end());
  do EXPECT_EQ(to_markdown(only_table(records)), first);
  while (std::next_permutation(records.begin(), records.end()));
}

TEST(Tables, NeverMixRenderersOrExperiments) {
  std::vector<Json> records = sizes();
  records[0]["context"]["renderer"] = "Some GPU";
  records[1]["experiment"] = "another";
  records[2]["context"] = nullptr;
  const auto tables = make_tables(records);
  ASSERT_EQ(tables.size(), 4u);
  EXPECT_EQ(tables[0].title, "another");
  EXPECT_EQ(tables[1].constants[0].second, "Some GPU");
  EXPECT_EQ(tables[2].constants[0].second, "llvmpipe");
  EXPECT_EQ(tables[3].constants[0].second, "none");
}

TEST(Tables, MaySayWhichColumns) {
  const Table table = only_table(sizes(), {{{"sizes", {"status", "encoding", "max_error"}}}});
  EXPECT_THAT(keys(table), ElementsAre("status", "encoding", "max_error"));
  EXPECT_THROW(make_tables(sizes(), {{{"sizes", {"colour"}}}}), UsageError);
}

TEST(Tables, StandRecordsThatHoldNothing) {
  const Table table = only_table({blank_record(Status::failed, "no context")});
  EXPECT_THAT(cells(table, "status"), ElementsAre("failed: no context"));
  EXPECT_THAT(to_markdown(table), HasSubstr("failed: no context"));
  EXPECT_TRUE(make_tables(std::vector<Json>{}).empty());
}

TEST(Markdown, HasARowForEveryRecord) {
  const std::string text = to_markdown(only_table(sizes()));
  EXPECT_THAT(text, HasSubstr("### sizes\n"));
  EXPECT_THAT(
      text,
      HasSubstr(
          "| page_table (page_size 8) | 2 | 1 | 0.5 | 0.5 | 0 | 1.25 | 0.125 | 4 ± 0.5 | 2 | 123456 | 789 | 0 | 42.5 | ok |"));
  EXPECT_THAT(text, HasSubstr("needs \\<x> & 50% more_bits"));
  EXPECT_THAT(text, HasSubstr("| --- | ---: |"));
}

TEST(Csv, KeepsEveryDigitAndStandsAlone) {
  std::vector<Json> records = {record("uniform", 2)};
  records[0]["error"]["rmse"] = 0.1 + 0.2;
  records[0]["dataset"]["name"] = "a,\"b\"";
  const std::string text = to_csv(only_table(records));
  const std::string header = text.substr(0, text.find('\n'));
  EXPECT_THAT(header, testing::StartsWith("renderer,dataset,field,"));
  EXPECT_THAT(header, HasSubstr("wall,wall_mad,"));
  EXPECT_THAT(text, HasSubstr("0.30000000000000004"));
  EXPECT_THAT(text, HasSubstr("\"a,\"\"b\"\"\""));
  EXPECT_THAT(to_csv(only_table(sizes())), HasSubstr("page_table (page_size 4),,,,,,,,,,"));
}

TEST(Latex, EscapesWhatTexTakesForItself) {
  EXPECT_EQ(
      escape_latex("a_b & 50% #1 ${x}$ ~ ^ \\ <y>"),
      "a\\_b \\& 50\\% \\#1 \\$\\{x\\}\\$ \\textasciitilde{} \\textasciicircum{} \\textbackslash{} \\textless{}y\\textgreater{}");
  const std::string text = to_latex(only_table(sizes()));
  EXPECT_THAT(text, HasSubstr("\\toprule"));
  EXPECT_THAT(text, HasSubstr("blobs\\_\\&\\_shell"));
  EXPECT_THAT(text, HasSubstr("needs \\textless{}x\\textgreater{} \\& 50\\% more\\_bits"));
  EXPECT_THAT(text, HasSubstr("4 $\\pm$ 0.5"));
  EXPECT_THAT(text, Not(HasSubstr("–")));
  EXPECT_THAT(text, Not(HasSubstr("±")));
}

TEST(Latex, WritesPowersOfTen) {
  const Table table = only_table({record("uniform", 2)}, {{{"sizes", {"encoding", "rmse_common"}}}});
  EXPECT_THAT(to_latex(table), HasSubstr("uniform & $1.25\\cdot10^{-7}$ \\\\"));
}

TEST(FormatNumber, HasFourDigitsAndFewExponents) {
  EXPECT_EQ(format_number(0), "0");
  EXPECT_EQ(format_number(1), "1");
  EXPECT_EQ(format_number(0.0123456), "0.01235");
  EXPECT_EQ(format_number(1234.56), "1235");
  EXPECT_EQ(format_number(123456.7), "123457");
  EXPECT_EQ(format_number(9999.9), "10000");
  EXPECT_EQ(format_number(0.00099), "9.90e-04");
  EXPECT_EQ(format_number(-1.5e9), "-1.50e+09");
}

TEST(ReadColumns, NamesFileAndKnownKeys) {
  const auto path = std::filesystem::temp_directory_path() / ("amrtex_columns_" + std::to_string(::getpid()) + ".json");
  std::ofstream(path) << R"(["encoding", "wall"])";
  EXPECT_THAT(read_columns(path), ElementsAre("encoding", "wall"));
  std::ofstream(path) << "[\"encoding\",\n \"psrn\"]";
  try {
    read_columns(path);
    FAIL() << "an unknown column was accepted";
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), testing::AllOf(HasSubstr(path.string() + ":2:"), HasSubstr("did you mean 'psnr'?"),
                                         HasSubstr("texels_per_cell")));
  }
  std::filesystem::remove(path);
}

// --- tables beside a paper ---

/// Writes a tables.json and makes its tables.
class PaperTables : public testing::Test {
 protected:
  ~PaperTables() override { std::filesystem::remove(path_); }

  std::vector<Table> tables(const std::string& text, const std::vector<Json>& records) const {
    std::ofstream(path_) << text;
    return make_paper_tables(path_, records);
  }
  /// The rows of one table as text, of the data set of `record`.
  std::vector<std::vector<std::string>> rows(const std::string& rows, const std::vector<Json>& records) {
    const auto all = tables(R"({"title": "Table 2", "datasets": "blobs_&_shell", "rows": )" + rows + "}", records);
    EXPECT_EQ(all.size(), 1u);
    notes_ = all.at(0).notes;
    std::vector<std::vector<std::string>> list;
    for (const auto& row : all.at(0).rows) {
      list.emplace_back();
      for (const Cell& cell : row) list.back().push_back(format_cell(cell));
    }
    return list;
  }
  std::string complaint(const std::string& text, const std::vector<Json>& records = {}) const {
    try {
      tables(text, records);
    } catch (const UsageError& e) {
      const std::string what = e.what();
      return what.starts_with(path_.string()) ? what.substr(path_.string().size()) : "without the file: " + what;
    }
    return "accepted";
  }

  const std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / ("amrtex_tables_" + std::to_string(::getpid()) + ".json");
  std::vector<std::string> notes_;
};

TEST_F(PaperTables, SetTheirNumbersBesideOurs) {
  const std::vector<Json> records = {record("uniform", 4), page_table(8, 2)};
  EXPECT_THAT(rows(R"j([{"label": "payload (MB)", "where": {"/encoding": "uniform"}, "value": "/memory/by_role/payload",
                        "scale": 1e-6, "paper": 10.89
},
                       {"label": "frames/s", "where": {"/encoding": "uniform"}, "value": "/frame/wall_ms/median",
                        "inverse": true, "scale": 1000, "paper": [120]},
                       {"label": "borders and tables", "where": {"/encoding": "page_table"},
                        "value": ["/memory/by_role/duplicated", "/memory/by_role/topology"], "paper": ["> 1 GB"]},
                       {"label": "frame (ms)", "where": {"/encoding": "uniform"}, "value": "/frame/wall_ms"}])j",
                   records),
              ElementsAre(ElementsAre("payload (MB)", "1.049", "10.89"), ElementsAre("frames/s", "250", "120"),
                          ElementsAre("borders and tables", "1048576", "> 1 GB"), ElementsAre("frame (ms)", "4 ± 0.5", "–")));
  EXPECT_THAT(notes_, ElementsAre());
}

TEST_F(PaperTables, DivideOneRecordByAnother) {
  const auto ratio = [&](const std::string& rest) {
    return rows(R"([{"label": "a", "where": {"/encoding": "page_table"}, "value": "/frame/wall_ms/median", )" + rest + "}]",
                {record("uniform", 4), page_table(8, 2)})[0][1];
  };
  EXPECT_EQ(ratio(R"("inverse": true, "over": {"where": {"/encoding": "uniform"}})"), "2");
  EXPECT_EQ(ratio(R"("scale": 100, "over": {"where": {"/encoding": "uniform"}})"), "50");
  EXPECT_EQ(ratio(R"("over": {"where": {"/encoding": "page_table"}, "value": "/work/rays"})"), "9.77e-04");
  EXPECT_EQ(ratio(R"("over": {"where": {"/encoding": "uniform"}, "value": "/build_parameters/page_size"})"), "–");
  EXPECT_THAT(notes_, ElementsAre("over: no value at /build_parameters/page_size: a of blobs_&_shell"));
  EXPECT_EQ(ratio(R"("over": {"where": {"/encoding": "uniform"}, "value": "/error/rmse"})"), "–") << "a division by 0";
}

TEST_F(PaperTables, SpeedsSpreadAsTheirTimesDo) {
  const auto table =
      rows(R"([{"label": "frames/s", "value": "/frame/wall_ms", "inverse": true, "scale": 1000}])", {record("uniform", 10)});
  EXPECT_EQ(table[0][1], "100 ± 5");
}

TEST_F(PaperTables, ConditionsAreValuesOrListsOfThem) {
  Json iso = record("uniform", 1);
  iso["render"]["isovalues"] = {0.5, 1};
  const auto found = [&](const std::string& where) {
    return rows(R"([{"label": "a", "value": "/frame/wall_ms/median", "where": )" + where + "}]", {iso, page_table(8, 2)})[0][1];
  };
  EXPECT_EQ(found(R"({"/encoding": ["page_table", "octree"], "/build_parameters": {"centring": "cell", "page_size": 8.0}})"),
            "2");
  EXPECT_EQ(found(R"({"/render/isovalues": [0.5, 1.0]})"), "1");
  EXPECT_EQ(found(R"({"/render/isovalues": [[0.5], [0.5, 1]]})"), "1");
  EXPECT_EQ(found(R"({"/render/isovalues": null})"), "2");
  EXPECT_EQ(found(R"({"/render/isovalues": 0.5})"), "–");
}

TEST_F(PaperTables, DataSetsAreColumnsAndThePaperMayHaveFewer) {
  Json other = record("uniform", 3);
  other["dataset"]["name"] = "own";
  const std::string text = R"([{"title": "T", "notes": ["their GPU"], "datasets": ["own", "blobs_&_shell", "absent"],
      "where": {"/encoding": "uniform"},
      "rows": [{"label": "ms", "value": "/frame/wall_ms/median", "paper": [1.5]},
               {"label": "of own", "where": {"/dataset/name": "own"}, "value": "/frame/wall_ms/median"},
               {"label": "pages", "where": {"/encoding": "page_table"}, "value": "/statistics/pages", "paper": [null, null, null]}]}])";
  const Table table = tables(text, {other, record("uniform", 2), page_table(8, 9)}).at(0);
  EXPECT_THAT(keys(table), ElementsAre("row", "own_ours", "own_paper", "blobs_&_shell_ours", "absent_ours"));
  EXPECT_THAT(cells(table, "own_ours"), ElementsAre("3", "3", "–"));
  EXPECT_THAT(cells(table, "own_paper"), ElementsAre("1.5", "–", "–"));
  EXPECT_THAT(cells(table, "blobs_&_shell_ours"), ElementsAre("2", "3", "–"));
  EXPECT_THAT(cells(table, "absent_ours"), ElementsAre("–", "3", "–"));
  EXPECT_THAT(table.notes, ElementsAre("their GPU", "no record: pages of own; ms of absent; pages of absent",
                                       "no value at /statistics/pages: pages of blobs_&_shell"));
  EXPECT_THAT(to_latex(table), HasSubstr("quantity & own, ours & own, paper & blobs\\_\\&\\_shell, ours & absent, ours"));
}

TEST_F(PaperTables, ShowTheStatusOfWhatWasNotMeasured) {
  const Json over = not_measured(page_table(4, 1), Status::over_budget, "too big");
  const Json failed = not_measured(page_table(8, 1), Status::failed, "picture");
  const std::string row = R"([{"label": "a", "value": "/frame/wall_ms/median", "where": {"/encoding": "page_table"}}])";
  EXPECT_EQ(rows(row, {over, failed})[0][1], "failed, over_budget");
  EXPECT_EQ(rows(row, {over, page_table(16, 3)})[0][1], "3");
  EXPECT_THAT(notes_, ElementsAre("other records are over_budget: a of blobs_&_shell"));
  EXPECT_EQ(rows(R"([{"label": "a", "value": "/frame/wall_ms/median", "where": {"/encoding": "uniform"},
                      "over": {"where": {"/encoding": "page_table"}}}])",
                 {record("uniform", 2), failed})[0][1],
            "over: failed");
}

TEST_F(PaperTables, ARowOfSeveralValuesIsAnError) {
  const std::string text = R"([{"title": "T", "datasets": "blobs_&_shell", "rows": [
    {"label": "memory", "value": "/memory/total_bytes"},
    {"label": "time", "value": "/frame/wall_ms/median"}]}])";
  Json again = page_table(8, 3);
  again["render"]["view"] = {{"eye", {1, 2, 3}}};
  again["render"]["view_name"] = "view 2";
  EXPECT_EQ(complaint(text, {page_table(8, 3), again}), "accepted");
  EXPECT_EQ(complaint(text, {page_table(8, 2), again, page_table(16, 3)}),
            ":3: [0].rows[1]: row 'time', data set 'blobs_&_shell': 3 records with different values match; they differ in: "
            "/build_parameters/page_size, /render/view_name");
}

TEST_F(PaperTables, NeverMixRenderers) {
  std::vector<Json> records = {record("uniform", 2), record("uniform", 3)};
  records[0]["context"]["renderer"] = "Some GPU";
  const auto all = tables(
      R"({"title": "T", "datasets": "blobs_&_shell", "rows": {"label": "ms", "value": "/frame/wall_ms/median"}})", records);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_THAT(all[0].constants, ElementsAre(std::pair<std::string, std::string>("renderer", "Some GPU")));
  EXPECT_THAT(cells(all[0], "blobs_&_shell_ours"), ElementsAre("2"));
  EXPECT_THAT(cells(all[1], "blobs_&_shell_ours"), ElementsAre("3"));
}

TEST_F(PaperTables, ErrorsNameLineKeyAndWhatIsAccepted) {
  const auto of_row = [&](const std::string& row) {
    return complaint("[{\"title\": \"T\", \"datasets\": [\"a\", \"b\"], \"rows\":\n[" + row + "]}]");
  };
  EXPECT_EQ(of_row(R"({"label": "x", "value": "/memory/total_bytes", "paper": [1, null]})"), "accepted");
  EXPECT_THAT(of_row(R"({"label": "x", "vaule": "/frame"})"),
              HasSubstr(":2: [0].rows[0].vaule: unknown key; accepted: label, where"));
  EXPECT_THAT(of_row(R"({"label": "x"})"), HasSubstr("the key 'value' is missing"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/memmory/total_bytes"})"),
              testing::AllOf(HasSubstr("'/memmory/total_bytes' is no place in a record"), HasSubstr("did you mean '/memory'?")));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "memory"})"), HasSubstr("accepted: a JSON pointer"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/memory/~"})"), HasSubstr("accepted: a JSON pointer"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/frame", "where": {"/mode": "dvr"}})"),
              HasSubstr(".where./mode: '/mode' is no"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/frame", "where": {"/encoding": []}})"), HasSubstr("an empty list"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/frame", "scale": 0})"), HasSubstr("rows[0].scale: a number above 0"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/frame", "over": {"scale": 2}})"), HasSubstr("accepted: where, value, inverse"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/frame", "paper": [1, 2, 3]})"), HasSubstr("3 values for 2 data sets"));
  EXPECT_THAT(of_row(R"({"label": "x", "value": "/frame", "paper": [true]})"), HasSubstr("paper[0]: a number, a text or null"));
  EXPECT_THAT(complaint(R"({"title": "T", "datasets": ["a", "a"], "rows": []})"), HasSubstr("'a' is given twice"));
  EXPECT_THAT(complaint(R"({"title": "T", "datasets": "blobs_&_shell", "rows": {"label": "x", "value": "/render/mode"}})",
                        {record("uniform", 1)}),
              HasSubstr("/render/mode is no number in a record; accepted: a number, or a timing"));
}

TEST(SplitTable, HasARowForEachRecordThatExplainsItsErrorAndAColumnForEachCause) {
  std::vector<Json> records = sizes();
  const Json pair = {{"rmse", 0.25}, {"max", 0.5}};
  records[0]["error"]["split"] = {{"step", pair}, {"encoding", {{"rmse", 0.0}, {"max", 0.0}}}, {"early_end", nullptr}};
  const auto tables = make_tables(records);
  ASSERT_EQ(tables.size(), 2u);
  EXPECT_THAT(tables[1].title, HasSubstr("by cause"));
  EXPECT_THAT(keys(tables[1]), ElementsAre("encoding", "split_step", "split_encoding", "rmse"));
  EXPECT_THAT(cells(tables[1], "split_step"), ElementsAre("0.25"));
  EXPECT_THAT(cells(tables[1], "split_encoding"), ElementsAre("0"));
  EXPECT_EQ(make_tables(sizes()).size(), 1u);
}

}  // namespace
}  // namespace amrtex
