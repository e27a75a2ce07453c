#include "tests/example_encoding/example_encoding.hpp"

#include <fmt/format.h>
#include <sys/types.h>  // uint, the word of the shared layout

#include <array>
#include <bit>
#include <map>
#include <tuple>

#include "structures/common/build_tools.hpp"
#include "structures/common/layout.hpp"
#include "structures/mesh/level_values.hpp"
#include "tests/example_encoding/example_encoding_layout.h"

namespace amrtex {
namespace {

constexpr std::array<Filter, 2> kFilters{Filter::nearest, Filter::linear_lod};
constexpr int kEdge = AMRTEX_HASHED_EDGE;
constexpr int kMostLevels = 1 << AMRTEX_HASHED_LEVEL_BITS;
constexpr std::int64_t kMostBricks = (std::int64_t{1} << (32 - AMRTEX_HASHED_LEVEL_BITS)) - 2;

/// 4^3 cells of one level, of which at least one is a leaf.
struct Brick {
  int level;
  Vec3i place;               ///< lower corner in its level, in bricks
  std::uint64_t leaves = 0;  ///< one bit a cell, x fastest
  Box cells() const { return Box{place, place + Vec3i(1)}.refined(kEdge); }
};

/// In the order of level, z, y, x.
std::vector<Brick> find_bricks(const AmrHierarchy& h) {
  std::map<std::tuple<int, int, int, int>, Brick> found;
  for (int level = 0; level < h.level_count(); ++level)
    for (std::size_t number = 0; number < h.patches(level).size(); ++number) {
      const Box& box = h.patches(level)[number].box;
      const auto mask = h.leaf_mask(level, static_cast<int>(number));
      for_each_cell(box.coarsened(kEdge), [&](const Vec3i& place) {
        Brick brick{level, place};
        for_each_cell(intersection(box, brick.cells()), [&](const Vec3i& cell) {
          if (mask[box.offset(cell)] != 0) brick.leaves |= std::uint64_t{1} << brick.cells().offset(cell);
        });
        if (brick.leaves == 0) return;
        const auto [known, added] = found.try_emplace({level, place.z, place.y, place.x}, brick);
        known->second.leaves |= brick.leaves;
      });
    }
  std::vector<Brick> bricks;
  for (const auto& [key, brick] : found) bricks.push_back(brick);
  return bricks;
}

/// What follows from the bricks and the request before any value is read.
struct Plan {
  std::vector<Brick> bricks;
  int fields;
  int border;            ///< texels around a brick's own
  bool validity;         ///< some cell has no value
  std::int64_t entries;  ///< of the table
  Vec3i pool{1};         ///< bricks along each axis

  std::int64_t count() const { return static_cast<std::int64_t>(bricks.size()); }
  int edge() const { return kEdge + 2 * border; }
  Vec3i texels() const { return pool * edge(); }
  Vec3i texel_of(std::size_t brick) const {
    const auto i = static_cast<int>(brick);
    return Vec3i(i % pool.x, i / pool.x % pool.y, i / (pool.x * pool.y)) * edge();
  }
};

class ExampleEncoding final : public Encoding {
 public:
  std::string_view name() const override { return "example_encoding"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"table_factor", "entries of the hash table a brick, before rounding up to a power of two", 2, choices({2, 4, 8})}};
  }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Plan plan(const AmrHierarchy& hierarchy, const BuildRequest& request, const Json& parameters) const;
  Layout layout(const BuildRequest& request, const Plan& p) const;
};

/// Bricks along the axes of a pool as near to a cube as may be.
Vec3i lay_out(std::int64_t bricks) {
  int side = 1;
  while (std::int64_t{side} * side * side < bricks) ++side;
  const auto layer = std::int64_t{side} * side;
  return {side, side, static_cast<int>(std::max<std::int64_t>((bricks + layer - 1) / layer, 1))};
}

Plan ExampleEncoding::plan(const AmrHierarchy& h, const BuildRequest& request, const Json& parameters) const {
  if (h.level_count() > kMostLevels)
    throw UnsupportedError(
        fmt::format("encoding example_encoding: {} levels; an entry of the table tells {}", h.level_count(), kMostLevels));
  Plan p{};
  p.bricks = find_bricks(h);
  if (p.count() > kMostBricks)
    throw UnsupportedError(
        fmt::format("encoding example_encoding: {} bricks; an entry of the table numbers {}", p.count(), kMostBricks));
  p.fields = request.field_count();
  p.border = interpolates(request.needs.filter) || request.needs.keeps_border() ? 1 : 0;
  p.validity = any_missing(h, request);
  const std::int64_t wanted = std::max<std::int64_t>(p.count(), 1) * parameters.at("table_factor").get<int>();
  p.entries = static_cast<std::int64_t>(std::bit_ceil(static_cast<std::uint64_t>(wanted)));
  p.pool = lay_out(p.count());
  return p;
}

