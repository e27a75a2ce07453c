#include "uniform.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cmath>

#include "structures/build_tools.hpp"
#include "structures/level_values.hpp"
#include "uniform_layout.h"

namespace amrtex {
namespace {

constexpr std::array<Filter, 2> kFilters{Filter::nearest, Filter::linear_page};
constexpr int kBlock = AMRTEX_DENSE_BLOCK;

struct Plan {
  int level;
  Vec3i cells;
  Vec3i blocks;
  bool validity;
  bool ranges;
  int border;  ///< texels round the domain: the fills of cells outside, which clamping gives only where no cell is missing
  Box texels() const { return Box{Vec3i(0), cells}.grown(border); }
  std::int64_t cell_count() const { return std::int64_t{cells.x} * cells.y * cells.z; }
  std::int64_t block_count() const { return std::int64_t{blocks.x} * blocks.y * blocks.z; }
  std::int64_t bytes(Storage storage) const {
    return texels().cells() * texel_bytes(storage) + (validity ? 4 * words_for_bits(cell_count()) : 0) +
           (ranges ? 4 * block_count() : 0);
  }
};

class Uniform final : public Encoding {
 public:
  std::string_view name() const override { return "uniform"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"level", "level whose cells the texture has", nullptr, "a level of the mesh, or null for the finest"}};
  }
  void check_parameters(const Json& parameters) const override { level(parameters, std::numeric_limits<int>::max()); }
  Support supported(const ContextInfo&) const override { return {}; }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  int level(const Json& parameters, int finest) const;
  Plan plan(const AmrHierarchy& hierarchy, const BuildRequest& request, const Json& parameters) const;
};

int Uniform::level(const Json& parameters, int finest) const {
  if (parameters.at("level").is_null()) return finest;
  const int level = integer_parameter(*this, parameters, "level");
  if (level < 0 || level > finest)
    throw UsageError(fmt::format("encoding uniform: parameter level is {}; accepted: 0 to {}, or null for the finest", level,
                                 finest == std::numeric_limits<int>::max() ? "the mesh's finest level" : std::to_string(finest)));
  return level;
}

Plan Uniform::plan(const AmrHierarchy& h, const BuildRequest& request, const Json& parameters) const {
  Plan p{};
  p.level = level(parameters, h.finest_level());
  p.cells = h.cells(p.level);
  p.blocks = ceil_div(p.cells, kBlock);
  p.validity = h.has_missing(request.field);
  p.ranges = request.needs.value_ranges;
  p.border = p.validity && request.needs.filter != Filter::nearest ? 1 : 0;
  const std::int64_t bytes = p.bytes(request.storage);
  require_budget(*this, bytes, request);
  const int limit = request.context.max_3d_texture_size;
  if (std::max({p.cells.x, p.cells.y, p.cells.z}) + 2 * p.border > limit)
    throw UnsupportedError(fmt::format(
        "encoding uniform: level {} has {} x {} x {} cells ({} bytes), a 3D texture of this context at most {} along an axis",
        p.level, p.cells.x, p.cells.y, p.cells.z, bytes, limit));
  if (p.validity && 4 * words_for_bits(p.cell_count()) > request.context.max_buffer_bytes)
    throw UnsupportedError(fmt::format("encoding uniform: validity bits take {} bytes, a buffer of this context at most {}",
                                       4 * words_for_bits(p.cell_count()), request.context.max_buffer_bytes));
  return p;
}

/// Writes one block: values, validity bits, range.
struct Writer {
  const AmrHierarchy& hierarchy;
  const BuildRequest& request;
  const Plan& plan;
  StorageScale scale;
  double range_origin;
  HostTexture& values;
  HostTexture* ranges;

