#include "uniform.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "structures/common/build_tools.hpp"
#include "structures/common/layout.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"
#include "uniform_layout.h"

namespace amrtex {
namespace {

constexpr std::array<Filter, 3> kFilters{Filter::nearest, Filter::linear_page, Filter::linear_vertex};
constexpr int kBlock = AMRTEX_DENSE_BLOCK;

/// Are there cells without a value, whatever the scene asks for?
bool cells_missing(const AmrHierarchy& h, BuildRequest request) {
  request.needs = {};
  return any_missing(h, request);
}

struct Plan {
  int level;
  Vec3i cells;
  Vec3i blocks;
  int fields;
  bool validity;
  bool may_border;  ///< the filter reads one where cells are missing
  int border;       ///< texels round the domain: the fills of cells outside, which clamping gives only where no cell is missing
  bool vertices;    ///< texels are vertices, not cells
  Box texels() const { return vertices ? Box{Vec3i(0), cells + Vec3i(1)} : Box{Vec3i(0), cells}.grown(border); }
  std::int64_t cell_count() const { return std::int64_t{cells.x} * cells.y * cells.z; }
  std::int64_t block_count() const { return std::int64_t{blocks.x} * blocks.y * blocks.z; }
  /// Words of validity bits: each field's from a new word.
  std::int64_t validity_words() const { return fields * words_for_bits(cell_count()); }
};

class Uniform final : public Encoding {
 public:
  std::string_view name() const override { return "uniform"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"level", "level whose cells the texture has; null: the mesh's finest", nullptr, either({nullptr}, {0})}};
  }
  Support level_of_detail() const override { return {false, "its one texture holds one level (parameter level)"}; }
  FilterDefinition definition(const AmrHierarchy& hierarchy, const BuildRequest& request) const override {
    return {.filter = request.needs.filter, .page_level = level(complete_parameters(*this, request.parameters), hierarchy)};
  }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  EncodedField build_blocks(const AmrHierarchy& hierarchy, const BuildRequest& request) const;
  int level(const Json& parameters, const AmrHierarchy& h) const;
  Plan plan(const AmrHierarchy& h, const BuildRequest& request, const Json& parameters) const;
  /// A deep mesh has more bytes than 64 bits count, and no texture for them.
  void require_countable(const BuildRequest& request, const Plan& p) const;
  Layout layout(const BuildRequest& request, const Plan& p) const;
};

int Uniform::level(const Json& parameters, const AmrHierarchy& h) const {
  const Json& value = parameters.at("level");
  if (value.is_null()) return h.finest_level();
  const int level = value.get<int>();
  if (level > h.finest_level())
    throw UsageError(fmt::format("encoding uniform: parameter level is {}; accepted: 0 to {}, or null for the finest", level,
                                 h.finest_level()));
  return level;
}

Plan Uniform::plan(const AmrHierarchy& h, const BuildRequest& request, const Json& parameters) const {
  Plan p{};
  p.level = level(parameters, h);
  p.cells = h.cells(p.level);
  p.blocks = ceil_div(p.cells, kBlock);
  p.fields = request.field_count();
  p.validity = any_missing(h, request);
  p.vertices = request.needs.filter == Filter::linear_vertex;
  p.may_border = request.needs.filter == Filter::linear_page;
  p.border = p.may_border && (request.needs.keeps_border() || cells_missing(h, request)) ? 1 : 0;
  require_countable(request, p);
  return p;
}

void Uniform::require_countable(const BuildRequest& request, const Plan& p) const {
  const Vec3d texels(p.texels().size());
  const double bytes = p.fields * texels.x * texels.y * texels.z * texel_bytes(request.storage);
  if (bytes < 0x1p60) return;
  throw UnsupportedError(
      fmt::format("encoding uniform: level {} has {} x {} x {} cells (about {:.2g} bytes), a 3D texture of this context at most "
                  "{} along an axis; a coarser level has fewer",
                  p.level, p.cells.x, p.cells.y, p.cells.z, bytes, request.context.max_3d_texture_size));
}

