#include "octree.hpp"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/spin_mutex.h>

#include <bit>
#include <cmath>
#include <numbers>
#include <optional>

#include "octree_layout.h"
#include "octree_mesh.hpp"
#include "octree_windows.hpp"
#include "structures/common/build_tools.hpp"

namespace amrtex {
namespace {

constexpr std::array<Filter, 2> kFilters{Filter::nearest, Filter::linear_lod};
constexpr std::int64_t kMostNodes = std::int64_t{1} << AMRTEX_OCTREE_INDEX_BITS;
/// Subtrees from this depth on are built in parallel.
constexpr int kSubtreeDepth = 5;
/// A start grid chosen by us is at most this part of the tree.
constexpr std::int64_t kStartGridShare = 12;
constexpr int kPaperAddressBits = 8;  ///< an axis
constexpr int kAutomatic = -1;
constexpr const char* kStartGridAccepted = "\"auto\", 0 (none), or a power of two from 2 to 1024";

struct Options {
  bool paper_layout = false;
  bool paper_traversal = false;
  bool store_gradients = true;
  int start_grid = kAutomatic;  ///< cells along the longest axis; 0: none
};

/// Where the tree lies, and how many nodes it has.
struct Tree {
  TreeCell root;
  bool ghosts = false;
  int level_0_shift = 0;
  std::int64_t nodes = 0;
  std::int64_t leaves = 0;                ///< slots of cells with a value
  std::int64_t pruned = 0;                ///< nodes that are not stored because nothing reads them that can be seen
  std::optional<VisibleParts> visible{};  ///< where it is asked for
  const VisibleParts* stored_parts() const { return visible ? &*visible : nullptr; }
};

/// Nodes in a 3D texture: 2^shift.x by 2^shift.y by `layers`.
struct NodeTexture {
  Vec3i shift{0};
  int layers = 1;
  Vec3i nodes() const { return {1 << shift.x, 1 << shift.y, layers}; }
  Vec3i position(std::int64_t node) const {
    const auto n = static_cast<int>(node);
    return {n & ((1 << shift.x) - 1), (n >> shift.x) & ((1 << shift.y) - 1), n >> (shift.x + shift.y)};
  }
};

/// False where no texture of at most `limit` nodes an axis holds them.
bool lay_out(std::int64_t nodes, int limit, NodeTexture& texture) {
  for (int x = 0; (1 << x) <= limit; ++x)
    for (int y = 0; (1 << y) <= limit; ++y) {
      const std::int64_t layers = (nodes + (std::int64_t{1} << (x + y)) - 1) >> (x + y);
      if (layers > limit) continue;
      texture = {{x, y, 0}, static_cast<int>(layers)};
      return true;
    }
  return false;
}

/// What is built, in bytes, before anything is.
struct Plan {
  bool node_buffer = true;
  bool value_buffer = true;
  bool lod_texture = false;
  bool averages_in_slots = false;  ///< of inner children, in the texels that they leave unused
  bool validity = false;
  bool ranges = false;
  NodeTexture texture;
  Vec3i start{0};                ///< cells of the start grid; 0: none
  int start_shift = 0;           ///< depths from the cells where a descent starts to level 0
  bool start_slots = false;      ///< the start grid knows where its cells' averages stand
  std::int64_t node_slots = 0;   ///< room for nodes in the texture, or their number in a buffer
  std::int64_t value_slots = 0;  ///< the same for the value texture
  std::int64_t node_words = 0;
  std::int64_t bytes = 0;
  std::int64_t start_cells() const { return std::int64_t{start.x} * start.y * start.z; }
};

// ---- the shape of the tree

Tree place_tree(const AmrHierarchy& h, const BuildRequest& request) {
  Tree tree;
  tree.level_0_shift = std::countr_zero(static_cast<unsigned>(h.cell_width(0)));
  tree.ghosts = request.needs.filter != Filter::nearest && h.has_missing(request.field);
  const int border = tree.ghosts ? 1 : 0;  // of level-0 cells, for the fills outside of the domain
  const Vec3i n = h.cells(0);
  const auto cells = static_cast<std::uint64_t>(std::max({n.x, n.y, n.z})) + 2U * static_cast<unsigned>(border);
  const int depths = std::max(static_cast<int>(std::bit_width(cells - 1)), 1);
  tree.root = {Vec3l(-std::int64_t{border} * h.cell_width(0)), tree.level_0_shift + depths, false};
  return tree;
}

/// What lies below a node.
struct Count {
  std::int64_t nodes = 0, leaves = 0, pruned = 0;
  void add(const Count& c) {
    nodes += c.nodes;
    leaves += c.leaves;
    pruned += c.pruned;
  }
};

/// A node of kSubtreeDepth: its subtree is counted and written by itself.
struct Subtree {
  TreeCell cell;
  Count below = {};
  std::int64_t index = 0;  ///< its own
  std::int64_t first = 0;  ///< of the nodes below it
};

/// Nodes below a cell of the mesh, whether they are stored or not.
std::int64_t nodes_below(TreeMesh& mesh, const TreeCell& node) {
  std::int64_t n = 0;
  for (int i = 0; i < 8; ++i) {
    TreeCell child = node.child(i);
    double value;
    if (mesh.classify(child, value) == CellKind::inner) n += 1 + nodes_below(mesh, child);
  }
  return n;
}

/// What is below the node, through `below(child)` of the inner ones; stops soon after `most` nodes.
template <class Below>
Count count_children(TreeMesh& mesh, const TreeCell& node, std::int64_t most, Below&& below) {
  Count n;
  for (int i = 0; i < 8 && n.nodes <= most; ++i) {
    TreeCell child = node.child(i);
    double value;
    const CellKind kind = mesh.stored(child, value);
    if (kind == CellKind::inner) {
      ++n.nodes;
      n.add(below(child, most - n.nodes));
    }
    if (kind == CellKind::pruned) n.pruned += 1 + nodes_below(mesh, child);
    n.leaves += kind == CellKind::leaf || kind == CellKind::hidden ? 1 : 0;
  }
  return n;
}

Count count_below(TreeMesh& mesh, const TreeCell& node, std::int64_t most) {
  return count_children(mesh, node, most, [&](const TreeCell& c, std::int64_t rest) { return count_below(mesh, c, rest); });
}

/// What is above kSubtreeDepth; collects the nodes at that depth.
Count count_above(TreeMesh& mesh, const TreeCell& node, int depth, std::vector<Subtree>& subtrees) {
  if (depth < kSubtreeDepth)
    return count_children(mesh, node, kMostNodes,
                          [&](const TreeCell& c, std::int64_t) { return count_above(mesh, c, depth + 1, subtrees); });
  subtrees.push_back({node});
  return {};
}

std::vector<Subtree> count_nodes(const AmrHierarchy& h, int field, Tree& tree) {
  std::vector<Subtree> subtrees;
  TreeMesh mesh(h, field, tree.ghosts, tree.stored_parts());
  Count all = count_above(mesh, tree.root, 0, subtrees);
  tbb::enumerable_thread_specific<TreeMesh> meshes([&] { return TreeMesh(h, field, tree.ghosts, tree.stored_parts()); });
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, subtrees.size()), [&](const auto& range) {
    TreeMesh& own = meshes.local();
    for (std::size_t i = range.begin(); i != range.end(); ++i) subtrees[i].below = count_below(own, subtrees[i].cell, kMostNodes);
  });
  for (const Subtree& s : subtrees) all.add(s.below);
  tree.nodes = 1 + all.nodes;
  tree.leaves = all.leaves;
  tree.pruned = all.pruned;
  return subtrees;
}

