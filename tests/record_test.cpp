#include "bench/records/record.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <set>

#include "structures/mesh/error.hpp"

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

  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_ / "records"), fs::directory_iterator()));
  }

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
                                 "dataset", "encoding", "build_parameters", "filter", "storage", "filtering", "render", "memory",
                                 "build_seconds", "upload_seconds", "process_peak_bytes", "first_frame_ms", "frame", "work",
                                 "check", "check_reason", "error", "error_common", "left_out", "image_hash", "context"));
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

TEST_F(RecordFolder, RoundTripKeepsOrderAndEveryBit) {
  Json record = good_record();
  record["build_seconds"] = 0.1 + 0.2;
  EXPECT_FALSE(has_record(folder_, "abc"));
  EXPECT_TRUE(write_record(folder_, "abc", record, false));
  EXPECT_TRUE(has_record(folder_, "abc"));
  EXPECT_EQ(read_record(record_path(folder_, "abc")).dump(), record.dump());
}

TEST_F(RecordFolder, NeverOverwritesUnlessForced) {
  const Json first = good_record();
  Json second = first;
  second["build_seconds"] = 9;
  EXPECT_TRUE(write_record(folder_, "abc", first, false));
  EXPECT_FALSE(write_record(folder_, "abc", second, false));
  EXPECT_EQ(read_record(record_path(folder_, "abc"))["build_seconds"], 0.5);
  EXPECT_TRUE(write_record(folder_, "abc", second, true));
  EXPECT_EQ(read_record(record_path(folder_, "abc"))["build_seconds"], 9);
  EXPECT_EQ(files(), 1u);
}

TEST_F(RecordFolder, WritesNothingThatIsNotValid) {
  Json record = good_record();
  record["status"] = "perhaps";
  EXPECT_THROW(write_record(folder_, "abc", record, false), Error);
  EXPECT_FALSE(fs::exists(folder_ / "records"));
}

// Writers that race, as two runs into one folder would: exactly one wins, the file is
// one writer's whole text, and no temporary file stays.
TEST_F(RecordFolder, OfRacingWritersOneWins) {
  fs::create_directories(folder_ / "records");
  std::vector<pid_t> children;
  for (int writer = 0; writer < 8; ++writer) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      Json record = good_record();
      record["build_seconds"] = writer;
      record["experiment"] = std::string(100000, static_cast<char>('a' + writer));
      ::_exit(write_record(folder_, "abc", record, false) ? 1 : 0);
    }
    children.push_back(child);
  }
  int winners = 0;
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    winners += WEXITSTATUS(status);
  }
  EXPECT_EQ(winners, 1);
  EXPECT_EQ(files(), 1u);
  const Json record = read_record(record_path(folder_, "abc"));
  const auto text = record["experiment"].get<std::string>();
  EXPECT_EQ(text, std::string(100000, static_cast<char>('a' + record["build_seconds"].get<int>())));
}

TEST_F(RecordFolder, LoadsAllRecordsAndNoLeftovers) {
  Json record = good_record();
  for (const char* hash : {"b", "a", "c"}) {
    record["experiment"] = hash;
    write_record(folder_, hash, record, false);
  }
  std::ofstream(folder_ / "records" / ".d.123.tmp") << "half a rec";
  const std::vector<Json> records = load_records(folder_);
  ASSERT_EQ(records.size(), 3u);
  EXPECT_EQ(records[0]["experiment"], "a");
  EXPECT_EQ(records[2]["experiment"], "c");
}

TEST_F(RecordFolder, NamesTheBrokenFile) {
  write_record(folder_, "good", good_record(), false);
  std::ofstream(folder_ / "records" / "broken.json") << R"({"schema": "amrtex-record/2", )";
  try {
    load_records(folder_);
    FAIL() << "a broken record was accepted";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("broken.json"));
  }
}

/// As schema 1 had it: without the keys that came later.
Json first_record() {
  Json record = good_record();
  record["schema"] = "amrtex-record/1";
  for (const char* key : {"configuration", "implementation", "repetition", "process_peak_bytes", "check", "check_reason"})
    record.erase(key);
  for (const char* key : {"reference_error", "limited_by_reference", "within_tolerance_seen"}) record["error"].erase(key);
  return record;
}

void write_text(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
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

TEST_F(RecordFolder, TellsWhetherRecordsOfTheFirstSchemaAreThere) {
  EXPECT_FALSE(record_of_first_schema(folder_)) << "no folder";
  write_record(folder_, "new", good_record(), false);
  write_text(folder_ / "records" / "broken.json", "{");
  EXPECT_FALSE(record_of_first_schema(folder_));
  write_text(folder_ / "records" / "old.json", first_record().dump());
  EXPECT_EQ(record_of_first_schema(folder_), folder_ / "records" / "old.json");
}

TEST_F(RecordFolder, ARecordBelongsToOneImplementation) {
  Json record = good_record();
  record["implementation"] = "ab";
  EXPECT_FALSE(has_record_of(folder_, "abc", "ab"));
  write_record(folder_, "abc", record, false);
  EXPECT_TRUE(has_record_of(folder_, "abc", "ab"));
  EXPECT_FALSE(has_record_of(folder_, "abc", "cd"));
}

TEST_F(RecordFolder, AFolderWithoutRecordsIsAnError) { EXPECT_THROW(load_records(folder_), Error); }

TEST_F(RecordFolder, AFolderThatCannotBeWrittenIsAnError) {
  fs::create_directories(folder_);
  std::ofstream(folder_ / "records") << "a file in the way";
  EXPECT_THROW(write_record(folder_, "abc", good_record(), false), Error);
}

}  // namespace
}  // namespace amrtex
