// The list of filters, and that everything that follows from it does.
#include "structures/mesh/filter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <sstream>
#include <string>

#include "renderers/reference/hierarchy_reference.hpp"
#include "shaders/shader_library.hpp"
#include "structures/mesh/error.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::HasSubstr;

std::string upper_case(std::string_view name) {
  std::string text(name);
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string contract() {
  for (const ShaderFile& file : shader_files())
    if (file.path == "contract.glsl") return std::string(file.text);
  return "";
}

TEST(Filters, HaveTheSameNumbersInTheShaders) {
  for (const FilterInfo& info : kFilterTable)
    EXPECT_THAT(contract(),
                HasSubstr(fmt::format("#define AMRTEX_FILTER_{} {}\n", upper_case(info.name), static_cast<int>(info.filter))));
}

TEST(Filters, AreFoundByTheirNames) {
  for (const FilterInfo& info : kFilterTable) EXPECT_EQ(parse_filter(info.name), info.filter);
  try {
    parse_filter("cubic");
    ADD_FAILURE() << "no such filter";
  } catch (const UsageError& error) {
    for (const FilterInfo& info : kFilterTable) EXPECT_THAT(error.what(), HasSubstr(std::string(info.name)));
  }
}

TEST(Filters, AreDefinedInTheDocumentation) {
  std::ifstream file(fmt::format("{}/docs/filters.md", AMRTEX_SOURCE_DIR));
  std::stringstream text;
  text << file.rdbuf();
  for (const FilterInfo& info : kFilterTable) EXPECT_THAT(text.str(), HasSubstr(fmt::format("| `{}` |", info.name)));
}

TEST(Filters, HaveAReferenceThatReproducesAConstant) {
  const AmrHierarchy h = nested([](const Vec3d&) { return 3.25; }).hierarchy();
  for (const Filter filter : all_filters())
    EXPECT_EQ(HierarchyReference(h, 0, {filter}).sample(Vec3d(0.4, 0.3, 0.6)), 3.25) << filter_name(filter);
}

/// Values on both sides of every face between levels, on rays along all axes.
double largest_jump(const AmrHierarchy& h, const FilterDefinition& definition) {
  const HierarchyReference reference(h, 0, definition);
  const Vec3d size(h.cells(h.finest_level()));
  double jump = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (int plane = 1; plane < static_cast<int>(size[axis]); ++plane) {
      Vec3d p = size * Vec3d(0.41, 0.37, 0.53);
      p[axis] = plane - 1e-9;
      Vec3d q = p;
      q[axis] = plane + 1e-9;
      const auto below = reference.sample(*position_at(h, p)), above = reference.sample(*position_at(h, q));
      if (below && above) jump = std::max(jump, std::abs(*above - *below));
    }
  return jump;
}

TEST(Filters, AreContinuousAsTheirRowSays) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const FilterInfo& info : kFilterTable) {
    const FilterDefinition definition{info.filter, info.continuity == Continuity::page ? 2 : 0, 0};
    if (definition.continuous_everywhere())
      EXPECT_LT(largest_jump(h, definition), 1e-6) << info.name;
    else
      EXPECT_GT(largest_jump(h, definition), 1e-4) << info.name;
  }
}

}  // namespace
}  // namespace amrtex