// ---- writing

/// Mean of what has a value in a cell of the tree.
struct Mean {
  double sum = 0;
  double volume = 0;  ///< finest cells
  double value() const { return volume > 0 ? sum / volume : std::numeric_limits<double>::quiet_NaN(); }
};

/// What the nodes are written to.
struct Stores {
  HostTexture nodes, values, lod, validity, start, start_slots, ranges;
};

/// Writes nodes in depth-first order. One object a thread.
class TreeWriter {
 public:
  TreeWriter(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const Options& options, const Plan& plan,
             StorageScale scale, Stores& stores)
      : hierarchy_(h),
        request_(request),
        options_(options),
        plan_(plan),
        scale_(scale),
        stores_(stores),
        mesh_(h, request.field, tree.ghosts, tree.stored_parts()),
        fills_(h, request.field),
        ghosts_(tree.ghosts),
        averages_(plan.lod_texture || plan.averages_in_slots) {}

  /// Writes the node and, through `below(child, index, next)`, those under it; `next` is the first free index.
  template <class Below>
  Mean write(const TreeCell& node, std::int64_t index, std::int64_t& next, Below&& below) {
    std::array<TreeCell, 8> child;
    std::array<CellKind, 8> kind{};
    std::array<double, 8> value{};
    std::uint32_t mask = 0;
    for (int i = 0; i < 8; ++i) {
      const auto k = static_cast<std::size_t>(i);
      child[k] = node.child(i);
      kind[k] = mesh_.stored(child[k], value[k]);
      if (kind[k] == CellKind::inner) mask |= 1U << i;
    }
    std::int64_t grandchild = next;
    if (!options_.paper_layout) {  // inner children stand together
      put_word(index, (static_cast<std::uint32_t>(next) << AMRTEX_OCTREE_MASK_BITS) | mask);
      next += std::popcount(mask);
    }
    Mean mean;
    for (int i = 0; i < 8; ++i) {
      const auto k = static_cast<std::size_t>(i);
      Mean part;
      if (kind[k] == CellKind::inner) {
        const std::int64_t at = options_.paper_layout ? next++ : grandchild++;
        part = below(child[k], at, next);
        put_inner(8 * index + i, at, average(child[k], value[k], part, i));
        if (request_.needs.level_of_detail && part.volume > 0) put_valid(8 * index + i);
      } else if (kind[k] == CellKind::pruned) {  // for filters an empty cell whose fill is the average
        part = mean_below(child[k]);
        put_cell(8 * index + i, CellKind::empty, average(child[k], value[k], part, i));
      } else {
        if (kind[k] == CellKind::leaf || kind[k] == CellKind::hidden) {
          const double volume = std::ldexp(1.0, 3 * child[k].shift);
          part = {value[k] * volume, volume};
        } else {
          value[k] = fill(child[k], i);
        }
        put_cell(8 * index + i, kind[k], value[k]);
      }
      mean.sum += part.sum;
      mean.volume += part.volume;
    }
    return mean;
  }

  Mean write_below(const TreeCell& node, std::int64_t index, std::int64_t& next) {
    return write(node, index, next,
                 [this](const TreeCell& c, std::int64_t at, std::int64_t& n) { return write_below(c, at, n); });
  }

  /// Without what only pruned cells would have to be read for.
  void skip_means(bool skip) { skip_means_ = skip; }

  void write_root_average(double mean) {
    if (plan_.lod_texture) put_lod(0, mean);
  }

 private:
  /// Fill of a child that has no value. Children of a node overhang the domain, never the tree.
  double fill(const TreeCell& c, int octant) {
    if (!ghosts_) return 0;
    const int level = mesh_.level_at(c.shift);
    if (level < 0) return 0;
    TreeCell first = c;
    first.lower -= Vec3l(octant & 1, (octant >> 1) & 1, octant >> 2) << static_cast<std::int64_t>(c.shift);
    const double v = fills_.at(level, mesh_.level_cell(first), octant);
    return std::isnan(v) ? 0 : v;
  }
  /// What write() returns, of cells that are not written: the same sum in the same order.
  Mean mean_below(const TreeCell& node) {
    Mean mean;
    if (!averages_ || skip_means_) return mean;
    for (int i = 0; i < 8; ++i) {
      TreeCell child = node.child(i);
      double value;
      const CellKind kind = mesh_.classify(child, value);
      if (kind == CellKind::empty) continue;
      const double volume = std::ldexp(1.0, 3 * child.shift);
      const Mean part = kind == CellKind::inner ? mean_below(child) : Mean{value * volume, volume};
      mean.sum += part.sum;
      mean.volume += part.volume;
    }
    return mean;
  }

