// The page table as a tree: deep corners and wide domains cost what they hold, and lose nothing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "structures/page_table/page_table_plan.hpp"
#include "structures/page_table/page_writer.hpp"
#include "tests/leave_out_cases.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

using namespace test;
using namespace pages;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::int64_t kMiB = std::int64_t{1} << 20;
const std::vector<Filter> kAllFilters{Filter::nearest, Filter::linear_page, Filter::linear_vertex};

EncodingCase page_case(Filter filter, int page_size) {
  const Json parameters{{"page_size", page_size}, {"centring", filter == Filter::linear_vertex ? "node" : "cell"}};
  return {&find_encoding("page_table"), filter, parameters};
}

std::string refusal(const AmrHierarchy& h, const EncodingCase& c, const BuildOptions& options = {}) {
  try {
    build(h, c, options);
    return "built";
  } catch (const Error& e) {
    return e.what();
  }
}

// ---- what is divided ----

TEST(Division, IsThePartitionThatRefinedBoxesTell) {
  for (const NamedMesh& mesh : conformance_meshes())
    for (const int page_size : {4, 8}) {
      const AmrHierarchy& h = mesh.hierarchy;
      const Division division(h, page_size);
      const std::vector<Page> pages = partition(division);
      EXPECT_EQ(division.pages(), std::ssize(pages)) << mesh.name;
      double volume = 0;  // finest cells of the domain
      for (const Page& p : pages) {
        const Vec3i first = p.index_in_level * page_size;
        const Box inside = intersection({first, first + Vec3i(page_size)}, h.domain(p.level));
        EXPECT_FALSE(h.refined_within(p.level, inside)) << mesh.name;
        volume += static_cast<double>(inside.cells()) * std::pow(h.cell_width(p.level), 3);
      }
      const Vec3d finest(h.cells(h.finest_level()));
      const double all = finest.x * finest.y * finest.z;
      EXPECT_LE(volume, all) << mesh.name;
      EXPECT_EQ(pages_without_mesh(division) == 0, volume == all) << mesh.name;
    }
}

// ---- the tree ----

/// The entry of the table that holds a cell of the finest level, as the shader finds it.
std::uint32_t red_at(const EncodedField& field, const Vec3i& cell) {
  const auto words = static_cast<std::size_t>(define(field, "AMRTEX_PAGE_ENTRY_WORDS"));
  const HostTexture& top = *field.find("tex_page_table");
  int width = uniform(field, "u_page_table").x;
  const Vec3i t = cell / width;
  Vec3i corner = t * width;
  std::uint32_t red = top.as<std::uint32_t>()[words * Box{Vec3i(0), top.size}.offset(t)];
  for (std::size_t stage = 0; red >> 30 == AMRTEX_PAGE_SUBTABLE; ++stage) {
    const std::uint32_t* below = field.find("page_stages")->as<std::uint32_t>() + 2 * stage;
    width = static_cast<int>(below[0]);
    const Vec3i s = (cell - corner) / width;
    const std::size_t first = std::size_t{red & 0xffffffU} * AMRTEX_PAGE_NODE_UNIT;
    red = field.find("page_nodes")
              ->as<std::uint32_t>()[words * (first + Box{Vec3i(0), Vec3i(static_cast<int>(below[1]))}.offset(s))];
    corner += s * width;
  }
  return red;
}

