#include "structures/generators/body_mask.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>
#include <vector>

namespace amrtex {

BodyMask::BodyMask(const BlockGrid& grid, const WorldBox& domain, std::unique_ptr<AnalyticField> field, double above)
    : grid_(grid), domain_(domain), field_(std::move(field)), above_(above) {
  const int finest = grid_.level_count() - 1;
  cut_.levels.resize(static_cast<std::size_t>(finest));
  BlockList candidates;
  for_each_cell({Vec3i(0), grid_.blocks(0)}, [&](const Vec3i& block) { candidates.push_back(block); });
  for (int level = 0; level < finest; ++level) {
    std::vector<std::uint8_t> flags(candidates.size(), 0);
    tbb::parallel_for(std::size_t{0}, flags.size(), [&](std::size_t i) { flags[i] = is_cut(level, candidates[i]) ? 1 : 0; });
    BlockList cut;
    for (std::size_t i = 0; i < flags.size(); ++i)
      if (flags[i] != 0) cut.push_back(candidates[i]);
    candidates = all_children(grid_, level, cut);
    cut_.add(level, std::move(cut));
  }
}

bool BodyMask::above(int level, const Vec3d& cells) const {
  return field_->value(domain_.at(cells / Vec3d(grid_.cells(level)))) > above_;
}

bool BodyMask::is_cut(int level, const Vec3i& block) const {
  const Box cells = grid_.box(level, block);
  // what is taken away around the surface sticks out of the body by half a finest block: no coarser cell shall lie at it
  const int margin = std::max(grid_.patch / 2, 1);  // half cells
  bool in = false;
  bool out = false;
  for_each_cell(Box{Vec3i(0), 2 * cells.size() + 1}.grown(margin), [&](const Vec3i& sample) {
    if (in && out) return;
    (above(level, Vec3d(cells.lower) + 0.5 * Vec3d(sample)) ? in : out) = true;
  });
  return in && out;
}

bool BodyMask::middle_inside(int level, const Vec3i& block) const {
  const Box cells = grid_.box(level, block);
  return above(level, 0.5 * Vec3d(cells.lower + cells.upper));
}

BodyMask::Place BodyMask::place(int level, const Vec3i& block) const {
  for (int l = 0; l <= level; ++l) {
    const Vec3i ancestor = floor_div(block, grid_.ratio_between(l, level));
    if (l + 1 < grid_.level_count() && cut_.contains(l, ancestor)) continue;
    return middle_inside(l, ancestor) ? Place::inside : Place::outside;
  }
  return Place::cut;
}

void BodyMask::drop_inside(int level, BlockList& blocks) const {
  std::erase_if(blocks, [&](const Vec3i& block) { return place(level, block) == Place::inside; });
}

void BodyMask::fit_children(int level, const BlockList& blocks, BlockList& children) const {
  BlockList cut;
  for (const Vec3i& block : blocks)
    if (cut_.contains(level, block)) cut.push_back(block);
  const BlockList all = all_children(grid_, level, cut);
  children.insert(children.end(), all.begin(), all.end());
  drop_inside(level + 1, children);
}

void BodyMask::carve(BlockTree& tree) const {
  for (std::size_t level = 0; level < tree.levels.size(); ++level)
    std::erase_if(tree.levels[level],
                  [&](const Vec3i& block) { return place(static_cast<int>(level), block) != Place::outside; });
}

std::optional<BodyMask> read_body(SpecReader& reader, const Json& specification, const BlockGrid& grid, const WorldBox& domain) {
  const Json* value = reader.find("body");
  if (value == nullptr) return std::nullopt;
  if (!value->is_object())
    reader.refuse("body", "an object with a \"field\" and \"above\", the value that it has more of inside");
  SpecReader body(*value, reader.path_of("body"));
  const Json* field = body.find("field");
  if (field == nullptr) body.refuse("field", "a field, as the key \"field\" of the mesh");
  if (body.find("above") == nullptr) body.refuse("above", "a finite number");
  const double above = body.number("above", 0);
  body.finish();
  Json other = specification;
  other["field"] = *field;
  return BodyMask(grid, domain, make_analytic_field(other), above);
}

}  // namespace amrtex
