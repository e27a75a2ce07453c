// Packing bricks of texels into one 3D texture, the pool.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex::packing {

/// Texture axes beyond this cost bits of the normalised coordinate (hardware filtering).
inline constexpr int kPreferredEdge = 1024;
/// A pool this full is good enough to look no further.
inline constexpr double kEnoughFill = 0.97;
/// More bricks than this are packed in layers: empty boxes of a whole container would be too many to search.
inline constexpr std::size_t kManyBricks = 2000;

struct Packing {
  Vec3i size{0};          ///< of the pool, texels; 0: the bricks do not fit
  std::vector<Vec3i> at;  ///< lower corner of each brick
  std::int64_t texels() const { return std::int64_t{size.x} * size.y * size.z; }
  bool valid() const { return texels() > 0; }
  bool better_than(const Packing& other) const {
    if (!valid() || !other.valid()) return valid();
    const auto wide = [](const Vec3i& s) { return std::max({s.x, s.y, s.z}) > kPreferredEdge; };
    if (wide(size) != wide(other.size)) return wide(other.size);
    return texels() < other.texels();
  }
};

inline std::int64_t volume(const Vec3i& v) { return std::int64_t{v.x} * v.y * v.z; }

inline std::int64_t used_texels(std::span<const Vec3i> bricks) {
  std::int64_t sum = 0;
  for (const Vec3i& b : bricks) sum += volume(b);
  return sum;
}

/// Used texels over all texels of the pool.
inline double fill(const Packing& p, std::span<const Vec3i> bricks) {
  return p.valid() ? static_cast<double>(used_texels(bricks)) / static_cast<double>(p.texels()) : 0;
}

/// Orders bricks by `key` (a tuple of negated extents or the like), equal ones as they came.
template <class Key>
std::vector<std::size_t> order_by(std::span<const Vec3i> bricks, Key&& key) {
  std::vector<std::size_t> order(bricks.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return key(bricks[a]) > key(bricks[b]); });
  return order;
}

inline std::vector<std::size_t> order_by_zyx(std::span<const Vec3i> bricks) {
  return order_by(bricks, [](const Vec3i& b) { return std::array{b.z, b.y, b.x}; });
}

/// Extents worth trying for one axis of the container: multiples of the largest brick, and parts of the cube that would
/// hold all bricks without a gap.
inline std::vector<int> container_extents(std::span<const Vec3i> bricks, int axis, int limit) {
  int largest = 1;
  for (const Vec3i& b : bricks) largest = std::max(largest, b[axis]);
  const double edge = std::cbrt(static_cast<double>(used_texels(bricks)));
  std::vector<int> extents{largest};
  for (int k = 2; k <= 24 && k * largest < 2.5 * edge; ++k) extents.push_back(k * largest);
  for (const double f : {0.4, 0.5, 0.63, 0.8, 0.9, 1.0, 1.1, 1.25, 1.6, 2.0, 2.5})
    extents.push_back(std::max(largest, static_cast<int>(std::ceil(edge * f))));
  std::sort(extents.begin(), extents.end());
  extents.erase(std::unique(extents.begin(), extents.end()), extents.end());
  std::erase_if(extents, [&](int e) { return e > limit; });
  return extents;
}

/// Next-fit decreasing height in a container of x by y texels (Kähler & Abel 2013, section 4.1).
inline Packing nfdh(std::span<const Vec3i> bricks, std::span<const std::size_t> order, int x, int y, int limit) {
  Packing p;
  p.at.resize(bricks.size());
  Vec3i corner(0);
  int row = 0, layer = 0;  // extents along y and z of what the open row and layer hold
  for (const std::size_t i : order) {
    const Vec3i& b = bricks[i];
    if (corner.x + b.x > x || corner.y + b.y > y) {
      corner = {0, corner.y + row, corner.z};
      row = 0;
    }
    if (corner.y + b.y > y) {
      corner = {0, 0, corner.z + layer};
      row = layer = 0;
    }
    p.at[i] = corner;
    p.size = glm::max(p.size, corner + b);
    corner.x += b.x;
    row = std::max(row, b.y);
    layer = std::max(layer, b.z);
    if (corner.z + layer > limit) return {};
  }
  return p;
}