  /// Level value of an inner child: the same rule and the same bits as everywhere (level_values.hpp); between
  /// and above levels the mean of what lies below.
  double average(const TreeCell& c, double stored, const Mean& below, int octant) {
    if (!averages_) return 0;
    const int level = mesh_.level_at(c.shift);
    if (level < 0) return std::isnan(below.value()) ? 0 : below.value();
    double v = stored;
    if (std::isnan(v) && below.volume > 0) v = hierarchy_.level_value(level, mesh_.level_cell(c), request_.field);
    return std::isnan(v) ? fill(c, octant) : v;
  }

  void put_word(std::int64_t node, std::uint32_t word) {
    std::size_t at = static_cast<std::size_t>(node);
    if (!plan_.node_buffer) at = Box{Vec3i(0), stores_.nodes.size}.offset(plan_.texture.position(node));
    stores_.nodes.as<std::uint32_t>()[at] = word;
  }

  std::size_t slot_texel(std::int64_t slot, const HostTexture& texture) const {
    if (texture.kind == HostTexture::Kind::buffer) return static_cast<std::size_t>(slot);
    const Vec3i in_node(static_cast<int>(slot & 1), static_cast<int>((slot >> 1) & 1), static_cast<int>((slot >> 2) & 1));
    return Box{Vec3i(0), texture.size}.offset(plan_.texture.position(slot >> 3) * 2 + in_node);
  }

  void put_value(std::int64_t slot, double value) {
    store_values(request_.storage, scale_, &value, 1, stores_.values.data.data(), slot_texel(slot, stores_.values));
  }

  void put_lod(std::int64_t node, double value) {
    const std::size_t at = Box{Vec3i(0), stores_.lod.size}.offset(plan_.texture.position(node));
    store_values(request_.storage, scale_, &value, 1, stores_.lod.data.data(), at);
  }

  void put_inner(std::int64_t slot, std::int64_t node, double value) {
    if (plan_.lod_texture) put_lod(node, value);
    if (plan_.averages_in_slots) put_value(slot, value);
    if (!options_.paper_layout) return;
    const Vec3i p = plan_.texture.position(node);
    put_own_word(
        slot, AMRTEX_OCTREE_INNER,
        static_cast<std::uint32_t>(p.x) | (static_cast<std::uint32_t>(p.y) << 8) | (static_cast<std::uint32_t>(p.z) << 16));
  }

  void put_cell(std::int64_t slot, CellKind kind, double value) {
    if (options_.paper_layout) {
      std::byte code{};
      store_values(request_.storage, scale_, &value, 1, &code, 0);
      put_own_word(slot, kind == CellKind::leaf ? AMRTEX_OCTREE_LEAF : AMRTEX_OCTREE_EMPTY, std::to_integer<std::uint32_t>(code));
      return;
    }
    put_value(slot, value);
    if (kind == CellKind::leaf) put_valid(slot);
  }

  /// A leaf with a value; with a level of detail also an inner cell that has one.
  void put_valid(std::int64_t slot) {
    // the eight bits of a node are one byte: threads do not share it
    if (plan_.validity) stores_.validity.data[static_cast<std::size_t>(slot >> 3)] |= static_cast<std::byte>(1U << (slot & 7));
  }

  /// A word of the layout `rgba8`.
  void put_own_word(std::int64_t slot, std::uint32_t type, std::uint32_t rgb) {
    stores_.nodes.as<std::uint32_t>()[slot_texel(slot, stores_.nodes)] = rgb | (type << 24);
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Options& options_;
  const Plan& plan_;
  StorageScale scale_;
  Stores& stores_;
  TreeMesh mesh_;
  NodeFills fills_;
  bool ghosts_;
  bool averages_;
  bool skip_means_ = false;
};

/// Writes the nodes above the subtrees; `subtree(k, index, next)` stands for the k-th of these.
template <class SubtreeMean>
Mean write_above(TreeWriter& writer, const TreeCell& node, int depth, std::int64_t index, std::int64_t& next, std::size_t& k,
                 SubtreeMean&& subtree) {
  if (depth == kSubtreeDepth) return subtree(k++, index, next);
  return writer.write(node, index, next, [&](const TreeCell& c, std::int64_t at, std::int64_t& n) {
    return write_above(writer, c, depth + 1, at, n, k, subtree);
  });
}

void write_tree(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const Options& options, const Plan& plan,
                StorageScale scale, std::vector<Subtree>& subtrees, Stores& stores) {
  TreeWriter upper(h, request, tree, options, plan, scale, stores);
  const auto write_upper = [&](auto&& subtree) {
    std::size_t k = 0;
    std::int64_t next = 1;
    return write_above(upper, tree.root, 0, 0, next, k, subtree);
  };
  upper.skip_means(true);
  write_upper([&](std::size_t k, std::int64_t index, std::int64_t& next) {  // where each subtree goes
    subtrees[k].index = index;
    subtrees[k].first = next;
    next += subtrees[k].below.nodes;
    return Mean{};
  });
  upper.skip_means(false);
  std::vector<Mean> means(subtrees.size());
  tbb::enumerable_thread_specific<TreeWriter> writers([&] { return TreeWriter(h, request, tree, options, plan, scale, stores); });
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, subtrees.size()), [&](const auto& range) {
    TreeWriter& own = writers.local();
    for (std::size_t k = range.begin(); k != range.end(); ++k) {
      std::int64_t next = subtrees[k].first;
      means[k] = own.write_below(subtrees[k].cell, subtrees[k].index, next);
    }
  });
  const Mean all = write_upper([&](std::size_t k, std::int64_t, std::int64_t& next) {  // once more, now that means are known
    next += subtrees[k].below.nodes;
    return means[k];
  });
  upper.write_root_average(all.value());
}

