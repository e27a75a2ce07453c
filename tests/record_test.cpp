#include "bench/records/record.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <functional>
#include <iterator>
#include <set>

#include "bench/measure/environment.hpp"
#include "bench/records/record_file.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class RecordFolder : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / (std::string("amrtex_record_") + info->name() + "_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
};

Json good_record() {
  Json record = blank_record(Status::ok);
  record["experiment"] = "e";
  record["encoding"] = "uniform";
  record["build_seconds"] = 0.5;
  record["memory"] = {{"total_bytes", 10},
                      {"by_role", {{"payload", 4}, {"duplicated", 3}, {"topology", 2}, {"padding", 1}}},
                      {"texels_by_texture", {{"values", 10}}},
                      {"texels_per_cell", 1.0},
                      {"host_peak_bytes", 20}};
  const std::vector<double> samples = {3, 1, 2};
  record["frame"] = {{"wall_ms", timing_json(samples)}, {"gpu_ms", nullptr}, {"all_wall_ms", samples}};
  record["error"] = error_json({.rmse = 0, .max = 0, .psnr_db = std::nullopt, .mrse = 0}, "abc");
  for (const char* key : {"split", "reference_error", "limited_by_reference", "within_tolerance_seen"})
    record["error"][key] = nullptr;
  record["check"] = {{"psnr_db", 50.0}, {"from", "default"}, {"why", "the step"}};
  return record;
}

std::string complaint(const Json& record) {
  try {
    validate_record(record);
  } catch (const Error& e) {
    return e.what();
  }
  return "valid";
}

TEST(BlankRecord, HasEveryFixedKeyInOrder) {
  std::vector<std::string> keys;
  const Json record = blank_record(Status::unsupported, "no such filter");
  for (const auto& [key, value] : record.items()) keys.push_back(key);
  EXPECT_THAT(
      keys, testing::ElementsAre("schema", "status", "reason", "experiment", "configuration", "implementation", "repetition",
                                 "asked", "dataset", "encoding", "build_parameters", "filter", "storage", "filtering", "render",
                                 "memory", "build_seconds", "upload_seconds", "process_peak_bytes", "first_frame_ms", "frame",
                                 "work", "check", "check_reason", "error", "error_common", "left_out", "image_hash", "context"));
  EXPECT_EQ(complaint(record), "valid");
}

TEST(ValidateRecord, AcceptsZeroErrorAndExtraKeys) {
  Json record = good_record();
  record["more"] = 1;
  EXPECT_EQ(complaint(record), "valid");
  EXPECT_EQ(record["error"]["rmse"], 0.0);
  EXPECT_TRUE(record["error"]["psnr_db"].is_null());
}

TEST(ValidateRecord, TakesAnErrorByCauseAndHowWellItAddsUp) {
  Json record = good_record();
  record["error"]["split"] = {{"step", {{"rmse", 0.1}, {"max", 0.2}}}, {"storage", nullptr}, {"sum_closes", 1e-16}};
  EXPECT_EQ(complaint(record), "valid");
  record["error"]["split"]["sum_closes"] = "0";
  EXPECT_THAT(complaint(record), HasSubstr("/error/split/sum_closes: a number"));
  record["error"]["split"] = {{"step", {{"rmse", 0.1}}}};
  EXPECT_THAT(complaint(record), HasSubstr("/error/split/step/max: a number"));
}

struct Damage {
  const char* pointer;
  Json value;  ///< discarded = the key is removed
};