/// The paper's packing: NFDH for many container bases, the smallest kept.
inline Packing pack_nfdh(std::span<const Vec3i> bricks, int limit) {
  const std::vector<std::size_t> order = order_by_zyx(bricks);
  Packing best;
  for (const int y : container_extents(bricks, 1, limit))
    for (const int x : container_extents(bricks, 0, limit)) {
      Packing p = nfdh(bricks, order, x, y, limit);
      if (p.better_than(best)) best = std::move(p);
    }
  return best;
}

/// Packs into a container of a fixed base and an open top. It knows every maximal empty box and puts each brick into
/// the corner of one: where the container grows least, then lowest.
class EmptySpacePacker {
 public:
  EmptySpacePacker(std::span<const Vec3i> bricks, int x, int y, int limit, std::int64_t& work)
      : bricks_(bricks), spaces_{{Vec3i(0), {x, y, limit}}}, work_(work) {
    smallest_ = Vec3i(std::numeric_limits<int>::max());
    for (const Vec3i& b : bricks) smallest_ = glm::min(smallest_, b);
  }

  /// An invalid packing where a brick finds no place, or where `work` passes `most_work`.
  Packing pack(std::span<const std::size_t> order, bool tight, std::int64_t most_work) {
    Packing p;
    p.at.resize(bricks_.size());
    for (const std::size_t i : order) {
      const std::optional<Vec3i> at = place(bricks_[i], p.size.z, tight);
      if (!at || work_ > most_work) return {};
      p.at[i] = *at;
      p.size = glm::max(p.size, *at + bricks_[i]);
    }
    return p;
  }

  /// Where the brick was put; nullopt where it finds no place. `height`: what the container is filled to already.
  std::optional<Vec3i> place(const Vec3i& brick, int height, bool tight) {
    const Box* space = choose(brick, height, tight);
    if (space == nullptr) return std::nullopt;
    const Vec3i at = space->lower;
    occupy({at, at + brick});
    return at;
  }

 private:
  const Box* choose(const Vec3i& b, int height, bool tight) {
    const Box* best = nullptr;
    std::array<int, 5> best_key{};
    work_ += static_cast<std::int64_t>(spaces_.size());
    for (const Box& s : spaces_) {
      const Vec3i left = s.size() - b;
      if (left.x < 0 || left.y < 0 || left.z < 0) continue;
      const int growth = std::max(s.lower.z + b.z - height, 0);
      const std::array key{growth, tight ? std::min(left.x, left.y) : 0, s.lower.z, s.lower.y, s.lower.x};
      if (best != nullptr && key >= best_key) continue;
      best = &s;
      best_key = key;
    }
    return best;
  }

  void occupy(const Box& placed) {
    cut_.clear();
    const auto hit = std::stable_partition(spaces_.begin(), spaces_.end(), [&](const Box& s) { return !overlap(s, placed); });
    for (auto s = hit; s != spaces_.end(); ++s) cut_around(*s, placed);
    spaces_.erase(hit, spaces_.end());
    const std::size_t kept = spaces_.size();
    work_ += static_cast<std::int64_t>(cut_.size() * (kept + cut_.size()));
    for (std::size_t i = 0; i < cut_.size(); ++i)
      if (!covered(i, kept)) spaces_.push_back(cut_[i]);
  }

  /// What is left of a space on each side of the brick, where any brick could still fit.
  void cut_around(const Box& space, const Box& placed) {
    for (int axis = 0; axis < 3; ++axis)
      for (const bool below : {true, false}) {
        Box part = space;
        if (below)
          part.upper[axis] = std::min(part.upper[axis], placed.lower[axis]);
        else
          part.lower[axis] = std::max(part.lower[axis], placed.upper[axis]);
        if (glm::all(glm::greaterThanEqual(part.size(), smallest_))) cut_.push_back(part);
      }
  }

