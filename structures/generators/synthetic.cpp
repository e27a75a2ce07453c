#include "structures/generators/synthetic.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "structures/generators/analytic_fields.hpp"
#include "structures/generators/body_mask.hpp"
#include "structures/generators/cluster_blocks.hpp"
#include "structures/generators/hash_random.hpp"
#include "structures/generators/refine_criterion.hpp"
#include "structures/generators/spec_reader.hpp"
#include "structures/mesh/block_tree.hpp"

namespace amrtex {

namespace {

constexpr std::uint64_t kHoleStream = 2;
constexpr std::uint64_t kMissingStream = 3;
constexpr int kMaxLevels = 30;
constexpr int kMaxPatch = 1024;
/// Below 2^31 by more than a block, so that box corners never overflow.
constexpr std::int64_t kMaxCellsAlongAxis = (std::int64_t{1} << 31) - 2 * kMaxPatch;
constexpr std::int64_t kMaxRootBlocks = std::int64_t{1} << 24;
constexpr std::int64_t kMaxCells = std::int64_t{1} << 31;
constexpr std::array<std::string_view, 2> kPrecisions{"double", "single"};

/// Root blocks that are left out: a random fraction of them or those with their middle in a ball.
struct Holes {
  double fraction = 0;
  Vec3d center{0};    ///< world
  double radius = 0;  ///< world length
};

/// What a specification says besides its field and its criterion, checked.
struct MeshKeys {
  std::string name;
  WorldBox domain;
  BlockGrid grid;
  TreeRules rules;
  Holes holes;
  ClusterRules patches;
  double nan_fraction = 0;
  bool averaged = false;
  RealType type = RealType::float64;
  std::uint64_t seed = 1;
};

int read_int(SpecReader& reader, std::string_view key, int fallback, int lowest, int highest) {
  return static_cast<int>(reader.integer(key, fallback, lowest, highest));
}

/// A list of `count` integers in [lowest, highest]; a single integer stands for `count` of them.
std::vector<int> read_integers(SpecReader& reader, std::string_view key, int fallback, std::size_t count, int lowest,
                               int highest) {
  const Json* value = reader.find(key);
  if (value == nullptr || !value->is_array()) return std::vector<int>(count, read_int(reader, key, fallback, lowest, highest));
  const auto fits = [&](const Json& v) { return v.is_number_integer() && v >= lowest && v <= highest; };
  if (value->size() != count || !std::all_of(value->begin(), value->end(), fits))
    reader.refuse(key, fmt::format("an integer from {} to {} or a list of {} of them", lowest, highest, count));
  return value->get<std::vector<int>>();
}

BlockGrid read_grid(SpecReader& reader) {
  BlockGrid grid;
  const int levels = read_int(reader, "levels", 4, 1, kMaxLevels);
  const std::vector<int> root = read_integers(reader, "root", 64, 3, 1, 1 << 24);
  grid.root_cells = {root[0], root[1], root[2]};
  grid.ratios = read_integers(reader, "ratio", 2, static_cast<std::size_t>(levels - 1), 2, 64);
  grid.patch = read_int(reader, "patch", 16, 1, kMaxPatch);
  for (const int ratio : grid.ratios)
    if (grid.patch % ratio != 0)
      reader.refuse("patch", fmt::format("an integer from 1 to {} that every \"ratio\" divides ({} does not)", kMaxPatch, ratio));
  std::int64_t finest = *std::max_element(root.begin(), root.end());
  for (const int ratio : grid.ratios) {
    finest *= ratio;
    if (finest > kMaxCellsAlongAxis)
      reader.refuse("levels", fmt::format("so many that \"root\" times every \"ratio\" is at most {} cells", kMaxCellsAlongAxis));
  }
  return grid;
}

int read_level_jump(SpecReader& reader, int levels) {
  const Json* value = reader.find("level_jump");
  if (value != nullptr && value->is_null()) return 0;
  if (value != nullptr && (!value->is_number_integer() || *value < 0 || *value > kMaxLevels))
    reader.refuse("level_jump", fmt::format("an integer from 1 to {}, or 0 or null for any jump", kMaxLevels));
  return std::min(read_int(reader, "level_jump", 1, 0, kMaxLevels), levels);
}

std::vector<bool> read_skipped(SpecReader& reader, int levels, int level_jump) {
  std::vector<bool> skipped(static_cast<std::size_t>(levels), false);
  const Json* value = reader.find("skip_levels");
  if (value == nullptr) return skipped;
  const auto fits = [&](const Json& v) { return v.is_number_integer() && v >= 0 && v < levels - 1; };
  if (!value->is_array() || !std::all_of(value->begin(), value->end(), fits))
    reader.refuse("skip_levels", fmt::format("a list of levels from 0 to below {}, the finest", levels - 1));
  for (const Json& level : *value) skipped[level.get<std::size_t>()] = true;
  // Leaves on both sides of n skipped levels differ by n + 1 levels: a smaller limit
  // could only be met by refining the whole domain past them.
  bool coarser_leaves = false;
  int run = 0;
  for (const bool skip : skipped) {
    coarser_leaves = coarser_leaves || !skip;
    run = skip && coarser_leaves ? run + 1 : 0;
    if (level_jump > 0 && run >= level_jump)
      reader.refuse("skip_levels",
                    fmt::format("levels in runs shorter than \"level_jump\" ({}), or a \"level_jump\" of 0", level_jump));
  }
  return skipped;
}

/// How blocks are joined into patches.
ClusterRules read_cluster_rules(SpecReader& reader, int patch) {
  ClusterRules rules;
  const int cells = read_int(reader, "max_patch", patch, 1, kMaxPatch);
  if (cells < patch) reader.refuse("max_patch", fmt::format("an integer from \"patch\" ({}) to {}", patch, kMaxPatch));
  rules.longest_edge = cells / patch;
  rules.efficiency = reader.number("efficiency", 1, "a number above 0, at most 1", [](double e) { return e > 0 && e <= 1; });
  bool gaps = false;
  for (const char* key : {"holes", "body", "skip_levels"}) gaps = reader.find(key) != nullptr || gaps;
  if (rules.efficiency < 1 && gaps) reader.refuse("efficiency", "1 beside \"holes\", \"body\" or \"skip_levels\"");
  return rules;
}

Holes read_holes(SpecReader& reader) {
  Holes holes;
  const Json* value = reader.find("holes");
  if (value == nullptr) return holes;
  if (value->is_object()) {
    SpecReader ball(*value, reader.path_of("holes"));
    if (ball.find("center") == nullptr) ball.refuse("center", "a list of 3 finite numbers");
    holes.center = ball.vector("center", holes.center);
    if (ball.find("radius") == nullptr) ball.refuse("radius", "a number above 0");
    holes.radius = ball.number("radius", 0, "a number above 0", is_positive);
    ball.finish();
    return holes;
  }
  holes.fraction = reader.number("holes", 0, "a number from 0 to 1, or an object with center and radius", is_fraction);
  return holes;
}

MeshKeys read_mesh_keys(SpecReader& reader, const std::string& field_type) {
  MeshKeys keys;
  keys.name = reader.text("name", field_type);
  keys.domain = read_domain(reader);
  keys.grid = read_grid(reader);
  keys.rules.level_jump = read_level_jump(reader, keys.grid.level_count());
  keys.rules.skipped = read_skipped(reader, keys.grid.level_count(), keys.rules.level_jump);
  keys.rules.max_cells = kMaxCells;
  keys.patches = read_cluster_rules(reader, keys.grid.patch);
  keys.holes = read_holes(reader);
  keys.nan_fraction = reader.number("nan_fraction", 0, "a number from 0 to 1", is_fraction);
  keys.averaged = reader.boolean("averaged", false);
  keys.type = reader.choice("precision", kPrecisions[0], kPrecisions) == kPrecisions[0] ? RealType::float64 : RealType::float32;
  keys.seed = static_cast<std::uint64_t>(reader.integer("seed", 1, 0, std::numeric_limits<std::int64_t>::max()));
  return keys;
}

bool is_hole(const MeshKeys& keys, const Vec3i& block) {
  if (cell_random(keys.seed, kHoleStream, 0, block) < keys.holes.fraction) return true;
  if (keys.holes.radius == 0) return false;
  const Box box = keys.grid.box(0, block);
  const Vec3d middle = keys.domain.at(0.5 * Vec3d(box.lower + box.upper) / Vec3d(keys.grid.root_cells));
  return glm::distance(middle, keys.holes.center) < keys.holes.radius;
}

BlockList root_blocks(const MeshKeys& keys, const std::optional<BodyMask>& body, const SpecReader& reader) {
  const std::int64_t cells = keys.grid.domain(0).cells();
  if (cells > kMaxCells) reader.refuse("root", fmt::format("at most {} cells in all", kMaxCells));
  const Box all{Vec3i(0), keys.grid.blocks(0)};
  if (all.cells() > kMaxRootBlocks)
    reader.refuse("patch", fmt::format("so large that \"root\" has at most {} blocks", kMaxRootBlocks));
  BlockList blocks;
  for_each_cell(all, [&](const Vec3i& block) {
    if (!is_hole(keys, block)) blocks.push_back(block);
  });
  if (blocks.empty()) reader.refuse("holes", "holes that leave at least one root block");
  if (body) std::erase_if(blocks, [&](const Vec3i& block) { return body->place(0, block) == BodyMask::Place::inside; });
  return blocks;
}

BlockTree make_tree(const MeshKeys& keys, const RefineCriterion& criterion, const std::optional<BodyMask>& body, BlockList root) {
  const int levels = keys.grid.level_count();
  BlockTree tree{std::vector<BlockList>(static_cast<std::size_t>(levels))};
  tree.add(0, std::move(root));
  for (int level = 0; level + 1 < levels; ++level) {
    const auto l = static_cast<std::size_t>(level);
    const BlockList& blocks = tree.levels[l];
    if (keys.rules.skipped[l]) require_children(keys.grid, keys.rules, level, blocks);
    BlockList children =
        keys.rules.skipped[l] ? all_children(keys.grid, level, blocks) : wanted_children(keys.grid, level, blocks, criterion);
    if (body) body->fit_children(level, blocks, children);
    tree.add(level + 1, std::move(children));
    require_cells(keys.grid, keys.rules, tree);
  }
  close_tree(keys.grid, keys.rules, tree);
  if (body) body->carve(tree);
  return tree;
}

/// Computes the values of patches.
class ValueSource {
 public:
  /// `index` of the field among the mesh's: each has its own missing values.
  ValueSource(const MeshKeys& keys, const AnalyticField& field, std::size_t index)
      : keys_(keys), field_(field), missing_seed_(keys.seed + index) {}