Layout ExampleEncoding::layout(const BuildRequest& request, const Plan& p) const {
  Layout layout(*this, request);
  std::int64_t own = 0;
  for (const Brick& b : p.bricks) own += std::popcount(b.leaves);
  const std::int64_t stored = p.count() * p.edge() * p.edge() * p.edge();
  for (int number = 0; number < p.fields; ++number)
    layout.add(layout.values("tex_hashed", number, p.texels()).holding({.payload = own, .duplicated = stored - own}));
  layout.add(buffer_part("hashed_table", "entries of the hash table", TexelFormat::rgba32ui, p.entries));
  layout.add(buffer_part("hashed_leaves", "leaf bits", TexelFormat::rg32ui, p.count()));
  layout.add(buffer_part("hashed_validity", "validity bits", TexelFormat::rg32ui, p.count() * p.fields)
                 .when(p.validity, "every cell has a value", Need::validity));
  layout.add(buffer_part("hashed_ranges", "value ranges", TexelFormat::r32ui, p.count())
                 .when(request.needs.value_ranges, "no region is skipped", Need::value_ranges));
  layout.add(layout.more_ranges("hashed_more_ranges", p.count()));
  if (p.border == 0)
    layout.leave_out({"border layer", "the filter nearest reads one cell",
                      layout.value_bytes(p.count() * ((kEdge + 2) * (kEdge + 2) * (kEdge + 2) - kEdge * kEdge * kEdge)),
                      Need::border});
  layout.add_working(p.count() * static_cast<std::int64_t>(sizeof(Brick)));
  return layout;
}

/// Fills the table. Returns the most entries that a search reads.
int write_table(const Plan& p, EncodedField& field) {
  auto* entries = field.find("hashed_table")->as<std::array<std::uint32_t, 4>>();
  const std::uint32_t mask = static_cast<std::uint32_t>(p.entries) - 1;
  int longest = 1;
  for (std::size_t number = 0; number < p.bricks.size(); ++number) {
    const Brick& b = p.bricks[number];
    const glm::uvec3 place(b.place);
    std::uint32_t i = AMRTEX_HASHED_START(place.x, place.y, place.z, b.level) & mask;
    int steps = 1;
    for (; entries[i][3] != 0; i = (i + 1) & mask) ++steps;
    longest = std::max(longest, steps);
    const auto last = static_cast<std::uint32_t>(b.level) | static_cast<std::uint32_t>(number + 1) << AMRTEX_HASHED_LEVEL_BITS;
    entries[i] = {place.x, place.y, place.z, last};
  }
  return longest;
}

std::array<std::uint32_t, 2> words(std::uint64_t bits) {
  return {static_cast<std::uint32_t>(bits), static_cast<std::uint32_t>(bits >> 32)};
}

/// Writes bricks: leaf bits, values, validity bits and ranges.
class BrickWriter {
 public:
  BrickWriter(const AmrHierarchy& h, const BuildRequest& request, const Plan& plan, EncodedField& field)
      : hierarchy_(h), request_(request), plan_(plan), field_(field), more_ranges_(field, "hashed_more_ranges") {}

  void write(std::size_t brick) {
    field_.find("hashed_leaves")->as<Words>()[brick] = words(plan_.bricks[brick].leaves);
    for (int number = 0; number < plan_.fields; ++number) write_field(brick, number);
  }

 private:
  using Words = std::array<std::uint32_t, 2>;

  void write_field(std::size_t brick, int number) {
    const Brick& b = plan_.bricks[brick];
    const Box stored = b.cells().grown(plan_.border);
    std::vector<double> values(static_cast<std::size_t>(stored.cells()));
    std::vector<std::uint8_t> missing(values.size());
    filled_level_values(hierarchy_, request_.field_at(number), b.level, stored, values, missing);
    std::uint64_t valid = 0;
    for_each_cell(b.cells(), [&](const Vec3i& cell) {
      if (missing[stored.offset(cell)] == 0) valid |= std::uint64_t{1} << b.cells().offset(cell);
    });
    const auto entry = brick * static_cast<std::size_t>(plan_.fields) + static_cast<std::size_t>(number);
    if (plan_.validity) field_.find("hashed_validity")->as<Words>()[entry] = words(valid);
    ValueRange range;
    if ((valid & b.leaves) != 0)
      for (const double v : values) range.add(v);
    if (number == 0 && request_.needs.value_ranges)
      field_.find("hashed_ranges")->as<std::uint32_t>()[brick] = encode_range(field_, 0, range);
    more_ranges_.set(static_cast<std::int64_t>(brick), number, range);
    store(plan_.texel_of(brick), values, number);
  }

  void store(const Vec3i& at, const std::vector<double>& values, int number) {
    HostTexture& texture = *field_.find(element_name("tex_hashed", number));
    const Box own{Vec3i(0), Vec3i(plan_.edge())};
    for (int z = 0; z < plan_.edge(); ++z)
      for (int y = 0; y < plan_.edge(); ++y)
        store_values(field_.storage, field_.scale_of(number), &values[own.offset({0, y, z})],
                     static_cast<std::size_t>(plan_.edge()), texture.data.data(),
                     Box{Vec3i(0), texture.size}.offset(at + Vec3i(0, y, z)));
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Plan& plan_;
  EncodedField& field_;
  MoreRanges more_ranges_;
};

EncodedField ExampleEncoding::build(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  require_fields(*this, h, request);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Plan p = plan(h, request, parameters);
  const Layout parts = layout(request, p);
  parts.require_budget();
  parts.require_limits();
  EncodedField field = start_field(*this, h, request, parameters);
  parts.allocate(field);
  BrickWriter writer(h, request, p, field);
  for (std::size_t brick = 0; brick < p.bricks.size(); ++brick) writer.write(brick);
  const int longest = write_table(p, field);
  field.shader.defines.emplace_back("AMRTEX_HASHED_BORDER", p.border);
  field.integer_uniforms = {{"u_hashed_table", Vec3i(static_cast<int>(p.entries), longest, 0)}, {"u_hashed_pool", p.pool}};
  field.statistics = {{"bricks", p.count()}, {"longest_search", longest}};
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_example_encoding() { return std::make_unique<ExampleEncoding>(); }

}  // namespace amrtex
