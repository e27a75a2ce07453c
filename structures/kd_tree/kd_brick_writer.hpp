// Writes the values of bricks, their validity bits and their ranges.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "kd_bricks.hpp"
#include "kd_hats.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/store_box.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"

namespace amrtex::kd {

/// Values are read in blocks of at most so many cells along an axis.
inline constexpr int kChunk = 32;

/// The parts of a field that are written brick by brick.
struct Stores {
  HostTexture* values;  ///< of each texture of the pool, or brick, one a field
  HostTexture* data;
  HostTexture* validity;  ///< null where every cell has a value
  MoreRanges more_ranges;
};

/// Writes the values, validity bits and ranges of bricks. One object a thread; a brick is one thread's.
class BrickWriter {
 public:
  BrickWriter(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& plan, const EncodedField& field,
              const Stores& out)
      : hierarchy_(h), request_(request), options_(o), plan_(plan), field_(field), out_(out) {
    const bool leaks = field.filtering == Filtering::hardware && may_leak(o);
    for (int number = 0; number < field.field_count; ++number)
      leak_.push_back(leaks ? leaked_value(h.statistics(request.field_at(number)), plan.pool.packing.size) : 0);
  }

  void write(int brick) {
    for (const int leaf : plan_.bricks[static_cast<std::size_t>(brick)].leaves)
      for (int number = 0; number < field_.field_count; ++number) write_leaf(brick, leaf, number);
  }

 private:
  void write_leaf(int brick, int leaf, int number) {
    const Leaf& l = plan_.tree.leaves[static_cast<std::size_t>(leaf)];
    range_ = {};
    any_ = false;
    for_each_cell({Vec3i(0), ceil_div(l.cells.size(), kChunk)}, [&](const Vec3i& i) {
      const Vec3i lower = l.cells.lower + i * kChunk;
      const Box chunk{lower, glm::min(lower + Vec3i(kChunk), l.cells.upper)};
      read(l.level, chunk, request_.field_at(number));
      store(brick, number);
      note(leaf, chunk, number);
    });
    if (!request_.needs.value_ranges) return;
    if (options_.hats) add_reaching_values(hierarchy_, request_.field_at(number), plan_.tree, plan_.hats, leaf, range_);
    if (number == 0) data_node(leaf)[plan_.numbered ? 2 : 1] = encode_range(field_, 0, whole_range(0));
    out_.more_ranges.set(leaf, number, whole_range(number));
  }

  std::uint32_t* data_node(int leaf) const {
    return out_.data->as<std::uint32_t>() + static_cast<std::ptrdiff_t>(leaf) * plan_.data_words;
  }

  /// All that the filter may read for a sample in the chunk.
  void read(int level, const Box& chunk, int field) {
    box_ = options_.vertices ? Box{chunk.lower, chunk.upper + Vec3i(1)} : chunk.grown(options_.border);
    values_.resize(static_cast<std::size_t>(box_.cells()));
    missing_.assign(values_.size(), 0);
    if (!options_.vertices) return filled_level_values(hierarchy_, field, level, box_, values_, missing_);
    vertex_values(hierarchy_, field, level, box_, values_);
    if (!hierarchy_.has_missing(field)) return;
    own_.resize(static_cast<std::size_t>(chunk.cells()));
    level_values(hierarchy_, field, level, chunk, own_);
    std::size_t i = 0;  // the flags belong to cells and stand at their lower vertex
    for_each_cell(chunk, [&](const Vec3i& c) { missing_[box_.offset(c)] = std::isnan(own_[i++]) ? 1 : 0; });
  }

  void store(int brick, int number) {
    const auto b = static_cast<std::size_t>(brick);
    const Vec3i shift = plan_.pool.packing.at[b] - plan_.bricks[b].texels(options_).lower;
    const int before = plan_.pool.texture_of[b] * field_.field_count;
    store_box(box_, values_, shift, field_.scale_of(number), out_.values[before + number]);
  }

  /// Range and validity bits of what was read.
  void note(int leaf, const Box& chunk, int number) {
    for (const double v : values_) range_.add(v);
    if (out_.validity == nullptr) {
      any_ = true;
      return;
    }
    const Box cells = plan_.tree.leaves[static_cast<std::size_t>(leaf)].cells;
    std::uint32_t* words =
        out_.validity->as<std::uint32_t>() + data_node(leaf)[plan_.data_words - 1] + number * words_for_bits(cells.cells());
    for_each_cell(chunk, [&](const Vec3i& c) {
      if (missing_[box_.offset(c)] != 0) return;
      any_ = true;
      set_bit(words, static_cast<std::int64_t>(cells.offset(c)));
    });
  }

  /// Of all that a field can return in the leaf; empty where it has no value.
  ValueRange whole_range(int number) const {
    const double leak = leak_[static_cast<std::size_t>(number)];
    return any_ ? ValueRange{range_.min - leak, range_.max + leak} : ValueRange{};
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Options& options_;
  const Plan& plan_;
  const EncodedField& field_;
  const Stores& out_;
  std::vector<double> leak_;  ///< of each field
  Box box_;
  std::vector<double> values_, own_;
  std::vector<std::uint8_t> missing_;
  ValueRange range_;
  bool any_ = false;
};

}  // namespace amrtex::kd
