// Facts of `page_table` alone; what every encoding must do is in tests/.
#include "structures/page_table/page_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "structures/generators/synthetic.hpp"
#include "structures/page_table/page_table_layout.h"
#include "tests/leave_out_cases.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

EncodedField page_field(const AmrHierarchy& h, Filter filter, int page_size, const BuildOptions& options = {}) {
  const Json parameters{{"page_size", page_size}, {"centring", filter == Filter::linear_vertex ? "node" : "cell"}};
  return build(h, {&find_encoding("page_table"), filter, parameters}, options);
}

double cube(double x) { return x * x * x; }

/// 16^3 root cells, of which 4^3 in the corner are refined.
AmrHierarchy refined_corner(const Function& f = waves) {
  return MeshBuilder(Vec3i(16), {2}).root(f).patch(1, {Vec3i(0), Vec3i(8)}, f).hierarchy();
}

// ---- the partition ----

TEST(PageTable, PagesOfAHandMadeMesh) {
  struct Expected {
    int page_size;
    std::vector<int> pages_a_level;
    int table_entries;
  };
  // p = 4: one of 64 root pages becomes 8. p = 8: one of 8 becomes 8. p = 16: the only one becomes 8.
  // p = 32: the only one becomes one of level 1 in the domain, whose 32^3 cells it holds exactly
  const std::vector<Expected> table{{4, {63, 8}, 512}, {8, {7, 8}, 64}, {16, {0, 8}, 8}, {32, {0, 1}, 8}};
  const AmrHierarchy h = refined_corner();
  for (const Expected& e : table)
    for (const Filter filter : {Filter::nearest, Filter::linear_page, Filter::linear_vertex}) {
      const EncodedField field = page_field(h, filter, e.page_size);
      EXPECT_EQ(field.statistics["pages_a_level"], Json(e.pages_a_level)) << e.page_size;
      EXPECT_EQ(field.statistics["pages"], e.pages_a_level[0] + e.pages_a_level[1]);
      EXPECT_EQ(field.statistics["table_levels"], 1);
      EXPECT_EQ(field.statistics["table_entries"], e.table_entries);
      EXPECT_EQ(field.find("tex_page_table")->texels(), e.table_entries);
      // stored cells over leaf cells: pages finer than their leaves repeat them
      const double stored = (e.pages_a_level[0] + e.pages_a_level[1]) * cube(e.page_size);
      EXPECT_DOUBLE_EQ(field.statistics["oversampling"].get<double>(), stored / (4096 - 64 + 512));
    }
}

TEST(PageTable, PagesThatOverhangTheDomainPadIt) {
  // 9 x 8 x 11 cells in pages of 4: 3 x 2 x 3 pages; payload is the cells alone
  const EncodedField field = page_field(single_level(waves).hierarchy(), Filter::nearest, 4);
  EXPECT_EQ(field.statistics["pages"], 18);
  EXPECT_EQ(field.memory().payload, 4 * 9 * 8 * 11);
  EXPECT_EQ(field.memory().duplicated, 0);
  EXPECT_GE(field.memory().padding, 4 * (18 * 64 - 9 * 8 * 11));
}

// ---- memory ----

TEST(PageTable, BordersCostTheirFormula) {
  // cell-centred (p + 2)^3 / p^3 - 1, node-centred (1 + 1/p)^3 - 1, nearest nothing; to the texel
  const AmrHierarchy h = MeshBuilder(Vec3i(16), {2}).root(waves).patch(1, {Vec3i(16), Vec3i(32)}, waves).hierarchy();
  for (const int p : {4, 8, 16}) {
    const auto check = [&](Filter filter, std::int64_t edge) {
      const EncodedField field = page_field(h, filter, p);
      const auto pages = field.statistics["pages"].get<std::int64_t>();
      const std::int64_t border = edge * edge * edge - p * p * p;
      EXPECT_EQ(field.statistics["page_texels"], edge * edge * edge);
      EXPECT_EQ(field.find("tex_pages")->roles.duplicated, 4 * pages * border);
      EXPECT_EQ(field.find("tex_pages")->roles.payload, 4 * pages * p * p * p);
      EXPECT_DOUBLE_EQ(field.statistics["border_overhead"].get<double>(), cube(static_cast<double>(edge) / p) - 1);
      EXPECT_EQ(field.memory().duplicated, 4 * pages * border);
    };
    check(Filter::linear_page, p + 2);
    check(Filter::linear_vertex, p + 1);
    check(Filter::nearest, p);
  }
}

