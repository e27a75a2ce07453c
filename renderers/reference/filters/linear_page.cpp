// Filter `linear_page`: trilinear in the level values of the level of the page that holds p.
#include <fmt/format.h>

#include <unordered_set>

#include "renderers/reference/filters/dual_cells.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

class Pages {
 public:
  Pages(const AmrHierarchy& hierarchy, const FilterDefinition& definition);
  /// Level of the page that holds a cell of the finest level.
  int level_at(const Vec3i& finest_cell) const;
  /// Box of that page (finest space).
  Box box(int level, const Vec3i& finest_cell) const;

 private:
  void split(int level);

  const AmrHierarchy& hierarchy_;
  FilterDefinition definition_;
  std::vector<std::unordered_set<Vec3i, CellHash>> split_;  // of each level, the pages that are not final
};

Pages::Pages(const AmrHierarchy& hierarchy, const FilterDefinition& definition) : hierarchy_(hierarchy), definition_(definition) {
  const int levels = hierarchy.level_count();
  if (definition.page_size < 0) throw Error(fmt::format("page_size {}: must not be negative", definition.page_size));
  if (definition.page_size == 0 && (definition.page_level < 0 || definition.page_level >= levels))
    throw Error(fmt::format("page level {}: data set {} has levels 0 to {}", definition.page_level, clipped(hierarchy.name()),
                            levels - 1));
  split_.resize(static_cast<std::size_t>(levels));
  for (int level = 0; definition.page_size > 0 && level < levels; ++level) split(level);
}

/// Pages of a level that hold part of a finer patch are not final.
void Pages::split(int level) {
  auto& pages = split_[static_cast<std::size_t>(level)];
  for (int finer = level + 1; finer < hierarchy_.level_count(); ++finer)
    for (const Patch& patch : hierarchy_.patches(finer))
      for_each_cell(
          patch.box.coarsened(hierarchy_.cell_width(level) / hierarchy_.cell_width(finer)).coarsened(definition_.page_size),
          [&](const Vec3i& page) { pages.insert(page); });
}

int Pages::level_at(const Vec3i& finest_cell) const {
  if (definition_.page_size == 0) return definition_.page_level;
  int level = 0;
  while (level < hierarchy_.finest_level() &&
         split_[static_cast<std::size_t>(level)].contains(finest_cell / hierarchy_.cell_width(level) / definition_.page_size))
    ++level;
  return level;
}

Box Pages::box(int level, const Vec3i& finest_cell) const {
  const Box domain = hierarchy_.domain(hierarchy_.finest_level());
  if (definition_.page_size == 0) return domain;
  // a page may overhang the domain, also past 31 bits
  const std::int64_t edge = std::int64_t{hierarchy_.cell_width(level)} * definition_.page_size;
  Box box;
  for (int a = 0; a < 3; ++a) {
    box.lower[a] = static_cast<int>(finest_cell[a] / edge * edge);
    box.upper[a] = static_cast<int>(std::min<std::int64_t>(box.lower[a] + edge, domain.upper[a]));
  }
  return box;
}

class PagePoints final : public DualPoints {
 public:
  PagePoints(const ReferenceField& field, const Pages& pages) : DualPoints(field), pages_(pages) {}
  double value(const ReferenceLeaf&, const FinestPosition& p) override { return value_of(pages_.level_at(p.cell), p); }
  std::optional<Vec3d> derivative(const ReferenceLeaf&, const FinestPosition& p) override {
    return derivative_of(pages_.level_at(p.cell), p);
  }
  Reach reach(const ReferenceLeaf&, const FinestPosition& p) const override { return reach_of(pages_.level_at(p.cell)); }

 private:
  const Pages& pages_;
};

class PagePieces final : public DualPieces {
 public:
  PagePieces(const ReferenceField& field, const Pages& pages) : DualPieces(field), pages_(pages) {}
  void start() override { page_ = {}; }
  bool locate(RayFront& front) override {
    const Vec3i here = front.finest_cell();
    if (!page_.contains(here)) {
      level_ = pages_.level_at(here);
      page_ = pages_.box(level_, here);
    }
    front.clip(page_);
    const TrilinearCell& cell = find_cell(front, level_);
    front.clip_dual(cell.level, cell.cell);
    return cell.all_leaves || !field().has_missing() || front.enter_leaf();
  }

 private:
  const Pages& pages_;
  Box page_;
  int level_ = 0;
};

class LinearPage final : public FilterReference {
 public:
  LinearPage(const AmrHierarchy& hierarchy, int field, const FilterDefinition& definition)
      : FilterReference(hierarchy, field, definition), pages_(hierarchy, definition) {}
  std::unique_ptr<FilterPoints> points() const override { return std::make_unique<PagePoints>(field(), pages_); }
  std::unique_ptr<FilterPieces> pieces() const override { return std::make_unique<PagePieces>(field(), pages_); }

 private:
  Pages pages_;
};

}  // namespace

std::unique_ptr<FilterReference> make_linear_page_reference(const AmrHierarchy& hierarchy, int field,
                                                            const FilterDefinition& definition) {
  return std::make_unique<LinearPage>(hierarchy, field, definition);
}

}  // namespace amrtex