  /// Of the cells of a box, level space.
  CellValues values(int level, const Box& box) const {
    CellValues result(keys_.type, static_cast<std::size_t>(box.cells()));
    result.visit_stored([&](auto& stored) {
      using Real = typename std::decay_t<decltype(stored)>::value_type;
      tbb::parallel_for(box.lower.z, box.upper.z, [&](int z) {
        const Box slab{{box.lower.x, box.lower.y, z}, {box.upper.x, box.upper.y, z + 1}};
        for_each_cell(slab, [&](const Vec3i& cell) { stored[box.offset(cell)] = static_cast<Real>(cell_value(level, cell)); });
      });
    });
    if (keys_.nan_fraction > 0) remove_values(level, box, result);
    return result;
  }

 private:
  double point_value(int level, const Vec3d& p_cells) const {
    return field_.value(keys_.domain.at(p_cells / Vec3d(keys_.grid.cells(level))));
  }

  double cell_value(int level, const Vec3i& cell) const {
    const Vec3d middle = Vec3d(cell) + 0.5;
    return keys_.averaged ? average(level, middle) : point_value(level, middle);
  }

  /// Gauss-Legendre with three nodes along each axis: exact up to degree 5.
  double average(int level, const Vec3d& middle) const {
    const double node = 0.5 * std::sqrt(0.6);
    double sum = 0;
    for_each_cell({Vec3i(-1), Vec3i(2)}, [&](const Vec3i& i) {
      double weight = 1;
      for (int a = 0; a < 3; ++a) weight *= (i[a] == 0 ? 8.0 : 5.0) / 18.0;
      sum += weight * point_value(level, middle + node * Vec3d(i));
    });
    return sum;
  }

