// Writes regions and what finds them, with ranges of what the written bricks hold.
#pragma once

#include <tbb/parallel_for.h>

#include <cstdint>
#include <vector>

#include "brick_writer.hpp"
#include "exa_plan.hpp"
#include "structures/common/build_tools.hpp"

namespace amrtex::exa {

/// What the stored cells of a region's pieces say of it.
struct RegionFacts {
  ValueRange range;      ///< of field 0, as stored
  bool missing = false;  ///< has a cell no value, in any field?
};

/// Has a texel of the pool a value in a field?
inline bool has_value(const Plan& p, const Stores& stores, int number, std::size_t texel) {
  const auto* words = stores.validity->as<std::uint32_t>() + number * p.validity_words;
  return ((words[texel / 32] >> (texel % 32)) & 1U) != 0;
}

/// Calls f(texel) for every stored cell of a region's pieces.
template <class F>
void for_each_stored_cell(const Plan& p, int border, const Region& r, const HostTexture& pool, F&& f) {
  const Box all{Vec3i(0), pool.size};
  for (int k = 0; k < r.pieces; ++k) {
    const Piece& piece = p.set.pieces[static_cast<std::size_t>(r.first_piece + k)];
    const auto brick = static_cast<std::size_t>(piece.brick);
    const Vec3i shift = p.packing.at[brick] + Vec3i(border) - p.tree.bricks[brick].cells.lower;
    for_each_cell(piece.cells, [&](const Vec3i& c) { f(all.offset(c + shift)); });
  }
}

inline RegionFacts region_facts(const Plan& p, int border, const Region& r, const Stores& stores, StorageScale scale) {
  RegionFacts facts;
  const HostTexture& pool = *stores.pools.front();
  for_each_stored_cell(p, border, r, pool, [&](std::size_t texel) {
    bool has = true;
    for (std::size_t number = 0; p.missing && number < stores.pools.size(); ++number) {
      const bool bit = has_value(p, stores, static_cast<int>(number), texel);
      if (number == 0) has = bit;
      facts.missing = facts.missing || !bit;
    }
    if (has) facts.range.add(load_value(pool.format, scale, pool.data.data(), texel));
  });
  return facts;
}

/// Of the cells of a region's pieces in a field, as stored.
inline ValueRange range_in_field(const Plan& p, int border, const Region& r, const Stores& stores, StorageScale scale,
                                 int number) {
  ValueRange range;
  const HostTexture& pool = *stores.pools[static_cast<std::size_t>(number)];
  for_each_stored_cell(p, border, r, pool, [&](std::size_t texel) {
    if (!p.missing || has_value(p, stores, number, texel)) range.add(load_value(pool.format, scale, pool.data.data(), texel));
  });
  return range;
}

/// What is known of the regions' cells once they are written.
struct RegionTables {
  std::vector<RegionFacts> facts;
  double leak = 0;
};

/// What a group of regions may hold, coded: with holes or missing cells any value, since rays may not pass it as if it had a
/// side.
inline constexpr std::uint32_t kAnyRange = 0x7f80ff80U;

inline std::uint32_t coded_range(const BuildRequest& request, const EncodedField& field, const RegionFacts& facts, double leak) {
  if (facts.range.empty()) return kVacantRange;
  return encode_range({facts.range.min - leak, facts.range.max + leak}, field.range_origin, request.storage, field.scale);
}

/// Eight words a region.
inline void write_region(const Options& o, const Plan& p, const Region& r, const RegionFacts& facts, std::int64_t first_piece,
                         std::uint32_t* words) {
  const auto brick = static_cast<std::size_t>(r.brick);
  const Brick& b = p.tree.bricks[brick];
  const bool plain = r.plain && (!o.hats || !facts.missing);
  words[0] = packed_texel(p, p.packing.at[brick] + Vec3i(o.border));
  words[1] = packed_size(b.cells.size());
  words[2] = static_cast<std::uint32_t>(first_piece);
  words[3] = static_cast<std::uint32_t>(r.pieces) | static_cast<std::uint32_t>(b.level) << AMRTEX_EXA_PIECE_BITS |
             static_cast<std::uint32_t>(r.level) << (AMRTEX_EXA_PIECE_BITS + AMRTEX_EXA_LEVEL_BITS + 1) |
             (plain ? AMRTEX_EXA_PLAIN_FLAG : 0U) | (facts.missing ? AMRTEX_EXA_MISSING_FLAG : 0U) |
             (r.own ? AMRTEX_EXA_OWN_FLAG : 0U);
  for (int a = 0; a < 3; ++a) words[4 + a] = static_cast<std::uint32_t>(b.box().lower[a]);
  words[7] = static_cast<std::uint32_t>(r.brick);
}

/// Regions and their ranges, from what the pools hold.
inline RegionTables write_regions(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p,
                                  const Stores& stores, EncodedField& field) {
  RegionTables out;
  out.facts.resize(p.set.regions.size());
  const HostTexture& pool = *stores.pools.front();
  const auto leak_of = [&](int number) {  // past the last texel of a piece
    return pool.hardware_linear ? leaked_value(h.statistics(request.field_at(number)), pool.size) : 0;
  };
  out.leak = leak_of(0);
  auto* words = field.find("exa_regions")->as<std::uint32_t>();
  HostTexture* ranges = field.find("exa_ranges");
  const MoreRanges more(field, "exa_more_ranges");
  tbb::parallel_for(std::size_t{0}, p.set.regions.size(), [&](std::size_t i) {
    const Region& r = p.set.regions[i];
    RegionFacts& facts = out.facts[i];
    if (p.missing || ranges != nullptr) facts = region_facts(p, o.border, r, stores, field.scale);
    write_region(o, p, r, facts, p.first_piece[i], words + i * 8);
    if (ranges != nullptr) ranges->as<std::uint32_t>()[i] = coded_range(request, field, facts, out.leak);
    for (int number = 1; more.needed() && number < field.field_count; ++number) {
      ValueRange range = range_in_field(p, o.border, r, stores, field.scale_of(number), number);
      if (!range.empty()) range = {range.min - leak_of(number), range.max + leak_of(number)};
      more.set(static_cast<std::int64_t>(i), number, range);
    }
  });
  return out;
}

/// Of all regions below each node; `missing` where there are holes or cells without value.
inline std::vector<RegionFacts> facts_of_nodes(const Plan& p, const std::vector<RegionFacts>& regions) {
  std::vector<RegionFacts> nodes(p.set.nodes.size());
  for (std::size_t i = nodes.size(); i-- > 0;) {
    const RegionNode& n = p.set.nodes[i];
    if (n.first_child == 0) {
      if (n.region < 0)
        nodes[i].missing = true;
      else
        nodes[i] = regions[static_cast<std::size_t>(n.region)];
      continue;
    }
    for (const int child : {n.first_child, n.first_child + 1}) {
      const RegionFacts& part = nodes[static_cast<std::size_t>(child)];
      nodes[i].missing = nodes[i].missing || part.missing;
      if (part.range.empty()) continue;
      nodes[i].range.add(part.range.min);
      nodes[i].range.add(part.range.max);
    }
  }
  return nodes;
}

inline void write_brick_list(const Options& o, const Plan& p, HostTexture& bricks) {
  auto* words = bricks.as<std::uint32_t>();
  for (std::size_t i = 0; i < p.tree.bricks.size(); ++i, words += 8) {
    const Brick& b = p.tree.bricks[i];
    for (int a = 0; a < 3; ++a) words[a] = static_cast<std::uint32_t>(b.box().lower[a]);
    words[3] = static_cast<std::uint32_t>(b.level);
    words[6] = packed_texel(p, p.packing.at[i] + Vec3i(o.border));
    words[7] = packed_size(b.cells.size());
  }
}

inline void write_pieces(const AmrHierarchy& h, const Options& o, const Plan& p, HostTexture& pieces) {
  auto* words = pieces.as<std::uint32_t>();
  for (const Region& r : p.set.regions)
    for (int k = 0; p.keeps_pieces(o, r) && k < r.pieces; ++k, words += 4) {
      const Piece& piece = p.set.pieces[static_cast<std::size_t>(r.first_piece + k)];
      const auto brick = static_cast<std::size_t>(piece.brick);
      const Brick& b = p.tree.bricks[brick];
      words[0] = packed_texel(p, p.packing.at[brick] + Vec3i(o.border) + piece.cells.lower - b.cells.lower);
      words[1] = packed_size(piece.cells.size());
      const Vec3i offset = corner_offset(h, p, r, piece) + Vec3i(kMiddleOffset);
      words[2] = static_cast<std::uint32_t>(offset.x) | static_cast<std::uint32_t>(offset.y) << AMRTEX_EXA_OFFSET_BITS;
      words[3] = static_cast<std::uint32_t>(offset.z) | static_cast<std::uint32_t>(b.level) << AMRTEX_EXA_OFFSET_BITS;
    }
}

inline void write_nodes(const RegionSet& set, HostTexture& nodes) {
  auto* words = nodes.as<std::uint32_t>();
  for (const RegionNode& n : set.nodes) {
    *words++ = static_cast<std::uint32_t>(n.first_child) | static_cast<std::uint32_t>(n.axis) << AMRTEX_EXA_CHILD_BITS;
    *words++ = n.first_child != 0 ? static_cast<std::uint32_t>(n.plane)
               : n.region < 0     ? AMRTEX_EXA_NO_REGION
                                  : static_cast<std::uint32_t>(n.region);
  }
}

inline void write_bvh(const Plan& p, HostTexture& bvh) {
  auto* words = bvh.as<std::uint32_t>();
  for (const BvhNode& n : p.bvh) {
    const std::int64_t region = n.item < 0 ? -1 : p.leaf_region[static_cast<std::size_t>(n.item)];
    const std::uint32_t code = n.item < 0 ? 0U : region < 0 ? AMRTEX_EXA_NO_REGION : static_cast<std::uint32_t>(region + 1);
    write_box(n.box, code, static_cast<std::uint32_t>(n.skip), words);
    words += 8;
  }
}

inline void write_start_grid(const AmrHierarchy& h, const BuildRequest& request, const Plan& p, const RegionTables& tables,
                             EncodedField& field) {
  std::vector<RegionFacts> facts;
  if (request.needs.value_ranges) facts = facts_of_nodes(p, tables.facts);
  const auto range_of = [&](std::uint32_t node) {
    return facts.empty() ? 0U : facts[node].missing ? kAnyRange : coded_range(request, field, facts[node], tables.leak);
  };
  p.grid.write(node_boxes(h, p.set), range_of, *field.find("exa_start"), *field.find("exa_start_nodes"));
}

}  // namespace amrtex::exa