TEST(PageTable, NearestSaysWhatItsBordersWouldHaveCost) {
  const AmrHierarchy h = refined_corner();
  const EncodedField field = page_field(h, Filter::nearest, 4);
  const auto it =
      std::find_if(field.left_out.begin(), field.left_out.end(), [](const LeftOut& l) { return l.what == "border layer"; });
  ASSERT_NE(it, field.left_out.end());
  EXPECT_EQ(it->bytes, page_field(h, Filter::linear_page, 4).memory().duplicated);
}

TEST(PageTable, MemoryIsTheSumOfItsTexels) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  for (const Storage storage : {Storage::r8, Storage::r16f, Storage::r32f}) {
    const EncodedField field = page_field(h, Filter::linear_page, 4, {.storage = storage});
    std::int64_t bytes = 0;
    for (const HostTexture& t : field.textures) bytes += t.texels() * texel_bytes(t.format);
    EXPECT_EQ(field.memory().total(), bytes);
    EXPECT_EQ(field.find("tex_pages")->bytes(), field.value_texels() * texel_bytes(storage));
    // 64 cells a page: two words of bits
    EXPECT_EQ(field.find("page_validity")->texels(), 2 * field.statistics["pages"].get<std::int64_t>());
  }
}

// In double and to the bit, at every leaf; the same pages, so many bytes more as the last texture has room.
TEST(PageTable, IsDividedOverTexturesWhereOneHoldsTooFewPages) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  for (const Filter filter : find_encoding("page_table").filters()) {
    const EncodedField one = page_field(h, filter, 4, {.storage = Storage::r64f});
    const std::int64_t pages = one.statistics["pages"].get<std::int64_t>();
    const std::int64_t page_bytes = 8 * one.statistics["page_texels"].get<std::int64_t>();
    for (const std::int64_t textures : {1, 2, 3, 8}) {
      ContextInfo limits;
      // rows of pages are powers of two: room for twice as many surely holds them
      limits.max_texture_bytes = std::max(2 * pages * page_bytes / textures, page_bytes);
      const EncodedField several = page_field(h, filter, 4, {.storage = Storage::r64f, .limits = limits});
      const auto taken = several.statistics["pool_textures"].get<std::int64_t>();
      EXPECT_LE(taken, textures);
      EXPECT_TRUE(textures < 8 || taken > 1) << taken;
      EXPECT_EQ(several.statistics["pages"], pages);
      EXPECT_EQ(several.memory().payload, one.memory().payload);
      EXPECT_EQ(several.memory().duplicated, one.memory().duplicated);
      for (const HostTexture& t : several.textures)
        EXPECT_TRUE(!t.holds_values || t.bytes() <= limits.max_texture_bytes) << t.name;
      const Comparison result = compare_double(h, several, probe_positions(h, 30));
      EXPECT_TRUE(result) << result;
    }
  }
}