/// Values and averages of the further fields, in textures of their own at the same places.
std::vector<HostTexture> more_values(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const Options& options,
                                     const Plan& plan, const EncodedField& field, std::vector<Subtree>& subtrees,
                                     Stores& stores) {
  std::vector<HostTexture> more;
  for (int i = 1; i < request.field_count(); ++i) {
    BuildRequest own = request;
    own.field = request.field_at(i);
    HostTexture values = make_texture(element_name("tex_octree_values", i), request.storage, stores.values.size);
    HostTexture lod;
    if (plan.lod_texture) lod = make_texture(element_name("tex_octree_lod", i), request.storage, stores.lod.size);
    std::swap(stores.values, values);
    std::swap(stores.lod, lod);
    write_tree(h, own, tree, options, plan, field.scale_of(i), subtrees, stores);  // the words come out the same
    std::swap(stores.values, values);
    std::swap(stores.lod, lod);
    more.push_back(std::move(values));
    if (plan.lod_texture) more.push_back(std::move(lod));
  }
  return more;
}

// ---- reading the tree on the host

class TreeReader {
 public:
  TreeReader(const Stores& stores, const Options& options, const Plan& plan) : stores_(stores), options_(options), plan_(plan) {}

  /// Texel of a slot's own word (layout `rgba8`).
  std::size_t word_texel(std::int64_t slot) const {
    if (plan_.node_buffer) return static_cast<std::size_t>(slot);
    const Vec3i in_node(static_cast<int>(slot & 1), static_cast<int>((slot >> 1) & 1), static_cast<int>((slot >> 2) & 1));
    return Box{Vec3i(0), stores_.nodes.size}.offset(plan_.texture.position(slot >> 3) * 2 + in_node);
  }

  /// Node in a slot; -1 where the slot is no inner one.
  std::int64_t child(std::int64_t slot) const {
    const auto* words = stores_.nodes.as<std::uint32_t>();
    const bool buffer = plan_.node_buffer;
    const Box all{Vec3i(0), stores_.nodes.size};
    const Vec3i position = plan_.texture.position(slot >> 3);
    if (options_.paper_layout) {
      const std::uint32_t word = words[word_texel(slot)];
      if (word >> 24 != AMRTEX_OCTREE_INNER) return -1;
      return (word & 255) | (((word >> 8) & 255) << plan_.texture.shift.x) |
             (((word >> 16) & 255) << (plan_.texture.shift.x + plan_.texture.shift.y));
    }
    const std::uint32_t word = words[buffer ? static_cast<std::size_t>(slot >> 3) : all.offset(position)];
    const std::uint32_t bit = 1U << (slot & 7);
    if ((word & bit) == 0) return -1;
    return (word >> AMRTEX_OCTREE_MASK_BITS) + std::popcount(word & (bit - 1));
  }

 private:
  const Stores& stores_;
  const Options& options_;
  const Plan& plan_;
};

/// Octant of tree-space position `c` among children 2^shift wide.
int octant_of(const Vec3l& c, int shift) {
  const Vec3l bit = (c >> static_cast<std::int64_t>(shift)) & std::int64_t{1};
  return static_cast<int>(bit.x | (bit.y << 1) | (bit.z << 2));
}

void write_start_grid(const Tree& tree, const TreeReader& reader, const Plan& plan, Stores& stores) {
  const int shift = tree.level_0_shift + plan.start_shift;
  auto* entries = stores.start.as<std::uint32_t>();
  auto* slots = plan.start_slots ? stores.start_slots.as<std::uint32_t>() : nullptr;
  tbb::parallel_for(0, plan.start.z, [&](int z) {
    for_each_cell({Vec3i(0, 0, z), Vec3i(plan.start.x, plan.start.y, z + 1)}, [&](const Vec3i& g) {
      const Vec3l c = Vec3l(g) << static_cast<std::int64_t>(shift);
      int at = tree.root.shift;
      std::int64_t slot = 0;
      std::int64_t node = 0;
      while (at > shift && node >= 0) {
        slot = 8 * node + octant_of(c, --at);
        node = reader.child(slot);
      }
      const std::size_t i = Box{Vec3i(0), plan.start}.offset(g);
      const auto above = static_cast<std::uint32_t>(node >= 0 ? AMRTEX_OCTREE_START_INNER : at - shift);
      entries[i] = static_cast<std::uint32_t>(node >= 0 ? node : slot) | (above << AMRTEX_OCTREE_SLOT_BITS);
      if (slots != nullptr) slots[i] = static_cast<std::uint32_t>(slot);
    });
  });
}

// ---- value ranges of linear_lod: one a node, of everything that its leaves can return

/// Calls f(node, cells) for each node that has children among the cells of the box (space of the level of width 2^shift).
template <class F>
void for_each_node_of(const Tree& tree, const TreeReader& reader, int shift, const Box& box, F&& f) {
  const Vec3l origin = -tree.root.lower >> static_cast<std::int64_t>(shift);
  const Vec3l first = (Vec3l(box.lower) + origin) >> std::int64_t{1};
  const Vec3l last = (Vec3l(box.upper - Vec3i(1)) + origin) >> std::int64_t{1};
  for_each_cell({Vec3i(0), Vec3i(last - first) + Vec3i(1)}, [&](const Vec3i& p) {
    const Vec3l child = (first + Vec3l(p)) * std::int64_t{2};
    std::int64_t node = 0;
    for (int s = tree.root.shift - 1; s > shift && node >= 0; --s)
      node = reader.child(8 * node + octant_of(child << static_cast<std::int64_t>(shift), s));
    if (node < 0) return;
    const Vec3i lower(child - origin);
    f(node, intersection({lower, lower + Vec3i(2)}, box));
  });
}