  void block(const Vec3i& b, std::vector<std::uint8_t>& missing_cells) const {
    const Box inner = intersection(Box{b * kBlock, (b + Vec3i(1)) * kBlock}, hierarchy.domain(plan.level));
    const int border = request.needs.filter == Filter::nearest ? 0 : 1;
    const Box box = inner.grown(border);
    std::vector<double> v(static_cast<std::size_t>(box.cells()));
    std::vector<std::uint8_t> missing(v.size());
    filled_level_values(hierarchy, request.field, plan.level, box, v, missing);
    const Box all = hierarchy.domain(plan.level);
    ValueRange range;
    bool any = false;
    for_each_cell(inner, [&](const Vec3i& c) {
      const bool none = missing[box.offset(c)] != 0;
      any = any || !none;
      if (!missing_cells.empty()) missing_cells[all.offset(c)] = none ? 1 : 0;
    });
    for (double value : v) range.add(value);
    // a block at the domain's boundary writes the border there
    const Box texels = plan.texels();
    Box own = inner;
    for (int a = 0; a < 3; ++a) {
      if (own.lower[a] == all.lower[a]) own.lower[a] = texels.lower[a];
      if (own.upper[a] == all.upper[a]) own.upper[a] = texels.upper[a];
    }
    for (int z = own.lower.z; z < own.upper.z; ++z)
      for (int y = own.lower.y; y < own.upper.y; ++y)
        store_values(request.storage, scale, &v[box.offset({own.lower.x, y, z})], static_cast<std::size_t>(own.size().x),
                     values.data.data(), texels.offset({own.lower.x, y, z}));
    if (ranges != nullptr)
      ranges->as<std::uint32_t>()[Box{Vec3i(0), plan.blocks}.offset(b)] =
          encode_range(any ? range : ValueRange{}, range_origin, request.storage, scale);
  }
};

EncodedField Uniform::build(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Plan p = plan(h, request, parameters);
  EncodedField field = start_field(*this, h, request, parameters);
  field.build_parameters["level"] = p.level;
  field.definition.page_level = p.level;
  field.shader.defines.emplace_back("AMRTEX_DENSE_LEVEL", p.level);
  field.shader.defines.emplace_back("AMRTEX_DENSE_BORDER", p.border);
  field.integer_uniforms = {{"u_dense_cells", p.cells}, {"u_dense_blocks", p.blocks}};

  HostTexture values = make_texture("tex_dense", request.storage, p.texels().size());
  values.hardware_linear = field.filtering == Filtering::hardware;
  values.holds_values = true;
  values.roles.payload = p.cell_count() * texel_bytes(request.storage);
  values.roles.duplicated = values.bytes() - values.roles.payload;
  HostTexture validity =
      p.validity ? make_buffer("dense_validity", TexelFormat::r32ui, words_for_bits(p.cell_count())) : HostTexture{};
  HostTexture ranges = p.ranges ? make_buffer("dense_ranges", TexelFormat::r32ui, p.block_count()) : HostTexture{};

  std::vector<std::uint8_t> missing(p.validity ? static_cast<std::size_t>(p.cell_count()) : 0);
  const Writer writer{h, request, p, field.scale, field.range_origin, values, p.ranges ? &ranges : nullptr};
  tbb::parallel_for(std::int64_t{0}, p.block_count(), [&](std::int64_t i) {
    const auto x = static_cast<int>(i % p.blocks.x);
    const auto y = static_cast<int>(i / p.blocks.x % p.blocks.y);
    const auto z = static_cast<int>(i / p.blocks.x / p.blocks.y);
    writer.block({x, y, z}, missing);
  });
  for (std::size_t i = 0; i < missing.size(); ++i)
    if (missing[i] == 0) set_bit(validity.as<std::uint32_t>(), static_cast<std::int64_t>(i));

  field.host_peak_bytes = p.bytes(request.storage) + static_cast<std::int64_t>(missing.size());
  field.textures.push_back(std::move(values));
  if (p.validity)
    field.textures.push_back(std::move(validity));
  else
    field.left_out.push_back({"validity bits", "every cell has a value", 4 * words_for_bits(p.cell_count())});
  if (p.ranges)
    field.textures.push_back(std::move(ranges));
  else
    field.left_out.push_back({"value ranges", "no region is skipped", 4 * p.block_count()});
  field.statistics = {{"blocks", p.block_count()}};
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_uniform() { return std::make_unique<Uniform>(); }

}  // namespace amrtex