TEST(PageTable, ConstantPagesCostAnEntryAndNoPage) {
  const auto with = [](const Vec3i& odd) {
    return MeshBuilder(Vec3i(16)).root([=](const Vec3d& p) { return Vec3i(p * 16.0) == odd ? 3.0 : 2.0; }).hierarchy();
  };
  const AmrHierarchy constant_mesh = with(Vec3i(-1));
  const AmrHierarchy inside = with({5, 5, 5});
  const AmrHierarchy at_face = with({4, 5, 5});
  const auto pages = [](const AmrHierarchy& h, Filter filter) {
    const EncodedField field = page_field(h, filter, 4);
    EXPECT_EQ(field.statistics["pages"].get<int>() + field.statistics["constant_pages"].get<int>(), 64);
    const Comparison result = compare_double(h, page_field(h, filter, 4, {.storage = Storage::r64f}), probe_positions(h, 300));
    EXPECT_TRUE(result) << result;
    EXPECT_EQ(field.memory().payload, field.statistics["pages"].get<int>() * 64 * 4);
    return field.statistics["pages"].get<int>();
  };
  for (const Filter filter : {Filter::nearest, Filter::linear_page, Filter::linear_vertex}) {
    EXPECT_EQ(pages(constant_mesh, filter), 0);
    EXPECT_EQ(pages(inside, filter), 1);
  }
  EXPECT_EQ(pages(at_face, Filter::nearest), 1);
  EXPECT_EQ(pages(at_face, Filter::linear_page), 2) << "a page is constant only if its border is";
  EXPECT_EQ(pages(at_face, Filter::linear_vertex), 2);
  EXPECT_EQ(page_field(constant_mesh, Filter::nearest, 4).find("tex_page_table")->texels(), 64);
}

TEST(PageTable, AbsentPagesCostAnEntryAndNoPage) {
  // one half of the domain is a hole
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).patch(0, {{8, 0, 0}, {16, 16, 16}}, waves).hierarchy();
  for (const Filter filter : {Filter::nearest, Filter::linear_page, Filter::linear_vertex}) {
    const EncodedField field = page_field(h, filter, 4);
    EXPECT_EQ(field.statistics["absent_pages"], 32);
    EXPECT_EQ(field.statistics["pages"], 32);
    EXPECT_EQ(field.memory().payload, 32 * 64 * 4);
    EXPECT_EQ(field.find("tex_page_table")->texels(), 64);
  }
}

TEST(PageTable, SeveralFieldsShareATableAndStoreWhatAnyOfThemHas) {
  // of the 8 x 2 x 2 root pages of 4^3 cells the first field has none in x < 16, both miss [24, 30) x [4, 8) x [0, 4)
  const AmrHierarchy h = fields_with_gaps().hierarchy();
  const EncodedField both = page_field(h, Filter::nearest, 4, {.more_fields = {1}});
  const EncodedField first = page_field(h, Filter::nearest, 4);
  const auto count = [](const EncodedField& f, const char* what) { return f.statistics[what].get<std::int64_t>(); };
  EXPECT_EQ(count(first, "pages"), count(both, "pages") - 16);
  EXPECT_EQ(count(both, "pages") + count(both, "absent_pages"), count(first, "pages") + count(first, "absent_pages"));
  EXPECT_GT(count(both, "absent_pages"), 0);
  EXPECT_EQ(both.find("tex_pages[1]")->roles, both.find("tex_pages")->roles);
  EXPECT_EQ(both.find("page_validity")->texels(), 2 * 2 * count(both, "pages")) << "64 bits a page and field";
}

TEST(PageTable, SeveralFieldsHaveNoConstantPages) {
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(constant(2)).also("g", constant(3)).hierarchy();
  EXPECT_EQ(page_field(h, Filter::linear_page, 4).statistics["constant_pages"], 64);
  const EncodedField both = page_field(h, Filter::linear_page, 4, {.more_fields = {1}});
  EXPECT_EQ(both.statistics["constant_pages"], 0);
  EXPECT_EQ(both.statistics["pages"], 64);
  for (const auto& [name, value] : both.shader.defines)
    if (name == "AMRTEX_PAGE_CONSTANTS") {
      EXPECT_EQ(value, 0);
    }
}

// ---- the table ----

