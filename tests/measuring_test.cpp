// Processes that measure, played by shell scripts: what crashes, hangs or is killed costs its own point alone.
#include "bench/measure/measuring_process.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "bench/measure/process_group.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

std::vector<std::string> script(const std::string& text) { return {"/bin/sh", "-c", text}; }

TEST(MeasuringProcesses, AnswerLineByLine) {
  MeasuringProcess process(script(R"(while read -r q; do echo "{\"heard\": $q}" >&3; done)"), 0);
  process.send({{"plan", 1}});
  process.send({{"plan", 2}});
  EXPECT_EQ(process.receive(10s), (Json{{"heard", {{"plan", 1}}}}));
  EXPECT_EQ(process.receive(10s), (Json{{"heard", {{"plan", 2}}}}));
  EXPECT_EQ(process.receive(50ms), std::nullopt);
  EXPECT_FALSE(process.ended()) << "it only has nothing to say";
}

TEST(MeasuringProcesses, SayHowTheyEnded) {
  MeasuringProcess crash(script("echo driver: out of ideas >&2; kill -SEGV $$"), 0);
  EXPECT_EQ(crash.receive(10s), std::nullopt);
  EXPECT_TRUE(crash.ended());
  const auto ending = crash.finish();
  EXPECT_EQ(ending.end, MeasuringProcess::End::crashed);
  EXPECT_THAT(ending.reason, HasSubstr("signal 11"));
  EXPECT_THAT(ending.reason, HasSubstr("its last words: driver: out of ideas"));

  MeasuringProcess refusal(script("exit 3"), 0);
  EXPECT_EQ(refusal.receive(10s), std::nullopt);
  EXPECT_THAT(refusal.finish().reason, HasSubstr("exit code 3"));

  MeasuringProcess killed(script("kill -KILL $$"), 0);
  EXPECT_EQ(killed.receive(10s), std::nullopt);
  EXPECT_EQ(killed.finish().end, MeasuringProcess::End::killed);
}

TEST(MeasuringProcesses, EndWithTheObject) {
  pid_t id = 0;
  {
    const MeasuringProcess process(script("sleep 60"), 0);
    id = process.id();
    EXPECT_EQ(::kill(id, 0), 0);
  }
  EXPECT_NE(::kill(id, 0), 0);
}

TEST(MeasuringProcesses, HearNothingAfterTheirEndWithoutHarm) {
  MeasuringProcess process(script("exit 0"), 0);
  EXPECT_EQ(process.receive(10s), std::nullopt);
  process.send({{"plan", 0}});
  EXPECT_EQ(process.receive(1s), std::nullopt);
}

TEST(MeasuringProcesses, AProgramThatIsNotThereEndsAtOnce) {
  MeasuringProcess process({"/no/such/program"}, 0);
  EXPECT_EQ(process.receive(10s), std::nullopt);
  EXPECT_THAT(process.finish().reason, HasSubstr("exit code 127"));
}

TEST(MeasuringProcesses, MayAllocateWhatTheyAreAllowed) {
  const std::string greedy = "head -c 200000000 /dev/zero | tail -c 199999999 >/dev/null && echo '{}' >&3";
  MeasuringProcess enough(script(greedy), 2'000'000'000);
  EXPECT_NE(enough.receive(60s), std::nullopt);
  MeasuringProcess too_little(script(greedy), 50'000'000);
  EXPECT_EQ(too_little.receive(60s), std::nullopt);
}

/// Measures two points of one structure, 0 and 1. `first` is what happens after the record of point 0; a file counts how often the first
/// question was asked.
class Groups : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("amrtex_measuring_{}_{}", info->name(), ::getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void play(const std::string& before, const std::string& after) {
    std::ofstream(folder_ / "play.sh") << fmt::format(R"(
cd {}
while read -r q; do
  case "$q" in
    *'"plan"'*) echo '{{"points": [[0, 0, "a", 0], [0, 1, "b", 0]]}}' >&3 ;;
    *'"references"'*) echo references >>drawn; [ ! -e fragile ] || kill -SEGV $$; echo '{{"done": true}}' >&3 ;;
    *'"fail"'*) echo "{{\"record\": {{\"failed\": $q}}}}" >&3 ;;
    *'"renders":[0,1]'*)
      echo asked >>asked
      {}
      echo '{{"phase": "drawing"}}' >&3; echo '{{"record": {{"measured": 0}}}}' >&3; echo '{{"phase": "drawing"}}' >&3
      {}
      echo '{{"record": {{"measured": 1}}}}' >&3; echo '{{"done": true}}' >&3 ;;
    *'"renders":[1]'*) echo '{{"phase": "drawing"}}' >&3
      {}
      echo '{{"record": {{"measured": 1}}}}' >&3; echo '{{"done": true}}' >&3 ;;
  esac
done
)",
                                                      folder_.string(), before, after, after);
    options_.measuring_process = {"/bin/sh", (folder_ / "play.sh").string()};
  }

  std::vector<Json> measure() {
    ProcessGroups groups(options_);
    const std::vector<PlannedPoint> points = groups.plan(0);
    EXPECT_EQ(points.size(), 2u);
    groups.draw_references(points);
    std::vector<Json> records;
    groups.measure(0, {0, 1}, 0, [&](const Json& record) { records.push_back(record); });
    return records;
  }
  int asked() const { return lines("asked"); }
  int lines(const char* file) const {
    std::ifstream in(folder_ / file);
    int n = 0;
    for (std::string line; std::getline(in, line);) ++n;
    return n;
  }
  static std::string reason(const Json& record) { return record.at("failed").at("reason"); }

  fs::path folder_;
  RunOptions options_;
};

