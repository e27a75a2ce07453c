#include "bench/records/point_query.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using testing::AllOf;
using testing::HasSubstr;

Json point() {
  return {{"encoding", "kd_tree"},
          {"build_parameters", {{"storage_kind", "pool"}, {"page_size", 16}}},
          {"filter", "linear_lod"},
          {"dataset", {{"name", "blobs_shell levels=4"}, {"field", "phi"}}},
          {"render", {{"step", 0.5}, {"skip", true}, {"mode", "dvr"}, {"early_end", nullptr}}}};
}

bool holds(const std::string& text) { return PointQuery(text, "--where").holds(point()); }

std::string complaint(const std::string& text) {
  try {
    PointQuery(text, "--where");
  } catch (const UsageError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(PointQueries, CompareNumbersAsNumbersAndTheRestAsText) {
  EXPECT_TRUE(holds("step = 0.5"));
  EXPECT_TRUE(holds("step=5e-1"));
  EXPECT_TRUE(holds("step <= 0.5 and step >= 0.5"));
  EXPECT_FALSE(holds("step < 0.5"));
  EXPECT_FALSE(holds("step > 0.5"));
  EXPECT_TRUE(holds("page_size != 8"));
  EXPECT_TRUE(holds("encoding = kd_tree"));
  EXPECT_TRUE(holds("dataset = 'blobs_shell levels=4'"));
  EXPECT_TRUE(holds("skip = true"));
  EXPECT_FALSE(holds("mode < 3")) << "a text is neither smaller nor larger";
}

TEST(PointQueries, AKeyThatThePointDoesNotHaveIsEqualToNothing) {
  EXPECT_FALSE(holds("page_size = 16 and tolerance = 0.1"));
  EXPECT_TRUE(holds("tolerance != 0.1"));
  EXPECT_TRUE(holds("early_end = null"));
  EXPECT_FALSE(holds("tolerance < 1"));
}

TEST(PointQueries, AndBindsCloserThanOr) {
  EXPECT_TRUE(holds("encoding = kd_tree or encoding = octree and step = 9"));
  EXPECT_FALSE(holds("(encoding = kd_tree or encoding = octree) and step = 9"));
  EXPECT_TRUE(holds("not encoding = octree and step = 0.5"));
  EXPECT_FALSE(holds("not (encoding = kd_tree and step = 0.5)"));
  EXPECT_TRUE(holds("not not step = 0.5"));
}

TEST(PointQueries, InAsksForOneOfSeveral) {
  EXPECT_TRUE(holds("encoding in (octree, kd_tree)"));
  EXPECT_TRUE(holds("step in (1, 0.5)"));
  EXPECT_FALSE(holds("filter in (nearest)"));
}

TEST(PointQueries, SayWhatIsWrongAndWhere) {
  EXPECT_THAT(complaint("stpe = 1"), AllOf(HasSubstr("character 1: 'stpe'"), HasSubstr("did you mean 'step'?")));
  EXPECT_THAT(complaint("step ~ 1"), AllOf(HasSubstr("character 6"), HasSubstr("accepted: =, !=")));
  EXPECT_THAT(complaint("step < small"), AllOf(HasSubstr("character 8"), HasSubstr("accepted: a number")));
  EXPECT_THAT(complaint("step = "), AllOf(HasSubstr("the end is not expected"), HasSubstr("accepted: a value")));
  EXPECT_THAT(complaint("(step = 1"), HasSubstr("accepted: `)`"));
  EXPECT_THAT(complaint("step = 1 step = 2"), HasSubstr("accepted: `and`, `or` or the end"));
  EXPECT_THAT(complaint("encoding in kd_tree"), HasSubstr("accepted: `(`"));
  EXPECT_THAT(complaint("dataset = 'a"), HasSubstr("the quote is not closed"));
  EXPECT_THAT(complaint(""), HasSubstr("accepted: a key"));
  EXPECT_THAT(complaint(std::string(200, '(')), HasSubstr("at most 100"));
}

TEST(PointQueries, KnowEveryKeyOfTheTable) {
  EXPECT_EQ(place_in_record("page_size"), "/build_parameters/page_size");
  EXPECT_EQ(place_in_record("sampling"), "/render/sampling");
  EXPECT_EQ(place_in_record("filters"), "/filter");
  EXPECT_EQ(place_in_record("nothing"), "");
}

}  // namespace
}  // namespace amrtex