TEST(PageTable, LayoutFillsAnEntryWithoutOverlap) {
  static_assert(AMRTEX_PAGE_INDEX_BITS + AMRTEX_PAGE_LEVEL_BITS + 2 == 32);
  static_assert(AMRTEX_PAGE_ABSENT == 0, "a zeroed table holds no mesh");
  static_assert(AMRTEX_PAGE_STORED < 4 && AMRTEX_PAGE_CONSTANT < 4 && AMRTEX_PAGE_SUBTABLE < 4);
  EXPECT_EQ(std::set<int>({AMRTEX_PAGE_ABSENT, AMRTEX_PAGE_STORED, AMRTEX_PAGE_CONSTANT, AMRTEX_PAGE_SUBTABLE}).size(), 4u);
}

struct Entry {
  int kind, level, index;
};

/// Decoded with the layout's numbers.
Entry entry_at(const EncodedField& field, const Vec3i& i) {
  const HostTexture& table = *field.find("tex_page_table");
  const std::size_t words = static_cast<std::size_t>(texel_bytes(table.format)) / 4;
  const std::uint32_t red = table.as<std::uint32_t>()[words * Box{Vec3i(0), table.size}.offset(i)];
  return {static_cast<int>(red >> (AMRTEX_PAGE_INDEX_BITS + AMRTEX_PAGE_LEVEL_BITS)),
          static_cast<int>((red >> AMRTEX_PAGE_INDEX_BITS) & ((1U << AMRTEX_PAGE_LEVEL_BITS) - 1)),
          static_cast<int>(red & ((1U << AMRTEX_PAGE_INDEX_BITS) - 1))};
}

TEST(PageTable, EntriesHoldWhatTheLayoutSays) {
  const AmrHierarchy h = refined_corner();
  const EncodedField field = page_field(h, Filter::nearest, 4);
  std::set<int> indices;
  for_each_cell(Box{Vec3i(0), Vec3i(8)}, [&](const Vec3i& i) {
    const Entry e = entry_at(field, i);
    EXPECT_EQ(e.kind, AMRTEX_PAGE_STORED);
    EXPECT_EQ(e.level, glm::all(glm::lessThan(i, Vec3i(2))) ? 1 : 0);
    indices.insert(e.index);
  });
  EXPECT_EQ(indices.size(), 71u);
  EXPECT_EQ(*indices.rbegin(), 70);
  // the shader reads the same level and index
  for (const auto& [cell, level] : {std::pair(Vec3i(3, 3, 3), 1), std::pair(Vec3i(20, 1, 1), 0)}) {
    const std::vector<FinestPosition> at{{cell, Vec3d(0.5)}};
    EXPECT_EQ(probe_on_cpu(h, field, Precision::single_precision, at)[0].level, level);
  }
}

