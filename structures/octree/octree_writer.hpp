// Writes the octree: nodes, values, averages and validity bits, in depth-first order.
#pragma once

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "octree_shape.hpp"
#include "structures/common/build_tools.hpp"

namespace amrtex::oct {

/// Mean of what has a value in a cell of the tree.
struct Mean {
  double sum = 0;
  double volume = 0;  ///< finest cells
  double value() const { return volume > 0 ? sum / volume : std::numeric_limits<double>::quiet_NaN(); }
};

/// The parts of a field that nodes are written to; null where they are absent.
struct Stores {
  HostTexture *nodes, *values, *lod, *validity;
};

/// Writes nodes in depth-first order. One object a thread.
class TreeWriter {
 public:
  TreeWriter(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const Options& options, const Plan& plan,
             StorageScale scale, const Stores& stores)
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
    if (!plan_.node_buffer) at = Box{Vec3i(0), stores_.nodes->size}.offset(plan_.texture.position(node));
    stores_.nodes->as<std::uint32_t>()[at] = word;
  }

  std::size_t slot_texel(std::int64_t slot, const HostTexture& texture) const {
    if (texture.kind == HostTexture::Kind::buffer) return static_cast<std::size_t>(slot);
    const Vec3i in_node(static_cast<int>(slot & 1), static_cast<int>((slot >> 1) & 1), static_cast<int>((slot >> 2) & 1));
    return Box{Vec3i(0), texture.size}.offset(plan_.texture.position(slot >> 3) * 2 + in_node);
  }

  void put_value(std::int64_t slot, double value) {
    store_values(request_.storage, scale_, &value, 1, stores_.values->data.data(), slot_texel(slot, *stores_.values));
  }

  void put_lod(std::int64_t node, double value) {
    const std::size_t at = Box{Vec3i(0), stores_.lod->size}.offset(plan_.texture.position(node));
    store_values(request_.storage, scale_, &value, 1, stores_.lod->data.data(), at);
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
    if (plan_.validity) stores_.validity->data[static_cast<std::size_t>(slot >> 3)] |= static_cast<std::byte>(1U << (slot & 7));
  }

  /// A word of the layout `rgba8`.
  void put_own_word(std::int64_t slot, std::uint32_t type, std::uint32_t rgb) {
    stores_.nodes->as<std::uint32_t>()[slot_texel(slot, *stores_.nodes)] = rgb | (type << 24);
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Options& options_;
  const Plan& plan_;
  StorageScale scale_;
  Stores stores_;
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

inline void write_tree(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const Options& options,
                       const Plan& plan, StorageScale scale, std::vector<Subtree>& subtrees, const Stores& stores) {
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
inline void write_more_fields(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const Options& options,
                              const Plan& plan, std::vector<Subtree>& subtrees, const Stores& stores, EncodedField& field) {
  for (int i = 1; i < request.field_count(); ++i) {
    BuildRequest own = request;
    own.field = request.field_at(i);
    Stores others = stores;
    others.values = field.find(element_name("tex_octree_values", i));
    others.lod = field.find(element_name("tex_octree_lod", i));
    write_tree(h, own, tree, options, plan, field.scale_of(i), subtrees, others);  // the words come out the same
  }
}

}  // namespace amrtex::oct
