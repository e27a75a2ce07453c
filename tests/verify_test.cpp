// The frame of `amrtex verify`: what is reported, and that a broken encoding is noticed.
#include "bench/verify/verify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "tests/test_tier.hpp"

namespace amrtex::verify {
namespace {

using testing::HasSubstr;
using testing::IsSupersetOf;

Report run(const char* suite, VerifyOptions options = {}) {
  Report report;
  VerifyContext context(std::move(options), report);
  context.begin(suite);
  find_suite(suite).run(context);
  return report;
}

std::size_t failed_of(const Report& report, std::string_view encoding, std::string_view filter) {
  return static_cast<std::size_t>(std::count_if(report.cases.begin(), report.cases.end(), [&](const Outcome& o) {
    return o.encoding == encoding && o.filter == filter && !o.check.pass;
  }));
}

template <class T>
void shift(HostTexture& t) {
  for (std::int64_t i = 0; i < t.texels(); ++i) t.as<T>()[i] += static_cast<T>(0.01);
}

/// Every texel that holds a value, by a hundredth of the range.
void shift_values(EncodedField& field) {
  for (HostTexture& t : field.textures) {
    if (t.holds_values && t.format == TexelFormat::r32f) shift<float>(t);
    if (t.holds_values && t.format == TexelFormat::r64f) shift<double>(t);
  }
}

TEST(Verify, ChecksKnowNan) {
  const double nan = std::nan("");
  EXPECT_FALSE(at_most(nan, 1).pass);
  EXPECT_FALSE(above(nan, 1).pass);
  EXPECT_FALSE(near(nan, 1, 1).pass);
  EXPECT_TRUE(at_most(1, 1).pass);
  EXPECT_FALSE(above(1, 1).pass);
  EXPECT_TRUE(near(1.05, 1, 0.1).pass);
  EXPECT_EQ(at_most(0.5, 1e-3).expected, "<= 0.001");
}

TEST(Verify, OrdersAreSlopes) {
  EXPECT_NEAR(observed_order(std::vector<double>{1, 0.25, 0.0625}), 2, 1e-12);
  EXPECT_NEAR(observed_order(std::vector<double>{3, 1.5, 0.75, 0.375}), 1, 1e-12);
}

TEST(Verify, UnknownSuitesNameTheAcceptedOnes) {
  try {
    find_suite("analytical");
    FAIL();
  } catch (const UsageError& e) {
    for (const Suite& s : suites()) EXPECT_THAT(e.what(), HasSubstr(std::string(s.name)));
  }
}

TEST(Verify, RefusalsAreSkippedErrorsFail) {
  Report report;
  VerifyContext context({}, report);
  context.begin("a suite");
  context.for_each("a case", std::span(context.filters()).first(3), [&](const EncodingCase& c) -> Verdict {
    if (&c == &context.filters()[0]) throw UnsupportedError("cannot");
    if (&c == &context.filters()[1]) throw Error("broken");
    return NotAsked{"of others"};
  });
  ASSERT_EQ(report.skipped.size(), 2u);
  EXPECT_EQ(report.skipped[1].reason, "of others");
  EXPECT_EQ(report.skipped[0].reason, "cannot");
  ASSERT_EQ(report.cases.size(), 1u);
  EXPECT_EQ(report.failed(), 1u);
  EXPECT_EQ(report.cases[0].check.observed, "broken");
  const Json json = to_json(report);
  EXPECT_EQ(json["cases"][0]["pass"], false);
  EXPECT_EQ(json["cases"][0]["suite"], "a suite");
  EXPECT_EQ(json["skipped"][0]["reason"], "cannot");
}

TEST(Verify, EveryEncodingAndFilterTakesPart) {
  Report report;
  const VerifyContext context({}, report);
  for (const Encoding* e : all_encodings())
    for (const Filter filter : e->filters())
      EXPECT_EQ(std::count_if(context.filters().begin(), context.filters().end(),
                              [&](const EncodingCase& c) { return c.encoding == e && c.filter == filter; }),
                1)
          << e->name() << " " << filter_name(filter);
}

/// What all suites would ask, without asking it.
Report listed(std::size_t one_in = 1) {
  Report report;
  VerifyContext context({.list = true, .one_in = one_in}, report);
  for (const Suite& s : suites()) {
    context.begin(std::string(s.name));
    s.run(context);
  }
  return report;
}

// What is asked of no encoding is a file's, 27. A case is reported as passed, failed or skipped with a reason for each
// encoding and filter that it is given (above): so no number can be missing in silence where it is given all of them.
TEST(Verify, EachNumberOfTheListIsAskedOfEveryEncodingAndFilter) {
  const Report report = listed();
  EXPECT_TRUE(report.cases.empty());
  std::map<int, std::set<std::string>> asked;
  for (const Skipped& s : report.skipped) {
    EXPECT_GE(list_number(s.name), 1) << s.name;
    EXPECT_LE(list_number(s.name), kListed) << s.name;
    asked[list_number(s.name)].insert(s.encoding + " " + s.filter);
  }
  for (int number = 1; number <= kListed; ++number) {
    if (number == 27) {
      EXPECT_TRUE(asked[number].contains(" "));
      continue;
    }
    for (const Encoding* e : all_encodings())
      for (const Filter filter : e->filters())
        EXPECT_TRUE(asked[number].contains(fmt::format("{} {}", e->name(), filter_name(filter))))
            << number << " " << e->name() << " " << filter_name(filter);
  }
}

// What the default tier of the tests runs (verify_suite.sh): whatever is asked, it is asked of somebody, and everybody is asked.
TEST(Verify, OneInFourIsASampleOfEveryNumberAndOfEveryEncodingAndFilter) {
  std::set<int> numbers;
  std::set<std::string> pairs;
  std::size_t asked = 0, all = 0;
  for (const Skipped& s : listed(4).skipped) {
    if (s.encoding.empty()) continue;
    ++all;
    if (s.reason != "listed") continue;
    ++asked;
    numbers.insert(list_number(s.name));
    pairs.insert(s.encoding + " " + s.filter);
  }
  EXPECT_EQ(numbers.size(), static_cast<std::size_t>(kListed - 1)) << "27 is of files";
  for (const Encoding* e : all_encodings())
    for (const Filter filter : e->filters())
      EXPECT_TRUE(pairs.contains(fmt::format("{} {}", e->name(), filter_name(filter))))
          << e->name() << " " << filter_name(filter);
  EXPECT_NEAR(static_cast<double>(asked) / static_cast<double>(all), 0.25, 0.02);
}

// A wrong method for each of the mistakes that the list is there to find.
TEST(Verify, ControlsAreListed) {
  const Report report = listed();
  std::set<int> with_control;
  std::string names;
  for (const Skipped& s : report.skipped)
    if (is_control(s.name)) {
      with_control.insert(list_number(s.name));
      names += s.name + "\n";
    }
  EXPECT_THAT(with_control, IsSupersetOf({1, 2, 3, 4, 5, 6, 10, 11, 14, 15, 19, 20, 22, 23, 24, 25}));
  for (const char* mistake : {"euler", "left", "straddle", "filters that jump", "RGBA8", "without its last part"})
    EXPECT_THAT(names, HasSubstr(mistake));
}

TEST(Verify, CoverageTellsPassedFailedAndSkippedApart) {
  Report report;
  report.cases.push_back({"s", "3 a", "octree", "nearest", {}, {"", "", true}});
  report.cases.push_back({"s", "3 control: b", "octree", "nearest", {}, {"", "", true}});
  report.cases.push_back({"s", "4 c", "octree", "nearest", {}, {"", "", false}});
  report.cases.push_back({"s", "27 d", "", "", {}, {"", "", true}});
  report.skipped.push_back({"s", "5 e", "octree", "nearest", "why"});
  const std::string text = to_csv(coverage(report));
  EXPECT_THAT(text, HasSubstr("3,1,,2"));
  EXPECT_THAT(text, HasSubstr("4,,,1 of 1 FAIL"));
  EXPECT_THAT(text, HasSubstr("5,,,skipped"));
  EXPECT_THAT(text, HasSubstr("27,,1,"));
}

TEST(Verify, BrokenEncodingsAreNoticed) {
  const Report broken = run("analytic", {.one_in = test::full_tier() ? 1U : 3U, .tamper = shift_values});
  for (const Encoding* e : all_encodings())
    for (const Filter filter : e->filters())
      EXPECT_GT(failed_of(broken, e->name(), filter_name(filter)), 0u) << e->name() << " " << filter_name(filter);
}

}  // namespace
}  // namespace amrtex::verify