TEST(PageTable, ThirteenLevelsTakeATreeOfTablesAndHoldTheField) {
  // 16 * 2^12 = 65536 cells along an axis: one table would have 16384^3 entries
  const AmrHierarchy h(generate_mesh(Json::parse(
      R"({"field": {"type": "sum", "terms": [{"type": "linear", "gradient": [1, 2, 3]}, {"type": "blobs"}]},
          "levels": 13, "root": 16, "patch": 4, "refine": {"criterion": "nested", "center": [0.51, 0.43, 0.62]}})")));
  ASSERT_EQ(h.level_count(), 13);
  ASSERT_GT(h.leaf_cells(12), 0);
  const auto positions = probe_positions(h, 30);
  for (const Filter filter : {Filter::nearest, Filter::linear_page, Filter::linear_vertex}) {
    const EncodedField field = page_field(h, filter, 4, {.storage = Storage::r64f});
    EXPECT_GT(field.statistics["table_levels"], 2);
    EXPECT_GT(field.statistics["subtables"].get<int>(), 0);
    EXPECT_LT(field.find("page_nodes")->bytes(), field.find("tex_pages")->bytes()) << "the table costs less than its pages";
    const Comparison result = compare_double(h, field, positions);
    EXPECT_TRUE(result) << filter_name(filter) << ": " << result;
    const EncodedField floats = page_field(h, filter, 4);
    Context& gl = context(ContextKind::egl);
    const Comparison on_gl = compare(positions, reference_values(h, floats.definition, positions),
                                     probe_on_gl(gl, h, Structure(gl, floats), positions), 1e-5 * value_range(h));
    EXPECT_TRUE(on_gl) << filter_name(filter) << ": " << on_gl;
  }
}

// ---- refusals ----

TEST(PageTable, RefusesBadParametersWithWhatIsAccepted) {
  const AmrHierarchy h = refined_corner();
  const auto message = [&](Filter filter, const Json& parameters) -> std::string {
    try {
      build(h, {&find_encoding("page_table"), filter, parameters});
      return "built";
    } catch (const UsageError& e) {
      return fmt::format("usage: {}", e.what());
    } catch (const UnsupportedError& e) {
      return fmt::format("unsupported: {}", e.what());
    }
  };
  for (const Json& bad : {Json(0), Json(2), Json(3), Json(12), Json(256), Json(-4), Json("8"), Json(8.5), Json(nullptr)})
    EXPECT_THAT(message(Filter::nearest, {{"page_size", bad}}),
                AllOf(HasSubstr("usage: encoding page_table"), HasSubstr("page_size"), HasSubstr("4, 8, 16, 32, 64 or 128")))
        << bad.dump();
  for (const Json& bad : {Json("vertex"), Json(1), Json(nullptr)})
    EXPECT_THAT(message(Filter::nearest, {{"centring", bad}}),
                AllOf(HasSubstr("usage:"), HasSubstr("centring"), HasSubstr("\"cell\" or \"node\"")));
  for (const auto& [filter, centring] :
       {std::pair(Filter::nearest, "node"), std::pair(Filter::linear_page, "node"), std::pair(Filter::linear_vertex, "cell")})
    EXPECT_THAT(message(filter, {{"centring", centring}}),
                AllOf(HasSubstr("unsupported:"), HasSubstr(centring), HasSubstr(std::string(filter_name(filter))),
                      HasSubstr("centring node has linear_vertex")));
}

TEST(PageTable, NamesTheLimitThatItWouldPass) {
  const AmrHierarchy h = MeshBuilder(Vec3i(80)).root(waves).hierarchy();
  BuildRequest request;
  request.memory_limit = 1 << 20;
  try {
    find_encoding("page_table").build(h, request);
    ADD_FAILURE();
  } catch (const BudgetError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("encoding page_table"), HasSubstr("memory limit is 1048576 bytes"), HasSubstr("MiB")));
  }
  request.memory_limit = std::numeric_limits<std::int64_t>::max();
  request.context.max_3d_texture_size = 20;  // 5^3 pages of 16^3, of which a texture holds one
  try {
    find_encoding("page_table").build(h, request);
    ADD_FAILURE();
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("125 pages of 16^3 texels"), HasSubstr("8 3D textures of 20 texels an axis")));
  }
}

// ---- controls ----

class PageTableControl : public testing::Test {
 protected:
  AmrHierarchy h_ = nested(waves).hierarchy();
  std::vector<FinestPosition> positions_ = probe_positions(h_, 1000);  // every leaf

  bool noticed(const EncodedField& field) {
    try {
      return !compare_double(h_, field, positions_);
    } catch (const Error&) {
      return true;
    }
  }
  static Vec3i pool_position(const EncodedField& field, int index) {
    for (const auto& [name, shift] : field.integer_uniforms)
      if (name == "u_pool_shift")
        return {index & ((1 << shift.x) - 1), (index >> shift.x) & ((1 << shift.y) - 1), index >> (shift.x + shift.y)};
    return Vec3i(0);
  }
};

