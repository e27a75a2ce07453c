// The frame of `amrtex verify`: what is reported, and that a broken encoding is noticed.
#include "bench/verify/verify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace amrtex::verify {
namespace {

using testing::HasSubstr;

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
  context.for_each("a case", std::span(context.filters()).first(3), [&](const EncodingCase& c) -> std::optional<Check> {
    if (&c == &context.filters()[0]) throw UnsupportedError("cannot");
    if (&c == &context.filters()[1]) throw Error("broken");
    return std::nullopt;
  });
  ASSERT_EQ(report.skipped.size(), 1u);
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

TEST(Verify, BrokenEncodingsAreNoticed) {
  const Report broken = run("analytic", {.tamper = shift_values});
  for (const Encoding* e : all_encodings())
    for (const Filter filter : e->filters())
      EXPECT_GT(failed_of(broken, e->name(), filter_name(filter)), 0u) << e->name() << " " << filter_name(filter);
}

}  // namespace
}  // namespace amrtex::verify