  void remove_values(int level, const Box& box, CellValues& values) const {
    for_each_cell(box, [&](const Vec3i& cell) {
      if (cell_random(missing_seed_, kMissingStream, level, cell) < keys_.nan_fraction)
        values.set(box.offset(cell), std::numeric_limits<double>::quiet_NaN());
    });
  }

  const MeshKeys& keys_;
  const AnalyticField& field_;
  std::uint64_t missing_seed_;
};

/// The fields of a mesh with their names; the mesh is refined by the first.
struct NamedFields {
  std::vector<std::unique_ptr<AnalyticField>> fields;
  std::vector<std::string> names;

  void add(const Json& specification) {
    fields.push_back(make_analytic_field(specification));
    std::string name = analytic_field_type(specification);
    for (int i = 2; std::find(names.begin(), names.end(), name) != names.end(); ++i)
      name = fmt::format("{}_{}", analytic_field_type(specification), i);
    names.push_back(std::move(name));
  }
};

NamedFields read_fields(SpecReader& reader, const Json& specification) {
  NamedFields fields;
  reader.find("field");
  fields.add(specification);
  const Json* more = reader.find("more_fields");
  if (more == nullptr) return fields;
  if (!more->is_array()) reader.refuse("more_fields", "a list of fields, each a type or an object with a type");
  for (const Json& field : *more) {
    Json other = specification;
    other["field"] = field;
    fields.add(other);
  }
  return fields;
}

/// `boxes` in blocks of the level.
std::vector<Patch> make_patches(const MeshKeys& keys, const std::vector<Box>& boxes, const NamedFields& fields, int level) {
  std::vector<Patch> patches(boxes.size());
  tbb::parallel_for(std::size_t{0}, boxes.size(), [&](std::size_t i) {
    const Box& box = patches[i].box = keys.grid.cells_of(level, boxes[i]);
    for (std::size_t f = 0; f < fields.fields.size(); ++f)
      patches[i].values.push_back(ValueSource(keys, *fields.fields[f], f).values(level, box));
  });
  return patches;
}

}  // namespace

MeshDescription generate_mesh(const Json& specification) {
  SpecReader reader(specification, "");
  const NamedFields fields = read_fields(reader, specification);
  const MeshKeys keys = read_mesh_keys(reader, fields.names.front());
  const auto criterion = read_criterion(reader, keys.grid, keys.domain, *fields.fields.front(), keys.seed);
  const std::optional<BodyMask> body = read_body(reader, specification, keys.grid, keys.domain);
  reader.finish();

  BlockTree tree = make_tree(keys, *criterion, body, root_blocks(keys, body, reader));
  if (count_cells(keys.grid, tree) == 0) reader.refuse("body", "a body that leaves at least one cell");
  const std::vector<std::vector<Box>> boxes = cluster_tree(keys.grid, keys.rules, keys.patches, tree);
  MeshDescription mesh;
  mesh.name = keys.name;
  mesh.domain_lower = keys.domain.lower;
  mesh.domain_upper = keys.domain.upper;
  mesh.root_cells = keys.grid.root_cells;
  mesh.ratios = keys.grid.ratios;
  mesh.fields = fields.names;
  for (int level = 0; level < keys.grid.level_count(); ++level) {
    const auto l = static_cast<std::size_t>(level);
    mesh.levels.push_back(keys.rules.skipped[l] ? std::vector<Patch>() : make_patches(keys, boxes[l], fields, level));
  }
  return mesh;
}

}  // namespace amrtex