TEST(ValidateRecord, NamesThePlaceOfEveryDamage) {
  const Json removed = Json(Json::value_t::discarded);
  const Damage damages[] = {{"/schema", "amrtex-record/0"},
                            {"/status", "fine"},
                            {"/status", nullptr},
                            {"/reason", "why"},
                            {"/encoding", 3},
                            {"/encoding", removed},
                            {"/image_hash", removed},
                            {"/memory/total_bytes", 11},
                            {"/memory/total_bytes", 10.5},
                            {"/memory/by_role/padding", nullptr},
                            {"/memory/by_role/topology", removed},
                            {"/frame/wall_ms/median", nullptr},
                            {"/frame/wall_ms/ci95", {3, 1}},
                            {"/frame/wall_ms/ci95", {1}},
                            {"/frame/wall_ms/n", 4},
                            {"/frame/all_wall_ms/1", "x"},
                            {"/frame/gpu_ms", removed},
                            {"/error/rmse", "0"},
                            {"/error/psnr_db", removed},
                            {"/check/from", removed},
                            {"/check_reason", "none"},
                            {"/repetition", 0.5},
                            {"/error/within_tolerance_seen", removed},
                            {"/left_out", Json::object()}};
  for (const Damage& damage : damages) {
    Json record = good_record();
    const Json::json_pointer pointer(damage.pointer);
    if (damage.value.is_discarded())
      record.at(pointer.parent_pointer()).erase(pointer.back());
    else
      record.at(pointer) = damage.value;
    EXPECT_THAT(complaint(record), HasSubstr(std::string(damage.pointer) + ":"));
  }
}

TEST(ValidateRecord, WhatIsNotOkHasAReasonAndNoTime) {
  Json record = good_record();
  record["status"] = "failed";
  EXPECT_THAT(complaint(record), HasSubstr("/reason"));
  record["reason"] = "the picture differs";
  EXPECT_THAT(complaint(record), HasSubstr("/frame"));
  record["frame"] = nullptr;
  EXPECT_EQ(complaint(record), "valid");
}

TEST(ValidateRecord, APictureWithoutACheckSaysWhy) {
  Json record = good_record();
  record["check"] = nullptr;
  EXPECT_THAT(complaint(record), HasSubstr("/check_reason"));
  record["check_reason"] = "no reference";
  EXPECT_EQ(complaint(record), "valid");
}

TEST(TimingJson, IsNullWithoutSamples) {
  EXPECT_TRUE(timing_json({}).is_null());
  const Json one = timing_json(std::vector<double>{2.5});
  EXPECT_EQ(one["median"], 2.5);
  EXPECT_EQ(one["n"], 1);
  EXPECT_EQ(one["ci95"], Json::array({2.5, 2.5}));
}

TEST(MemoryJson, AddsUpAndCountsValueTexelsACell) {
  EncodedField field;
  HostTexture values;
  values.name = "values";
  values.size = {4, 4, 4};
  values.holds_values = true;
  values.roles = {.payload = 200, .duplicated = 56, .topology = 0, .padding = 0};
  HostTexture table = values;
  table.name = "table";
  table.holds_values = false;
  table.roles = {.payload = 0, .duplicated = 0, .topology = 256, .padding = 0};
  field.textures = {values, table};
  const Json memory = memory_json(field, 32);
  EXPECT_EQ(memory["total_bytes"], 512);
  EXPECT_EQ(memory["texels_per_cell"], 2.0);
  EXPECT_EQ(memory["texels_by_texture"]["table"], 64);
  Json record = good_record();
  record["memory"] = memory;
  EXPECT_EQ(complaint(record), "valid");
  EXPECT_TRUE(memory_json(field, 0)["texels_per_cell"].is_null());
  field.field_count = 2;  // of one field: a cell of each
  EXPECT_EQ(memory_json(field, 32)["texels_per_cell"], 1.0);
}

TEST(MemoryJson, AMapOfLeapsIsTopology) {
  Json memory = memory_json(EncodedField{}, 1);
  add_leaps(memory, 400);
  EXPECT_EQ(memory["total_bytes"], 400);
  EXPECT_EQ(memory["by_role"]["topology"], 400);
  EXPECT_EQ(memory["texels_by_texture"]["leap_distances"], 100);
}