TEST(TableTree, HasTheEntriesOfTheOneLevelTable) {
  std::vector<NamedMesh> meshes = conformance_meshes();
  meshes.push_back({"ratios 4, 3, 2", MeshBuilder(Vec3i(12), {4, 3, 2})
                                          .root(waves)
                                          .patch(1, {Vec3i(8), Vec3i(16)}, waves)
                                          .patch(2, {Vec3i(30), Vec3i(36)}, waves)
                                          .patch(3, {Vec3i(62), Vec3i(70)}, waves)
                                          .hierarchy()});
  for (const NamedMesh& mesh : meshes) {
    SCOPED_TRACE(mesh.name);
    const AmrHierarchy& h = mesh.hierarchy;
    const EncodedField one = build(h, page_case(Filter::nearest, 4));
    ASSERT_EQ(one.statistics["table_levels"], 1);
    // the same pages in a tree whose first level has at most 2 entries an axis
    const Division division(h, 4);
    std::vector<Page> pages = partition(division);
    for (Page& p : pages) {
      const std::uint32_t red = red_at(one, p.index_in_level * 4 * h.cell_width(p.level));
      p.kind = static_cast<int>(red >> 30);
      p.index = red & 0xffffffU;
    }
    TablePlan plan;
    plan.tree = TableTree::over(h, division, pages, 2048, 8);
    ASSERT_TRUE(plan.tree);
    plan.top = plan.tree->top();
    plan.entry_width = plan.tree->stages().front().width;
    EncodedField field;
    for (const Part& part : {plan.top_part(), plan.nodes_part(), plan.stages_part()})
      if (part.present) field.textures.push_back(part.allocate());
    write_table(h, plan, pages, field);
    field.integer_uniforms = {{"u_page_table", Vec3i(plan.entry_width, 0, 0)}};
    field.shader.defines = {{"AMRTEX_PAGE_ENTRY_WORDS", plan.entry_words()}};
    EXPECT_EQ(plan.levels() > 1, one.statistics["table_entries"] > 8);
    for_each_cell(h.domain(h.finest_level()).coarsened(2), [&](const Vec3i& c) {
      const Vec3i cell = glm::min(c * 2, h.cells(h.finest_level()) - Vec3i(1));
      EXPECT_EQ(red_at(field, cell), red_at(one, cell));
    });
  }
}

void expect_holds_the_field(const AmrHierarchy& h, int page_size, std::int64_t most_bytes, std::size_t leaves_a_level = 12) {
  const auto positions = probe_positions(h, leaves_a_level);
  for (const Filter filter : kAllFilters) {
    SCOPED_TRACE(fmt::format("{} page_size {}", filter_name(filter), page_size));
    const EncodedField doubles = build(h, page_case(filter, page_size), {.storage = Storage::r64f});
    const Comparison exact = compare_double(h, doubles, positions);
    EXPECT_TRUE(exact) << exact;
    const EncodedField field = build(h, page_case(filter, page_size));
    EXPECT_LE(field.memory().total(), most_bytes);
    EXPECT_LE(field.host_peak_bytes, most_bytes);
    Context& gl = context(ContextKind::egl);
    const Comparison on_gl = compare(positions, reference_values(h, field.definition, positions),
                                     probe_on_gl(gl, h, Structure(gl, field), positions), 1e-5 * value_range(h));
    EXPECT_TRUE(on_gl) << on_gl;
  }
}

TEST(TableTree, DeepCornersCostWhatTheyHold) {
  // each level but the finest has 4^3 - 2^3 leaves, and at most (4 + 1)^3 pages of 4^3 cells about them: 64 pages a level
  for (const int levels : {13, 20, 28}) {
    const AmrHierarchy h = deep_corner(levels);
    ASSERT_EQ(h.leaf_cells(), (levels - 1) * 56 + 64);
    SCOPED_TRACE(levels);
    expect_holds_the_field(h, 4, 64 * levels * 216 * 4 * 2 + 2 * kMiB, 4);
    const EncodedField field = build(h, page_case(Filter::linear_page, 4));
    EXPECT_GT(field.statistics["table_levels"], 2);
    EXPECT_EQ(field.find("tex_page_subtables"), nullptr);
  }
}

TEST(TableTree, TakesRatiosOfAnyKind) {
  std::vector<int> ratios{2, 3, 5, 2, 4, 3, 2, 5, 2};
  MeshBuilder mesh(Vec3i(6), ratios);
  mesh.root(waves);
  Box box{Vec3i(2), Vec3i(4)};
  for (std::size_t l = 0; l < ratios.size(); ++l) {
    mesh.patch(static_cast<int>(l) + 1, box.refined(ratios[l]), waves);
    const Vec3i middle = box.refined(ratios[l]).lower + Vec3i(1);
    box = {middle, middle + Vec3i(1)};
  }
  expect_holds_the_field(mesh.hierarchy(), 4, 64 * kMiB, 3);
}

TEST(TableTree, PagesMayBeWiderThanTheDomain) {
  // 2 root cells of 2^28 finest ones: a page of 8 cells is 2^31 wide, which no int of the shader holds
  const AmrHierarchy h = deep_corner(29, 2);
  const auto positions = probe_positions(h, 2);
  for (const Filter filter : kAllFilters) {
    const EncodedField field = build(h, page_case(filter, 8), {.storage = Storage::r64f});
    const Comparison result = compare_double(h, field, positions);
    EXPECT_TRUE(result) << filter_name(filter) << ": " << result;
  }
}

