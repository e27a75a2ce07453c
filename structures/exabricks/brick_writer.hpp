// Writes the values of bricks and their validity bits.
#pragma once

#include <tbb/parallel_for.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <vector>

#include "exa_plan.hpp"
#include "structures/common/store_box.hpp"
#include "structures/mesh/level_values.hpp"

namespace amrtex::exa {

/// The parts of a field that hold bricks.
struct Stores {
  std::vector<HostTexture*> pools;  ///< one a field, all laid out in the same way
  HostTexture* validity;            ///< null where every cell of a brick has a value
  explicit Stores(EncodedField& field) : validity(field.find("exa_validity")) {
    for (int number = 0; number < field.field_count; ++number) pools.push_back(field.find(element_name("tex_exa_pool", number)));
  }
};

/// Do two threads write the same word? Bits of a brick's texels share words with other bricks'.
inline void set_shared_bit(std::uint32_t* words, std::size_t bit) {
  std::atomic_ref<std::uint32_t>(words[bit / 32]).fetch_or(1U << (bit % 32), std::memory_order_relaxed);
}

/// Writes the values of bricks and their borders. One object a thread; a brick is one thread's.
class BrickWriter {
 public:
  BrickWriter(const AmrHierarchy& h, const BuildRequest& request, const Plan& plan, int border, const EncodedField& field,
              const Stores& out)
      : hierarchy_(h), request_(request), plan_(plan), border_(border), field_(field), out_(out) {}

  void write(std::size_t brick) {
    const Brick& b = plan_.tree.bricks[brick];
    box_ = b.cells.grown(border_);
    for (int number = 0; number < field_.field_count; ++number) {
      read(b.level, request_.field_at(number));
      for (const Repeat& r : plan_.set.repeats[brick]) values_[box_.offset(r.cell)] = values_[box_.offset(r.source)];
      store(brick, number);
    }
  }

 private:
  void read(int level, int field) {
    values_.resize(static_cast<std::size_t>(box_.cells()));
    missing_.assign(values_.size(), 0);
    if (border_ > 0) return filled_level_values(hierarchy_, field, level, box_, values_, missing_);
    level_values(hierarchy_, field, level, box_, values_);
    for (std::size_t i = 0; i < values_.size(); ++i) missing_[i] = std::isnan(values_[i]) ? 1 : 0;
  }

  void store(std::size_t brick, int number) {
    const Vec3i shift = plan_.packing.at[brick] - box_.lower;
    HostTexture& pool = *out_.pools[static_cast<std::size_t>(number)];
    store_box(box_, values_, shift, field_.scale_of(number), pool);
    if (out_.validity == nullptr) return;
    const Box all{Vec3i(0), pool.size};
    auto* words = out_.validity->as<std::uint32_t>() + number * plan_.validity_words;
    std::size_t i = 0;
    for_each_cell(box_, [&](const Vec3i& c) {
      if (missing_[i++] == 0) set_shared_bit(words, all.offset(c + shift));
    });
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Plan& plan_;
  int border_;
  const EncodedField& field_;
  const Stores& out_;
  Box box_;
  std::vector<double> values_;
  std::vector<std::uint8_t> missing_;
};

inline void write_bricks(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p,
                         const EncodedField& field, const Stores& out) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, p.tree.bricks.size()), [&](const auto& range) {
    BrickWriter writer(h, request, p, o.border, field, out);
    for (std::size_t i = range.begin(); i != range.end(); ++i) writer.write(i);
  });
}

}  // namespace amrtex::exa