// XXH3-128 of {"encoding":"uniform","n":3,"step":0.5}, as `xxh128sum` prints it.
TEST(ConfigurationHash, DoesNotChangeFromVersionToVersion) {
  const Json configuration = {{"encoding", "uniform"}, {"step", 0.5}, {"n", 3}};
  EXPECT_EQ(configuration_hash(configuration), "8d61284b056ac0dc853ceb857874d812");
}

TEST(ConfigurationHash, IgnoresOrderOfKeysAndHowWholeNumbersAreWritten) {
  const Json a = {{"x", 1}, {"y", {{"b", 2.0}, {"a", "t"}}}};
  const Json b = {{"y", {{"a", "t"}, {"b", 2}}}, {"x", 1.0}};
  EXPECT_EQ(configuration_hash(a), configuration_hash(b));
  EXPECT_EQ(configuration_hash({{"x", -0.0}}), configuration_hash({{"x", 0}}));
}

TEST(ConfigurationHash, DiffersWhereAnythingDiffers) {
  const std::vector<Json> configurations = {{{"x", 1}},
                                            {{"x", 2}},
                                            {{"x", 1.5}},
                                            {{"x", std::nextafter(1.5, 2)}},
                                            {{"x", "1"}},
                                            {{"y", 1}},
                                            {{"x", true}},
                                            {{"x", nullptr}},
                                            {{"x", {1, 2}}},
                                            {{"x", {2, 1}}},
                                            Json::object(),
                                            {{"x", 9007199254740993}},
                                            {{"x", 9007199254740992}}};
  std::set<std::string> hashes;
  for (const Json& configuration : configurations) {
    hashes.insert(configuration_hash(configuration));
    EXPECT_EQ(configuration_hash(configuration).size(), 32u);
  }
  EXPECT_EQ(hashes.size(), configurations.size());
}

TEST(ConfigurationHash, RefusesWhatJsonCannotHold) {
  EXPECT_THROW(configuration_hash({{"x", std::nan("")}}), Error);
  EXPECT_THROW(configuration_hash({{"x", {1.0, INFINITY}}}), Error);
}

/// A record of a point that no other test has.
Json record_of(const std::string& configuration, double build_seconds = 0.5, int repetition = 0) {
  Json record = good_record();
  record["configuration"] = configuration;
  record["build_seconds"] = build_seconds;
  record["repetition"] = repetition;
  return record;
}

std::string text_of_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void write_text(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST_F(RecordFolder, RoundTripKeepsOrderAndEveryBit) {
  const Json record = record_of("a", 0.1 + 0.2);
  RecordFile(folder_).append(record);
  EXPECT_EQ(load_records(folder_).at(0).dump(), record.dump());
}

TEST_F(RecordFolder, TheLastRecordOfAPointStandsForIt) {
  {
    RecordFile file(folder_);
    file.append(record_of("a", 1));
    file.append(record_of("b", 2));
    file.append(record_of("a", 3));
  }
  const std::vector<Json> records = load_records(folder_);
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[0]["build_seconds"], 3);
  EXPECT_EQ(records[1]["build_seconds"], 2);
  RecordFile again(folder_);
  ASSERT_NE(again.find(key_of(record_of("a"))), nullptr);
  EXPECT_EQ(again.find(key_of(record_of("a")))->at("build_seconds"), 3);
  EXPECT_EQ(again.find(key_of(record_of("c"))), nullptr);
}

TEST_F(RecordFolder, RepetitionsAndContextsStandBesideEachOther) {
  const auto drawn_by = [](const char* renderer, Json record) {
    record["context"] = context_json();
    record["context"].update({{"renderer", renderer},
                              {"device", "gpu"},
                              {"gl_version", "4.5"},
                              {"extensions_missing", Json::array()},
                              {"shader_hash", "abc"},
                              {"shader_cache", "warm"}});
    return record;
  };
  RecordFile file(folder_);
  file.append(drawn_by("one", record_of("a", 1, 0)));
  file.append(drawn_by("one", record_of("a", 2, 1)));
  file.append(drawn_by("another", record_of("a", 3, 0)));
  EXPECT_EQ(file.records().size(), 3u);
  file.append(drawn_by("another", record_of("a", 4, 0)));
  EXPECT_EQ(file.records().size(), 3u);
}

