#include "bench/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "bench/record.hpp"
#include "structures/error.hpp"

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
  r["dataset"] = {{"name", "blobs_&_shell"}, {"hash", "h1"},  {"leaf_cells", 1000}, {"stored_cells", 1100}, {"levels", 3},
                  {"patches", 10},           {"field", "phi"}};
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
  r["error"]["split"] = nullptr;
  r["error_common"] = error_json({.rmse = 1.25e-7, .max = 1, .psnr_db = 42.5, .mrse = 0}, "r");
  r["error_common"]["filter"] = "linear_vertex";
  r["context"] = {{"renderer", "llvmpipe"}, {"gl_version", nullptr},  {"extensions_missing", nullptr}, {"cpu", nullptr},
                  {"cores", nullptr},       {"environment", nullptr}, {"build_type", nullptr},         {"compiler", nullptr},
                  {"commit", nullptr},      {"dirty", nullptr},       {"shader_hash", nullptr},        {"date", nullptr}};
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
  EXPECT_THAT(table.notes, ElementsAre("no values: frame GPU (ms), PSNR (dB)", "of 4 points: 3 ok, 1 unsupported"));
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

}  // namespace
}  // namespace amrtex