TEST(TableTree, WideDomainsCostWhatTheyHold) {
  const AmrHierarchy h = two_cells_far_apart();
  for (const int page_size : {4, 16}) expect_holds_the_field(h, page_size, 4 * kMiB, 4);
  // what lies between is passed in few steps: a region there is as wide as the entry of the table that holds it
  const EncodedField field = build(h, page_case(Filter::nearest, 4));
  const std::vector<FinestPosition> between{{{1 << 28, 1 << 19, 1 << 29}, Vec3d(0.5)}};
  EXPECT_FALSE(probe_on_cpu(h, field, Precision::single_precision, between)[0].found);
}

TEST(TableTree, OrdinaryMeshesKeepTheirTable) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, page_case(Filter::linear_page, 4));
  EXPECT_EQ(field.statistics["table_levels"], 1);
  EXPECT_EQ(field.find("page_nodes"), nullptr);
  // root cells 16^3, the corner's 8^3 refined by 2^5: 128^3 entries of 8 bytes are 16 MiB, the pages of 64 cells less than 1 MiB
  const AmrHierarchy fine =
      MeshBuilder(Vec3i(16), std::vector<int>(5, 2)).root(waves).patch(5, {Vec3i(0), Vec3i(32)}, waves).hierarchy();
  for (const int limit : {2048, 127}) {  // the context would take one level, or would not
    ContextInfo context;
    context.max_3d_texture_size = limit;
    const EncodedField two = build(fine, page_case(Filter::nearest, 4), {.storage = Storage::r64f, .limits = context});
    EXPECT_EQ(two.statistics["table_levels"], 2);
    EXPECT_EQ(define(two, "AMRTEX_PAGE_TABLE_TREE"), 0);
    EXPECT_NE(two.find("tex_page_subtables"), nullptr);
    const Comparison result = compare_double(fine, two, probe_positions(fine, 30));
    EXPECT_TRUE(result) << result;
  }
}

// ---- refusals ----

TEST(TableTree, RefusesByTheBoxesWhatNobodyCouldList) {
  // the finest cell lies in the first of 2 root cells an axis: its page is divided into (200000 / 4)^3 of the next level
  const AmrHierarchy h = MeshBuilder(Vec3i(2), {100000, 2})
                             .patch(0, {{1, 1, 1}, {2, 2, 2}}, constant(1))
                             .patch(2, {Vec3i(0), Vec3i(2)}, constant(2))
                             .hierarchy();
  const std::int64_t before = peak_bytes();
  EXPECT_THAT(refusal(h, page_case(Filter::nearest, 4)),
              AllOf(HasSubstr("encoding page_table with page_size 4"), HasSubstr("pages"), HasSubstr("at most 16777216"),
                    HasSubstr("a larger page_size")));
  EXPECT_LT(peak_bytes() - before, 16 * kMiB);
}

TEST(TableTree, RefusesWhatIsSurelyStoredBeforeItIsRead) {
  const AmrHierarchy h = MeshBuilder(Vec3i(96)).root(waves).hierarchy();
  for (const Filter filter : kAllFilters) {
    // 24^3 pages of at least 64 texels: 3.5 MB
    EXPECT_THAT(
        refusal(h, page_case(filter, 4), {.memory_limit = kMiB}),
        AllOf(HasSubstr("the memory limit is 1048576 bytes"), HasSubstr("of 13824 pages are stored"), HasSubstr("at least")));
    ContextInfo limits;
    limits.max_texture_bytes = kMiB / 8;  // of 8 textures
    EXPECT_THAT(refusal(h, page_case(filter, 4), {.limits = limits}),
                AllOf(HasSubstr("and 131072 bytes"), HasSubstr("in 8 textures a field")));
  }
  // constant pages are not stored: what seems too much may fit
  const AmrHierarchy flat = MeshBuilder(Vec3i(96)).root(constant(2)).hierarchy();
  for (const Filter filter : kAllFilters) EXPECT_EQ(refusal(flat, page_case(filter, 4), {.memory_limit = kMiB}), "built");
}

}  // namespace
}  // namespace amrtex