/// Boxes of cells of a level that finer patches lie on, whether a patch of the level stores them or not.
std::vector<Box> refined_parts(const AmrHierarchy& h, int level) {
  std::vector<Box> parts;
  for (int finer = level + 1; finer < h.level_count(); ++finer)
    for (const PatchPart& part : patch_parts(h.patches(finer)))
      parts.push_back(part.box.coarsened(h.cell_width(level) / h.cell_width(finer)));
  return parts;
}

/// Ranges of field number `number` of all nodes.
std::vector<ValueRange> ranges_of_nodes(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree,
                                        const TreeReader& reader, int number) {
  std::vector<ValueRange> of_node(static_cast<std::size_t>(tree.nodes));
  tbb::spin_mutex mutex;  // a node may lie over the face between two parts
  tbb::enumerable_thread_specific<WindowRanges> windows;
  const auto add = [&](std::int64_t node, const ValueRange& range) {
    if (range.empty()) return;
    const tbb::spin_mutex::scoped_lock lock(mutex);
    ValueRange& all = of_node[static_cast<std::size_t>(node)];
    all.add(range.min);
    all.add(range.max);
  };
  for (int level = 0; level < h.level_count(); ++level) {
    const int shift = std::countr_zero(static_cast<unsigned>(h.cell_width(level)));
    const std::vector<PatchPart> parts = patch_parts(h.patches(level));
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
      const PatchPart& part = parts[k];
      const Box& patch = h.patches(level)[part.patch].box;
      const auto mask = h.leaf_mask(level, static_cast<int>(part.patch));
      WindowRanges& window = windows.local();
      window.read(h, request.field_at(number), level, part.box);
      for_each_node_of(tree, reader, shift, part.box, [&](std::int64_t node, const Box& cells) {
        ValueRange range;
        for_each_cell(cells, [&](const Vec3i& c) {
          if (mask[patch.offset(c)] != 0) window.add_to(range, c);
        });
        add(node, range);
      });
    });
    if (!request.needs.level_of_detail) continue;
    const std::vector<Box> refined = refined_parts(h, level);
    tbb::parallel_for(std::size_t{0}, refined.size(), [&](std::size_t k) {
      WindowRanges& window = windows.local();
      window.read(h, request.field_at(number), level, refined[k]);
      for_each_node_of(tree, reader, shift, refined[k], [&](std::int64_t node, const Box& cells) {
        ValueRange range;
        for_each_cell(cells, [&](const Vec3i& c) { window.add_to(range, c); });
        add(node, range);
      });
    });
  }
  return of_node;
}

void write_ranges(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const TreeReader& reader,
                  const EncodedField& field, HostTexture& ranges, MoreRanges& more) {
  for (int number = 0; number < (more.needed() ? field.field_count : 1); ++number) {
    const std::vector<ValueRange> of_node = ranges_of_nodes(h, request, tree, reader, number);
    auto* codes = ranges.as<std::uint32_t>();
    tbb::parallel_for(std::size_t{0}, of_node.size(), [&](std::size_t i) {
      if (number == 0) codes[i] = encode_range(of_node[i], field.range_origin, request.storage, field.scale);
      more.set(field, static_cast<std::int64_t>(i), number, of_node[i]);
    });
  }
}

// ---- gradients of the layout `rgba8`

/// Polar angle and azimuth in 8 bits each (octree_layout.h).
std::uint32_t direction_code(const Vec3d& g) {
  const double size = glm::length(g);
  if (!(size > 0) || !std::isfinite(size)) return 0;
  constexpr double kPi = std::numbers::pi;
  const auto polar = static_cast<std::uint32_t>(1 + std::lround(std::acos(std::clamp(g.z / size, -1.0, 1.0)) / kPi * 254));
  const auto azimuth = static_cast<std::uint32_t>(std::lround(std::atan2(g.y, g.x) / (2 * kPi) * 256) & 255);
  return (polar << 16) | (azimuth << 8);
}

/// Adds the direction of the central difference of the level values to each leaf.
void write_gradients(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const TreeReader& reader,
                     HostTexture& nodes) {
  for (int level = 0; level < h.level_count(); ++level) {
    const int shift = std::countr_zero(static_cast<unsigned>(h.cell_width(level)));
    const std::vector<PatchPart> parts = patch_parts(h.patches(level));
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
      const Box wide = parts[k].box.grown(1);
      const Box& patch = h.patches(level)[parts[k].patch].box;
      const auto mask = h.leaf_mask(level, static_cast<int>(parts[k].patch));
      std::vector<double> v(static_cast<std::size_t>(wide.cells()));
      filled_level_values(h, request.field, level, wide, v);
      const auto slope = [&](const Vec3i& c, const Vec3i& d) { return v[wide.offset(c + d)] - v[wide.offset(c - d)]; };
      for_each_node_of(tree, reader, shift, parts[k].box, [&](std::int64_t node, const Box& cells) {
        for_each_cell(cells, [&](const Vec3i& c) {
          if (mask[patch.offset(c)] == 0) return;
          const std::uint32_t code = direction_code({slope(c, {1, 0, 0}), slope(c, {0, 1, 0}), slope(c, {0, 0, 1})});
          const Vec3l tree_cell = Vec3l(c) - (tree.root.lower >> static_cast<std::int64_t>(shift));
          nodes.as<std::uint32_t>()[reader.word_texel(8 * node + octant_of(tree_cell, 0))] |= code;
        });
      });
    });
  }
}

// ---- the encoding

/// One tree serves several fields where all have a value in the same cells.
void require_shared_tree(const AmrHierarchy& h, const BuildRequest& request, const Options& o) {
  if (o.paper_layout)
    throw UnsupportedError(
        "encoding octree: layout rgba8 has room for one sample in a leaf; accepted: layout wide, or one field");
  for (int i = 0; i < request.field_count(); ++i)
    if (h.statistics(request.field_at(i)).cells_without_value > 0)
      throw UnsupportedError(fmt::format(
          "encoding octree: field {} has {} cells without a value, and the tree of several fields has one shape; "
          "accepted: fields that have a value in every cell, or one field",
          h.fields()[static_cast<std::size_t>(request.field_at(i))], h.statistics(request.field_at(i)).cells_without_value));
}