TEST_F(Groups, MeasureTheirPointsInOneProcess) {
  play("", "");
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[0], (Json{{"measured", 0}}));
  EXPECT_EQ(records[1], (Json{{"measured", 1}}));
  EXPECT_EQ(asked(), 1);
}

TEST_F(Groups, AskForReferencesOnce) {
  play("", "");
  EXPECT_EQ(measure().size(), 2u);
  EXPECT_EQ(lines("drawn"), 1);
}

TEST_F(Groups, ACrashInAReferenceLeavesItToThePoints) {
  play("", "");
  std::ofstream(folder_ / "fragile") << "";
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[1], (Json{{"measured", 1}}));
  EXPECT_EQ(lines("drawn"), 1);
}

TEST_F(Groups, ACrashCostsItsOwnPoint) {
  play("", "kill -SEGV $$");
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[0], (Json{{"measured", 0}}));
  EXPECT_EQ(records[1].at("failed").at("render"), 1);
  EXPECT_THAT(reason(records[1]), HasSubstr("the process that measured it was ended by signal 11"));
}

TEST_F(Groups, ACrashWhileBuildingCostsAllPointsOfTheStructure) {
  play(R"(echo '{"phase": "building"}' >&3; kill -SEGV $$)", "");
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  for (const Json& record : records) EXPECT_THAT(reason(record), HasSubstr("signal 11"));
  EXPECT_EQ(asked(), 1);
}

TEST_F(Groups, AHangEndsAfterTheTimeThatAPointMayTake) {
  play("", "sleep 60");
  options_.time_out = 0.3;
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  EXPECT_THAT(reason(records[1]), HasSubstr("took more than 0.3 s of drawing"));
}

TEST_F(Groups, TimeThatIsNeitherBuildingNorDrawingIsNotLimited) {
  play(R"(echo '{"phase": "other"}' >&3; sleep 1)", "");
  options_.time_out = 0.3;
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[1], (Json{{"measured", 1}}));
}

// Somebody else's SIGKILL says nothing of the point: it is measured again.
TEST_F(Groups, AProcessThatSomebodyEndsIsBegunAgain) {
  play("[ -e killed ] || { touch killed; kill -KILL $$; }", "");
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[0], (Json{{"measured", 0}}));
  EXPECT_EQ(asked(), 2);
}

TEST_F(Groups, AProcessThatIsEndedEachTimeFails) {
  play("kill -KILL $$", "");
  const std::vector<Json> records = measure();
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(asked(), 3);
  EXPECT_THAT(reason(records[0]), HasSubstr("signal 9"));
  EXPECT_EQ(records[1], (Json{{"measured", 1}}));
}

TEST_F(Groups, WhatConcernsTheWholeExperimentIsThrown) {
  play(R"(echo '{"usage_error": "no such parameter"}' >&3)", "");
  EXPECT_THROW(measure(), UsageError);
}

}  // namespace
}  // namespace amrtex