TEST_F(RecordFolder, WritesNothingThatIsNotValid) {
  Json record = good_record();
  record["status"] = "perhaps";
  RecordFile file(folder_);
  EXPECT_THROW(file.append(record), Error);
  EXPECT_EQ(text_of_file(folder_ / "records.jsonl"), "");
}

// A process that is killed while it writes leaves the beginning of a line: for every length of it the records before are there,
// and the run that goes on cuts it off.
TEST_F(RecordFolder, AFileCutAtAnyByteLosesItsLastRecordAlone) {
  const std::string first = record_line(record_of("a")) + "\n", second = record_line(record_of("b")) + "\n";
  const fs::path file = folder_ / "records.jsonl";
  for (std::size_t kept = 0; kept < second.size(); ++kept) {
    write_text(file, first + second.substr(0, kept));
    ASSERT_EQ(load_records(folder_).size(), 1u) << kept;
    if (kept % 97 != 0) continue;
    {
      RecordFile open(folder_);
      EXPECT_EQ(open.warnings().size(), kept > 0 ? 1u : 0u);
      EXPECT_EQ(text_of_file(file), first);
      open.append(record_of("b"));
    }
    ASSERT_EQ(text_of_file(file), first + second) << kept;
  }
}

TEST_F(RecordFolder, ALineThatDoesNotFitItsChecksumIsToldAndLeftOut) {
  std::string damaged = record_line(record_of("a"));
  damaged.replace(damaged.find("0.5"), 3, "0.6");
  write_text(folder_ / "records.jsonl", damaged + "\n" + record_line(record_of("b")) + "\n");
  const RecordLines lines = load_record_lines(folder_);
  EXPECT_EQ(lines.records.size(), 1u);
  ASSERT_EQ(lines.warnings.size(), 1u);
  EXPECT_THAT(lines.warnings[0], HasSubstr("records.jsonl:1: does not fit its own checksum"));
}

// A number has several spellings; the checksum is that of the letters in the line.
TEST_F(RecordFolder, ANumberMayBeSpeltAsAnotherProgramDoes) {
  const Json record = record_of("a");
  std::string text = record.dump();
  text.replace(text.find("0.5"), 3, "5e-1");
  const auto crc = ::crc32(::crc32(0, nullptr, 0), reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size()));
  write_text(folder_ / "records.jsonl", fmt::format(R"({{"record": {}, "crc32": "{:08x}"}})", text, crc) + "\n");
  const RecordLines lines = load_record_lines(folder_);
  EXPECT_THAT(lines.warnings, testing::IsEmpty());
  ASSERT_EQ(lines.records.size(), 1u);
  EXPECT_EQ(lines.records[0], record);
}

TEST_F(RecordFolder, ANewerSchemaIsRefused) {
  Json record = record_of("a");
  record["schema"] = "amrtex-record/3";
  write_text(folder_ / "records.jsonl", record_line(record) + "\n");
  EXPECT_THAT(message_of([&] { load_records(folder_); }), HasSubstr("'amrtex-record/3'; accepted: amrtex-record/2"));
  EXPECT_THAT(message_of([&] { RecordFile file(folder_); }), HasSubstr("amrtex-record/3"));
}

TEST_F(RecordFolder, CommittedRecordsAreCompressed) {
  fs::create_directories(folder_);
  const std::string text = record_line(record_of("a")) + "\n";
  const gzFile file = ::gzopen((folder_ / "records.jsonl.gz").c_str(), "wb");
  ::gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  ::gzclose(file);
  EXPECT_EQ(load_records(folder_).at(0), record_of("a"));
}