  /// Does another space hold all of this one? Of equal ones the first stays.
  bool covered(std::size_t i, std::size_t kept) const {
    for (std::size_t k = 0; k < kept; ++k)
      if (spaces_[k].contains(cut_[i])) return true;
    for (std::size_t k = 0; k < cut_.size(); ++k)
      if (k != i && cut_[k].contains(cut_[i]) && (k < i || !(cut_[k] == cut_[i]))) return true;
    return false;
  }

  std::span<const Vec3i> bricks_;
  std::vector<Box> spaces_;
  std::vector<Box> cut_;
  Vec3i smallest_{1};
  std::int64_t& work_;
};

/// Thousands of bricks: layers as high as their highest brick, each filled with whatever fits of what is left. The
/// bricks of a layer are of similar height, so that empty boxes are few and a layer is nearly full.
inline Packing pack_layers(std::span<const Vec3i> bricks, std::vector<std::size_t> rest, int x, int y, int limit,
                           std::int64_t& work) {
  Packing p;
  p.at.resize(bricks.size());
  std::vector<std::size_t> left;
  for (int z = 0; !rest.empty(); rest.swap(left)) {
    const int height = bricks[rest.front()].z;
    if (z + height > limit) return {};
    left.clear();
    EmptySpacePacker layer(bricks, x, y, height, work);
    for (const std::size_t i : rest) {
      const std::optional<Vec3i> at = layer.place(bricks[i], height, true);
      if (at)
        p.at[i] = *at + Vec3i(0, 0, z);
      else
        left.push_back(i);
      if (at) p.size = glm::max(p.size, p.at[i] + bricks[i]);
    }
    z += height;
  }
  return p;
}

/// The default: NFDH, and while the pool is not full enough, maximal empty spaces in several containers and orders.
/// `most_work` bounds the search by counted steps, not by time, so that a build has the same bytes everywhere.
inline Packing pack_best_fit(std::span<const Vec3i> bricks, int limit, std::int64_t most_work = 400'000'000) {
  Packing best = pack_nfdh(bricks, limit);
  const std::array orders{
      order_by(bricks,
               [](const Vec3i& b) {
                 return std::array{volume(b), std::int64_t{b.z}};
               }),
      order_by(bricks,
               [](const Vec3i& b) {
                 return std::array{std::max({b.x, b.y, b.z}), b.z};
               }),
      order_by_zyx(bricks),
  };
  const double edge = std::cbrt(static_cast<double>(used_texels(bricks)));
  Vec3i largest(1);
  for (const Vec3i& b : bricks) largest = glm::max(largest, b);
  std::int64_t work = 0;
  for (const double f : {1.0, 0.8, 1.25, 0.65}) {
    const int x = std::max(largest.x, static_cast<int>(edge * f));
    const int y = std::max(largest.y, static_cast<int>(edge * f));
    if (fill(best, bricks) >= kEnoughFill || work >= most_work) return best;
    if (std::max(x, y) > limit) continue;
    Packing p = pack_layers(bricks, orders.back(), x, y, limit, work);
    if (p.better_than(best)) best = std::move(p);
  }
  if (bricks.size() > kManyBricks) return best;
  for (const double fx : {0.85, 0.7, 1.0, 0.6, 1.2})
    for (const double fy : {0.85, 0.7, 1.0, 0.6, 1.2})
      for (const bool tight : {false, true})
        for (const auto& order : orders) {
          if (fill(best, bricks) >= kEnoughFill || work >= most_work) return best;
          const int x = std::max(largest.x, static_cast<int>(edge * fx));
          const int y = std::max(largest.y, static_cast<int>(edge * fy));
          if (std::max(x, y) > limit) continue;
          Packing p = EmptySpacePacker(bricks, x, y, limit, work).pack(order, tight, 3 * most_work);
          if (p.better_than(best)) best = std::move(p);
        }
  return best;
}

}  // namespace amrtex::packing