/// Nodes may go where only the volume is drawn, by its own filter.
void require_prunable(const BuildRequest& request, const Options& o) {
  if (request.needs.level_of_detail)
    throw UnsupportedError(
        "encoding octree: prune with a level of detail: an inner cell may show what none of its leaves does; accepted: one of "
        "both");
  if (o.paper_layout && o.store_gradients && request.needs.gradients)
    throw UnsupportedError(
        "encoding octree: prune with layout rgba8 and stored gradients: a gradient is interpolated between leaves that the "
        "filter "
        "does not read, and they would be gone; accepted: gradients computed, or layout wide");
}

class Octree final : public Encoding {
 public:
  std::string_view name() const override { return "octree"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"layout", "what a node is made of", "wide", "\"wide\" or \"rgba8\"", {"wide", "rgba8"}},
            {"traversal", "how a sample finds its cells", "fast", "\"fast\" or \"paper\""},
            {"gradients", "of surfaces that are lit, where the layout has room", "stored", "\"stored\" or \"computed\""},
            {"start_grid", "cells along the longest axis of the grid in place of the upper levels", "auto", kStartGridAccepted}};
  }
  void check_parameters(const Json& parameters) const override { options(parameters); }
  Support supported(const ContextInfo&) const override { return {}; }
  Support level_of_detail() const override { return {}; }
  bool prunes() const override { return true; }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options options(const Json& parameters) const;
  void require_support(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const;
  Plan plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Tree& tree) const;
  void plan_stores(const BuildRequest& request, const Options& o, const Tree& tree, Plan& p) const;
};

Options Octree::options(const Json& parameters) const {
  Options o;
  const auto choose = [&](const char* name, const char* usual, const char* other) {
    const Json& value = parameters.at(name);
    if (value != usual && value != other)
      throw UsageError(
          fmt::format("encoding octree: parameter {} is {}; accepted: \"{}\" or \"{}\"", name, value.dump(), usual, other));
    return value == other;
  };
  o.paper_layout = choose("layout", "wide", "rgba8");
  o.paper_traversal = choose("traversal", "fast", "paper");
  o.store_gradients = !choose("gradients", "stored", "computed");
  if (parameters.at("start_grid") == "auto") return o;
  o.start_grid = integer_parameter(*this, parameters, "start_grid");
  if (o.start_grid != 0 && (o.start_grid < 2 || o.start_grid > 1024 || !std::has_single_bit(static_cast<unsigned>(o.start_grid))))
    throw UsageError(fmt::format("encoding octree: parameter start_grid is {}; accepted: {}", o.start_grid, kStartGridAccepted));
  return o;
}