TEST_F(RecordFolder, OneRunAloneHasAFolder) {
  const RecordFile first(folder_);
  EXPECT_THAT(message_of([&] { RecordFile second(folder_); }), HasSubstr("another run measures into it"));
}

TEST_F(RecordFolder, ADeadProcessHoldsNoFolder) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    RecordFile file(folder_);
    file.append(record_of("a"));
    ::raise(SIGKILL);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(RecordFile(folder_).records().size(), 1u);
}

TEST_F(RecordFolder, AFolderThatVanishesEndsTheRun) {
  RecordFile file(folder_);
  fs::remove_all(folder_);
  EXPECT_THROW(file.append(record_of("a")), OutputError);
}

TEST_F(RecordFolder, AFolderThatCannotBeWrittenIsAnError) {
  std::ofstream(folder_) << "a file in the way";
  EXPECT_THROW(RecordFile file(folder_), OutputError);
}

// /dev/full takes no byte.
TEST_F(RecordFolder, AFullDiskLeavesNoPartOfALine) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "/dev/full is missing";
  const int full = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
  EXPECT_EQ(write_all(full, "text"), ENOSPC);
  ::close(full);
}

TEST_F(RecordFolder, AFolderWithoutRecordsIsAnError) { EXPECT_THROW(load_records(folder_), Error); }

TEST_F(RecordFolder, WholeFilesReplaceOthersAndLeaveNothingBeside) {
  write_text(folder_ / "table.md", "old");
  write_text(folder_ / ".unfinished-abcdef", "half");
  write_atomically(folder_ / "table.md", "new");
  EXPECT_EQ(text_of_file(folder_ / "table.md"), "new");
  remove_unfinished_files(folder_);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
  EXPECT_THROW(write_atomically(folder_ / "absent" / "table.md", "new"), OutputError);
}

// ---- files of older programs

/// As schema 1 had it: without the keys that came later.
Json first_record() {
  Json record = good_record();
  record["schema"] = "amrtex-record/1";
  for (const char* key : {"configuration", "implementation", "repetition", "process_peak_bytes", "check", "check_reason"})
    record.erase(key);
  for (const char* key : {"reference_error", "limited_by_reference", "within_tolerance_seen"}) record["error"].erase(key);
  return record;
}

TEST_F(RecordFolder, RecordsOfTheFirstSchemaAreReadWithNullForWhatCameLater) {
  write_text(folder_ / "records" / "old.json", first_record().dump());
  const Json record = load_records(folder_).at(0);
  EXPECT_EQ(record["schema"], kFirstSchema);
  EXPECT_EQ(record["build_seconds"], 0.5);
  for (const char* pointer : {"/configuration", "/check", "/check_reason", "/error/reference_error"}) {
    ASSERT_TRUE(record.contains(Json::json_pointer(pointer))) << pointer;
    EXPECT_TRUE(record.at(Json::json_pointer(pointer)).is_null()) << pointer;
  }
  EXPECT_THROW(validate_record(record), Error) << "a new record is of the new schema";
  Json broken = first_record();
  broken.erase("encoding");
  write_text(folder_ / "records" / "old.json", broken.dump());
  EXPECT_THROW(load_records(folder_), Error) << "what the first schema had is still asked for";
}

TEST_F(RecordFolder, NamesTheBrokenFile) {
  write_text(folder_ / "records" / "good.json", good_record().dump());
  write_text(folder_ / "records" / "broken.json", R"({"schema": "amrtex-record/2", )");
  EXPECT_THAT(message_of([&] { load_records(folder_); }), HasSubstr("broken.json"));
}

TEST_F(RecordFolder, ARunDoesNotGoOnFromThem) {
  write_text(folder_ / "records" / "old.json", first_record().dump());
  EXPECT_THAT(message_of([&] { RecordFile file(folder_); }), HasSubstr("records/old.json is of an older form"));
}

}  // namespace
}  // namespace amrtex