TEST_F(PageTableControl, OnePagesBorderShiftedByOneCell) {
  const EncodedField field = page_field(h_, Filter::linear_page, 4, {.storage = Storage::r64f});
  ASSERT_FALSE(noticed(field));
  int caught = 0;
  const int pages = field.statistics["pages"].get<int>();
  for (int page = 0; page < pages; ++page) {
    EncodedField copy = field;
    HostTexture& pool =
        *std::find_if(copy.textures.begin(), copy.textures.end(), [](const HostTexture& t) { return t.name == "tex_pages"; });
    const Box all{Vec3i(0), pool.size};
    const Vec3i first = pool_position(field, page) * 6;
    // the layer before the page's first cells, along y
    for (int z = 0; z < 6; ++z)
      for (int y = 0; y < 5; ++y)
        pool.as<double>()[all.offset(first + Vec3i(0, y, z))] =
            field.find("tex_pages")->as<double>()[all.offset(first + Vec3i(0, y + 1, z))];
    caught += noticed(copy) ? 1 : 0;
  }
  EXPECT_GT(caught, pages * 8 / 10);
}

TEST_F(PageTableControl, AnEntrysLevelAndTwoEntriesSwapped) {
  for (const Filter filter : {Filter::nearest, Filter::linear_page, Filter::linear_vertex}) {
    const EncodedField field = page_field(h_, filter, 4, {.storage = Storage::r64f});
    ASSERT_FALSE(noticed(field));
    const auto with = [&](const auto& change) {
      EncodedField copy = field;
      for (HostTexture& t : copy.textures)
        if (t.name == "tex_page_table") change(t, static_cast<std::int64_t>(texel_bytes(t.format)));
      return copy;
    };
    // an entry in a coarse leaf may stay right by chance: a finer page repeats that leaf's value
    int caught = 0;
    for (int k = 0; k < 8; ++k)
      caught += noticed(with([k](HostTexture& t, std::int64_t bytes) {
        t.as<std::uint32_t>()[static_cast<std::size_t>(t.texels() * k / 8 + 37) * static_cast<std::size_t>(bytes / 4)] ^=
            1U << AMRTEX_PAGE_INDEX_BITS;
      }))
                    ? 1
                    : 0;
    EXPECT_GE(caught, 4);
    EXPECT_TRUE(noticed(with([](HostTexture& t, std::int64_t bytes) {
      const auto last = t.data.end() - bytes;
      std::swap_ranges(t.data.begin(), t.data.begin() + bytes, last - bytes * (t.texels() / 2));
    })));
    EXPECT_TRUE(noticed(with([](HostTexture& t, std::int64_t bytes) { std::fill_n(t.data.begin(), bytes, std::byte{0}); })))
        << "absent";
  }
}

// ---- pruning ----

HiddenTexels hidden_pages(const EncodedField& f, const TransferFunction& tf) {
  HiddenTexels count;
  const HostTexture& pool = *f.find("tex_pages");
  const int edge = define(f, "AMRTEX_PAGE_EDGE");
  const Vec3i shift = uniform(f, "u_pool_shift");
  for (int i = 0; i < f.statistics.at("pages").get<int>(); ++i) {
    const Vec3i at = Vec3i(i & ((1 << shift.x) - 1), (i >> shift.x) & ((1 << shift.y) - 1), i >> (shift.x + shift.y)) * edge;
    const Box texels{at, at + Vec3i(edge)};
    count.all += texels.cells();
    if (!shows(tf, f, pool, texels)) count.hidden += texels.cells();
  }
  return count;
}

TEST(PageTablePrune, DropsNineTenthsOfThePagesThatAreHidden) {
  for (const Filter filter : find_encoding("page_table").filters())
    expect_drops_what_is_hidden(
        default_case(find_encoding("page_table"), filter),
        [](const AmrHierarchy&, const EncodedField& f, const TransferFunction& tf) { return hidden_pages(f, tf); });
}

TEST(PageTablePrune, KeepsTheRegionsThatRaysMeet) {
  for (const Filter filter : find_encoding("page_table").filters())
    expect_same_steps(default_case(find_encoding("page_table"), filter));
}

TEST(PageTable, NearestVolumesHoldPagesAndTableAndFivePercent) {
  expect_nearest_holds_little_more("page_table", [](const AmrHierarchy&, const EncodedField& f) {
    return counted(f, "pages") * counted(f, "page_texels") * 4 + counted(f, "table_entries") * 8;
  });
}

}  // namespace
}  // namespace amrtex