void Octree::require_support(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const {
  require_filter(*this, request.needs.filter);
  for (int l = 0; l < h.finest_level(); ++l)
    if (!std::has_single_bit(static_cast<unsigned>(h.ratio_to_finer(l))))
      throw UnsupportedError(fmt::format(
          "encoding octree: level {} is refined by {}, a node has 2 x 2 x 2 children; accepted: ratios that are powers of two", l,
          h.ratio_to_finer(l)));
  if (request.needs.filter == Filter::linear_lod && request.needs.filtering == Filtering::hardware &&
      request.storage != Storage::r64f)
    throw UnsupportedError(
        "encoding octree: filtering hardware with linear_lod: the texture unit cannot interpolate across nodes; accepted: "
        "manual");
  if (o.paper_layout && request.storage != Storage::r8)
    throw UnsupportedError(
        fmt::format("encoding octree: layout rgba8 holds a sample in 8 bits, not in {}; accepted: storage r8, or layout wide",
                    format_name(request.storage)));
  if (o.paper_layout && request.needs.level_of_detail)
    throw UnsupportedError(
        "encoding octree: no level of detail with layout rgba8: the word of an inner node has no room for a gradient, nor to say "
        "whether it has a value; accepted: layout wide");
  if (!request.needs.invisible.empty()) require_prunable(request, o);
  if (request.field_count() > 1) require_shared_tree(h, request, o);
  if (o.paper_traversal && o.start_grid > 0)
    throw UnsupportedError(
        fmt::format("encoding octree: traversal paper descends from the root, start_grid is {}; accepted: 0, or traversal fast",
                    o.start_grid));
}

/// The finest start grid that is asked for or that stays small beside the tree; never finer than level 0,
/// so that no cell that a filter looks for is wider than the grid's.
void plan_start_grid(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Tree& tree,
                     std::int64_t tree_bytes, Plan& p) {
  const int coarsest = tree.root.shift - tree.level_0_shift;
  p.start_shift = coarsest;
  if (o.paper_traversal || o.start_grid == 0) return;
  const Vec3l cells = Vec3l(h.cells(0)) + Vec3l(tree.ghosts ? 2 : 0);
  for (int shift = 0; shift < coarsest; ++shift) {
    const Vec3l n = (cells + Vec3l((std::int64_t{1} << shift) - 1)) >> static_cast<std::int64_t>(shift);
    const std::int64_t longest = std::max({n.x, n.y, n.z});
    if (longest > 1024) continue;  // three axes stay in 31 bits
    const std::int64_t bytes = 4 * n.x * n.y * n.z * (p.averages_in_slots ? 2 : 1);
    if (bytes > request.context.max_buffer_bytes) continue;
    if (o.start_grid == kAutomatic ? bytes * kStartGridShare > tree_bytes : longest > o.start_grid) continue;
    p.start = Vec3i(n);
    p.start_shift = shift;
    p.start_slots = p.averages_in_slots;
    return;
  }
}

void Octree::plan_stores(const BuildRequest& request, const Options& o, const Tree& tree, Plan& p) const {
  const std::int64_t most_bytes = request.context.max_buffer_bytes;
  const bool linear = request.needs.filter != Filter::nearest;
  const bool averages = linear || request.needs.level_of_detail;
  p.node_words = o.paper_layout ? 8 * tree.nodes : tree.nodes;
  p.node_buffer = !o.paper_traversal && 4 * p.node_words <= most_bytes;
  // several fields have their values in textures, of which a shader takes an array
  p.value_buffer =
      !o.paper_traversal && request.storage == Storage::r32f && 32 * tree.nodes <= most_bytes && request.field_count() == 1;
  p.lod_texture = averages && (o.paper_layout || o.paper_traversal);
  p.averages_in_slots = averages && !p.lod_texture;
  p.ranges = linear && request.needs.value_ranges;
  const int most_texels = request.context.max_3d_texture_size / 2;
  const int limit = o.paper_layout ? std::min(most_texels, 1 << kPaperAddressBits) : most_texels;
  const bool textures = !p.node_buffer || !p.value_buffer || p.lod_texture;
  if (textures && !lay_out(tree.nodes, limit, p.texture))
    throw UnsupportedError(
        fmt::format("encoding octree with layout {}: {} nodes of 2^3 texels, a 3D texture of {} texels an axis{} holds {}",
                    o.paper_layout ? "rgba8" : "wide", tree.nodes, request.context.max_3d_texture_size,
                    o.paper_layout ? " and addresses of 8 bits an axis" : "", std::int64_t{limit} * limit * limit));
}

Plan Octree::plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Tree& tree) const {
  if (tree.nodes > kMostNodes)
    throw UnsupportedError(
        fmt::format("encoding octree: {} nodes or more, an address of {} bits tells at most {} apart ({} leaf cells fit)",
                    tree.nodes, AMRTEX_OCTREE_INDEX_BITS, kMostNodes, 7 * kMostNodes + 1));
  Plan p;
  p.validity = (any_missing(h, request) || tree.pruned > 0) && !o.paper_layout;
  plan_stores(request, o, tree, p);
  const Vec3l texture(p.texture.nodes());
  const std::int64_t in_texture = texture.x * texture.y * texture.z;
  p.node_slots = p.node_buffer ? tree.nodes : in_texture;
  p.value_slots = p.value_buffer ? tree.nodes : in_texture;
  const std::int64_t value_bytes = texel_bytes(request.storage);
  std::int64_t tree_bytes = 4 * p.node_slots * (p.node_words / tree.nodes);
  const std::int64_t fields = request.field_count();
  if (!o.paper_layout) tree_bytes += fields * 8 * p.value_slots * value_bytes;
  // beside the tree of one field without padding, so that it does not depend on where the tree stands
  plan_start_grid(h, request, o, tree, 4 * p.node_words + (o.paper_layout ? 0 : 8 * tree.nodes * value_bytes), p);
  p.bytes = tree_bytes + (p.start_slots ? 8 : 4) * p.start_cells();
  if (p.lod_texture) p.bytes += fields * in_texture * value_bytes;
  if (p.validity) p.bytes += 4 * words_for_bits(8 * tree.nodes);
  if (p.ranges) p.bytes += 4 * tree.nodes + MoreRanges::bytes(request, tree.nodes);
  const std::int64_t largest = p.ranges ? 4 * tree.nodes : p.validity ? 4 * words_for_bits(8 * tree.nodes) : 0;
  if (largest > request.context.max_buffer_bytes)
    throw UnsupportedError(
        fmt::format("encoding octree: {} nodes need a buffer of {} bytes for value ranges or validity bits, the context takes {}",
                    tree.nodes, largest, request.context.max_buffer_bytes));
  require_budget(*this, p.bytes, request);
  return p;
}

Stores allocate(const BuildRequest& request, const Options& o, const Tree& tree, const Plan& p) {
  Stores s;
  const Vec3i nodes = p.texture.nodes();
  s.nodes = p.node_buffer ? make_buffer("octree_nodes", TexelFormat::r32ui, p.node_words)
                          : make_texture("tex_octree_nodes", TexelFormat::r32ui, o.paper_layout ? nodes * 2 : nodes);
  if (!o.paper_layout)
    s.values = p.value_buffer ? make_buffer("octree_values", request.storage, 8 * tree.nodes)
                              : make_texture("tex_octree_values", request.storage, nodes * 2);
  if (p.lod_texture) s.lod = make_texture("tex_octree_lod", request.storage, nodes);
  if (p.validity) s.validity = make_buffer("octree_validity", TexelFormat::r32ui, words_for_bits(8 * tree.nodes));
  if (p.start_cells() > 0) s.start = make_buffer("octree_start", TexelFormat::r32ui, p.start_cells());
  if (p.start_slots) s.start_slots = make_buffer("octree_start_slots", TexelFormat::r32ui, p.start_cells());
  if (p.ranges) s.ranges = make_buffer("octree_ranges", TexelFormat::r32ui, tree.nodes);
  return s;
}

/// Slots by what they are.
struct Counts {
  std::int64_t leaves, inner, empty;
};

void set_roles(const Options& o, const Tree& tree, const Plan& p, const Counts& counts, Stores& s) {
  HostTexture& values = o.paper_layout ? s.nodes : s.values;
  const std::int64_t bytes = texel_bytes(values.format);
  values.holds_values = true;
  values.roles = {};
  values.roles.payload = counts.leaves * bytes;
  if (o.paper_layout) values.roles.topology = counts.inner * bytes;
  if (p.averages_in_slots) values.roles.duplicated = counts.inner * bytes;
  values.roles.padding = values.bytes() - values.roles.total();
  if (!o.paper_layout) s.nodes.roles = {0, 0, 4 * tree.nodes, s.nodes.bytes() - 4 * tree.nodes};
  if (!p.lod_texture) return;
  const std::int64_t used = tree.nodes * texel_bytes(s.lod.format);
  s.lod.roles = {0, used, 0, s.lod.bytes() - used};
}