Layout Uniform::layout(const BuildRequest& request, const Plan& p) const {
  Layout layout(*this, request);
  const Vec3i texels = p.texels().size();
  for (int number = 0; number < p.fields; ++number) {
    Part values = layout.values("tex_dense", number, texels);
    values.roles = {{.payload = p.cell_count(), .duplicated = values.texels() - p.cell_count()}};
    layout.add(std::move(values));
  }
  layout.add(buffer_part("dense_validity", "validity bits", TexelFormat::r32ui, p.validity_words())
                 .when(p.validity, "every cell has a value", Need::validity));
  if (p.may_border && p.border == 0)
    layout.leave_out({"border layer", "outside the domain lie the cells at its faces",
                      layout.value_bytes(p.texels().grown(1).cells() - p.texels().cells()), Need::border});
  const bool boxes = request.needs.draw_boxes;
  layout.add(buffer_part("dense_ranges", "value ranges", TexelFormat::r32ui, p.block_count())
                 .when(request.needs.value_ranges, boxes ? "the domain is drawn as one box" : "no region is skipped",
                       boxes ? Need::none : Need::value_ranges));
  layout.add(layout.more_ranges("dense_more_ranges", p.block_count()));
  if (p.validity) layout.add_working(p.fields * p.cell_count());  // Writer's
  layout.set_remedy(fmt::format("; level {} has {} x {} x {} cells", p.level, p.cells.x, p.cells.y, p.cells.z));
  return layout;
}

/// Writes the blocks of the structure: values, which cells are missing, ranges.
class Writer {
 public:
  /// `field`: with its parts, which are written.
  Writer(const AmrHierarchy& h, const BuildRequest& request, const Plan& plan, EncodedField& field)
      : hierarchy_(h),
        request_(request),
        plan_(plan),
        field_(field),
        validity_(field.find("dense_validity")),
        ranges_(field.find("dense_ranges")),
        more_ranges_(field, "dense_more_ranges") {
    for (int number = 0; number < plan.fields; ++number) values_.push_back(field.find(element_name("tex_dense", number)));
    if (plan.validity) missing_.resize(static_cast<std::size_t>(plan.fields * plan.cell_count()));
  }

  void block(const Vec3i& b) {
    bool mesh = false;
    std::uint32_t range = kVacantRange;
    const auto index = static_cast<std::int64_t>(Box{Vec3i(0), plan_.blocks}.offset(b));
    for (int number = 0; number < plan_.fields; ++number) {
      const Contents contents = write_values(b, number);
      mesh = mesh || contents.any;
      if (number == 0 && contents.any) range = encode_range(contents.range, field_.range_origin, request_.storage, field_.scale);
      more_ranges_.set(index, number, contents.any ? contents.range : ValueRange{});
    }
    if (ranges_ != nullptr) ranges_->as<std::uint32_t>()[index] = mesh ? range : kNoRange;
  }

  /// When all blocks are written: one bit for each of their bytes, which threads do not share.
  void write_validity() const {
    if (missing_.empty()) return;
    const std::uint8_t* missing = missing_.data();
    std::uint32_t* words = validity_->as<std::uint32_t>();
    for (int number = 0; number < plan_.fields; ++number) {
      for (std::int64_t i = 0; i < plan_.cell_count(); ++i)
        if (missing[i] == 0) set_bit(words, i);
      missing += plan_.cell_count();
      words += words_for_bits(plan_.cell_count());
    }
  }

 private:
  struct Contents {
    ValueRange range;  ///< of the cells, the layer around them and their fills; or of the vertices
    bool any = false;  ///< has any cell a value?
  };

  Contents write_values(const Vec3i& b, int number) {
    const Box inner = intersection(Box{b * kBlock, (b + Vec3i(1)) * kBlock}, hierarchy_.domain(plan_.level));
    if (plan_.vertices) return write_vertices(inner, number);
    const Box box = inner.grown(request_.needs.filter == Filter::nearest ? 0 : 1);
    std::vector<double> v(static_cast<std::size_t>(box.cells()));
    std::vector<std::uint8_t> missing(v.size());
    filled_level_values(hierarchy_, request_.field_at(number), plan_.level, box, v, missing);
    const Contents contents{range_of(v), mark_missing(inner, box, missing, number)};
    store(inner, box, v, number);
    return contents;
  }

  Contents write_vertices(const Box& inner, int number) {
    const int index = request_.field_at(number);
    const Box own{inner.lower, inner.upper + Vec3i(1)};
    // the rounding of the normalised coordinate lets the texture unit see a little of the next layer
    const Box box = field_.filtering == Filtering::hardware ? intersection(own.grown(1), plan_.texels()) : own;
    std::vector<double> v(static_cast<std::size_t>(box.cells()));
    vertex_values(hierarchy_, index, plan_.level, box, v);
    std::vector<std::uint8_t> missing(static_cast<std::size_t>(inner.cells()), 0);
    if (hierarchy_.has_missing(index)) {
      std::vector<double> cells(missing.size());
      level_values(hierarchy_, index, plan_.level, inner, cells);
      std::transform(cells.begin(), cells.end(), missing.begin(), [](double value) { return std::isnan(value) ? 1 : 0; });
    }
    const Contents contents{range_of(v), mark_missing(inner, inner, missing, number)};
    store(inner, box, v, number);
    return contents;
  }

