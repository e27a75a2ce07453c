// Facts of `exabricks` alone; what every encoding must do is in tests/.
#include "structures/exabricks/exabricks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "structures/exabricks/bricks.hpp"
#include "structures/exabricks/regions.hpp"
#include "structures/random_mesh.hpp"
#include "tests/encoding_cases.hpp"

namespace amrtex {
namespace {

using namespace test;

EncodedField exa_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object(),
                       const BuildOptions& options = {}) {
  return build(h, {&find_encoding("exabricks"), filter, parameters}, options);
}

TEST(Exabricks, DoubleIsTheReferenceOnRandomMeshes) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const AmrHierarchy h(random_mesh(seed, {.max_finest_cells = 1 << 15}));
    const auto positions = probe_positions(h, 40, seed);
    for (const Json& parameters :
         {Json::object(), Json{{"border", 0}}, Json{{"brick_width", 2}}, Json{{"brick_width", 3}, {"border", 0}},
          Json{{"locate", "cells"}}, Json{{"traversal", "bvh"}}, Json{{"traversal", "kd"}}}) {
      SCOPED_TRACE(fmt::format("seed {}: {}", seed, parameters.dump()));
      const EncodedField field = exa_field(h, Filter::basis, parameters, {.storage = Storage::r64f});
      const Comparison result = compare_double(h, field, positions);
      EXPECT_TRUE(result) << result;
    }
  }
}

}  // namespace
}  // namespace amrtex