Json statistics(const Tree& tree, const Plan& p, const Counts& counts) {
  Json json;
  json["nodes"] = tree.nodes;
  json["depths"] = tree.root.shift;
  json["leaves"] = counts.leaves;
  json["empty"] = counts.empty;
  json["pruned_nodes"] = tree.pruned;
  json["start_grid"] = p.start_cells() > 0 ? Json{p.start.x, p.start.y, p.start.z} : Json(nullptr);
  json["start_grid_cells"] = p.start_cells();
  return json;
}

void add_shader_inputs(const Options& o, const Plan& p, const Tree& tree, EncodedField& field) {
  auto& defines = field.shader.defines;
  defines.emplace_back("AMRTEX_OCTREE_LAYOUT", o.paper_layout ? AMRTEX_OCTREE_RGBA8 : AMRTEX_OCTREE_WIDE);
  defines.emplace_back("AMRTEX_OCTREE_TRAVERSAL", o.paper_traversal ? AMRTEX_OCTREE_PAPER : AMRTEX_OCTREE_FAST);
  defines.emplace_back("AMRTEX_OCTREE_NODE_BUFFER", p.node_buffer ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_VALUE_BUFFER", p.value_buffer ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_LOD", p.lod_texture ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_START", p.start_cells() > 0 ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_START_SHIFT", p.start_shift);
  defines.emplace_back("AMRTEX_OCTREE_GHOSTS", tree.ghosts ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_PRUNED", tree.pruned > 0 ? 1 : 0);
  field.integer_uniforms.emplace_back("u_octree_shift", p.texture.shift);
  if (p.start_cells() > 0) field.integer_uniforms.emplace_back("u_octree_start", p.start);
}

/// Bytes that one node more would take.
std::int64_t node_bytes(const BuildRequest& request, const Options& o, const Plan& p) {
  const std::int64_t value_bytes = std::int64_t{request.field_count()} * texel_bytes(request.storage);
  std::int64_t bytes = o.paper_layout ? 8 * 4 : 4 + 8 * value_bytes;
  if (p.lod_texture) bytes += value_bytes;
  if (p.ranges) bytes += 4;
  return bytes;
}

std::vector<LeftOut> left_out(const BuildRequest& request, const Options& o, const Tree& tree, const Plan& p) {
  const bool linear = request.needs.filter != Filter::nearest;
  std::vector<LeftOut> list;
  if (tree.pruned > 0)  // what is left then needs bits
    list.push_back({"nodes", "no filter reads them where something can be seen",
                    tree.pruned * node_bytes(request, o, p) - (o.paper_layout ? 0 : tree.nodes), Part::hidden});
  if (o.paper_layout && !request.needs.gradients)
    list.push_back(
        {"gradients", "no surface is lit; their two channels stay empty", 0, o.store_gradients ? Part::gradients : Part::none});
  if (!p.lod_texture)
    list.push_back({"LOD texture",
                    p.averages_in_slots ? "the averages stand in the texels that inner children leave unused"
                                        : "the filter nearest reads no averages",
                    tree.nodes * texel_bytes(request.storage)});
  if (!p.validity && !o.paper_layout) list.push_back({"validity bits", "every cell has a value", tree.nodes, Part::validity});
  if (linear && !p.ranges) list.push_back({"value ranges", "no region is skipped", 4 * tree.nodes, Part::value_ranges});
  return list;
}

EncodedField Octree::build(const AmrHierarchy& h, const BuildRequest& request) const {
  const Json parameters = complete_parameters(*this, request.parameters);
  const Options o = options(parameters);
  require_support(h, request, o);
  Tree tree = place_tree(h, request);
  if (!request.needs.invisible.empty()) tree.visible.emplace(h, request, tree.root, tree.ghosts);
  std::vector<Subtree> subtrees = count_nodes(h, request.field, tree);
  const Plan p = plan(h, request, o, tree);

  EncodedField field = start_field(*this, h, request, parameters);
  Stores stores = allocate(request, o, tree, p);
  write_tree(h, request, tree, o, p, field.scale, subtrees, stores);
  std::vector<HostTexture> more = more_values(h, request, tree, o, p, field, subtrees, stores);
  const TreeReader reader(stores, o, p);
  if (p.start_cells() > 0) write_start_grid(tree, reader, p, stores);
  const bool gradients = o.paper_layout && o.store_gradients && request.needs.gradients;
  if (gradients) write_gradients(h, request, tree, reader, stores.nodes);
  BuildRequest ranged = request;
  ranged.needs.field_ranges = request.needs.field_ranges && p.ranges;  // nearest: a leaf's range is its value
  MoreRanges more_ranges(*this, ranged, "octree_more_ranges", tree.nodes);
  if (p.ranges) write_ranges(h, request, tree, reader, field, stores.ranges, more_ranges);
  const Counts counts{tree.leaves, tree.nodes - 1, 7 * tree.nodes + 1 - tree.leaves};
  set_roles(o, tree, p, counts, stores);
  for (HostTexture& t : more) {  // as those of the first field
    t.holds_values = t.name.starts_with("tex_octree_values");
    t.roles = (t.holds_values ? stores.values : stores.lod).roles;
  }
  field.statistics = statistics(tree, p, counts);
  field.left_out = left_out(request, o, tree, p);
  add_shader_inputs(o, p, tree, field);
  field.shader.defines.emplace_back("AMRTEX_OCTREE_GRADIENTS", gradients ? 1 : 0);
  for (HostTexture* t :
       {&stores.nodes, &stores.values, &stores.lod, &stores.validity, &stores.start, &stores.start_slots, &stores.ranges})
    if (!t->data.empty()) field.textures.push_back(std::move(*t));
  for (HostTexture& t : more) field.textures.push_back(std::move(t));
  more_ranges.move_to(field);
  std::int64_t working = p.ranges ? tree.nodes * static_cast<std::int64_t>(sizeof(ValueRange)) : 0;
  if (tree.visible) working += tree.visible->host_bytes();
  field.host_peak_bytes = field.memory().total() + working + static_cast<std::int64_t>(subtrees.size() * sizeof(Subtree));
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_octree() { return std::make_unique<Octree>(); }

}  // namespace amrtex