  static ValueRange range_of(std::span<const double> values) {
    ValueRange range;
    for (const double value : values) range.add(value);
    return range;
  }

  /// Has any cell of the block a value?
  bool mark_missing(const Box& inner, const Box& box, std::span<const std::uint8_t> missing, int number) {
    const Box all = hierarchy_.domain(plan_.level);
    const std::size_t first = static_cast<std::size_t>(number) * static_cast<std::size_t>(plan_.cell_count());
    bool any = false;
    for_each_cell(inner, [&](const Vec3i& c) {
      const bool none = missing[box.offset(c)] != 0;
      any = any || !none;
      if (!missing_.empty()) missing_[first + all.offset(c)] = none ? 1 : 0;
    });
    return any;
  }

  /// A block at the domain's boundary stores the border there.
  void store(const Box& inner, const Box& box, std::span<const double> v, int number) {
    const Box all = hierarchy_.domain(plan_.level);
    const Box texels = plan_.texels();
    Box own = inner;
    for (int a = 0; a < 3; ++a) {
      if (own.lower[a] == all.lower[a]) own.lower[a] = texels.lower[a];
      if (own.upper[a] == all.upper[a]) own.upper[a] = texels.upper[a];
    }
    HostTexture& texture = *values_[static_cast<std::size_t>(number)];
    const StorageScale scale = field_.scale_of(number);
    for (int z = own.lower.z; z < own.upper.z; ++z)
      for (int y = own.lower.y; y < own.upper.y; ++y)
        store_values(request_.storage, scale, &v[box.offset({own.lower.x, y, z})], static_cast<std::size_t>(own.size().x),
                     texture.data.data(), texels.offset({own.lower.x, y, z}));
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Plan& plan_;
  const EncodedField& field_;
  std::vector<HostTexture*> values_;  ///< one a field
  HostTexture* validity_;             ///< null where every cell has a value
  HostTexture* ranges_;               ///< null where no region is skipped
  MoreRanges more_ranges_;
  std::vector<std::uint8_t> missing_;  ///< a byte a cell of each field
};

/// From the blocks' ranges.
LeapGrid leap_grid(const AmrHierarchy& h, const Plan& p, EncodedField& field) {
  LeapGrid grid = LeapGrid::over(h);
  const auto* codes = field.find("dense_ranges")->as<std::uint32_t>();
  for_each_cell(Box{Vec3i(0), p.blocks}, [&](const Vec3i& block) {
    const Box cells = intersection(Box{block, block + Vec3i(1)}.refined(kBlock), h.domain(p.level));
    grid.cover(cells.refined(h.cell_width(p.level)), *codes++);
  });
  return grid;
}

EncodedField Uniform::build(const AmrHierarchy& h, const BuildRequest& request) const {
  if (!request.needs.draw_boxes) return build_blocks(h, request);
  // the texture is one box; value ranges would divide it in regions
  BuildRequest whole = request;
  whole.needs.value_ranges = whole.needs.field_ranges = false;
  EncodedField field = build_blocks(h, whole);
  field.draw_tree.nodes.emplace_back();
  field.draw_tree.set_box(0, h.domain(h.finest_level()), field.build_parameters.at("level"));
  return field;
}

EncodedField Uniform::build_blocks(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  require_level_of_detail(*this, request.needs);
  require_fields(*this, h, request);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Plan p = plan(h, request, parameters);
  const Layout parts = layout(request, p);
  parts.require_budget();
  parts.require_limits();
  EncodedField field = start_field(*this, h, request, parameters);
  field.build_parameters["level"] = p.level;
  field.shader.defines.emplace_back("AMRTEX_DENSE_LEVEL", p.level);
  field.shader.defines.emplace_back("AMRTEX_DENSE_BORDER", p.border);
  field.shader.defines.emplace_back("AMRTEX_DENSE_VERTICES", p.vertices ? 1 : 0);
  field.integer_uniforms = {{"u_dense_cells", p.cells}, {"u_dense_blocks", p.blocks}};

  parts.allocate(field);
  Writer writer(h, request, p, field);
  tbb::parallel_for(std::int64_t{0}, p.block_count(), [&](std::int64_t i) {
    const auto x = static_cast<int>(i % p.blocks.x);
    const auto y = static_cast<int>(i / p.blocks.x % p.blocks.y);
    const auto z = static_cast<int>(i / p.blocks.x / p.blocks.y);
    writer.block({x, y, z});
  });
  writer.write_validity();
  if (request.needs.value_ranges) field.leaps = leap_grid(h, p, field);
  field.statistics = {{"blocks", p.block_count()}};
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_uniform() { return std::make_unique<Uniform>(); }

}  // namespace amrtex
