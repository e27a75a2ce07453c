// Facts of example_encoding alone; what every encoding must do is in tests/.
#include "tests/example_encoding/example_encoding.hpp"

#include <gtest/gtest.h>

#include "tests/encoding_cases.hpp"

namespace amrtex {
namespace {

using namespace test;

EncodedField example_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object()) {
  return build(h, {&find_encoding("example_encoding"), filter, parameters}, {});
}

TEST(ExampleEncoding, StoresTheBricksThatHoldALeafOfTheirLevel) {
  // 8 x 4 x 4 cells, of which the first 4 x 4 x 4 are refined: one brick of the root is left, and 2^3 of the finer level
  const AmrHierarchy h = MeshBuilder({8, 4, 4}, {2}).root(waves).patch(1, {Vec3i(0), Vec3i(8)}, waves).hierarchy();
  const EncodedField field = example_field(h, Filter::nearest);
  EXPECT_EQ(field.statistics["bricks"], 1 + 8);
  EXPECT_EQ(field.find("hashed_table")->texels(), 32) << "2 x 9 entries, rounded up to a power of two";
  EXPECT_EQ(field.memory().payload, (64 + 8 * 64) * 4);
}

TEST(ExampleEncoding, ASearchIsShorterInALargerTable) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField small = example_field(h, Filter::nearest, {{"table_factor", 2}});
  const EncodedField large = example_field(h, Filter::nearest, {{"table_factor", 8}});
  EXPECT_GE(small.statistics["longest_search"].get<int>(), large.statistics["longest_search"].get<int>());
  EXPECT_EQ(large.find("hashed_table")->bytes(), 4 * small.find("hashed_table")->bytes());
}

}  // namespace
}  // namespace amrtex
