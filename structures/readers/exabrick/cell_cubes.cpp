#include "structures/readers/exabrick/cell_cubes.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <tbb/spin_mutex.h>

#include <algorithm>
#include <bit>
#include <mutex>
#include <utility>

#include "structures/mesh/cell_boxes.hpp"

namespace amrtex {
namespace {

constexpr int kEdge = 4;                                  // of a cube, in cells
constexpr std::uint64_t kEighth = 0x0000'0000'0033'0033;  // 2 x 2 x 2 cells at the lower corner

int bit_of(const Vec3i& cell) { return (cell.x & 3) + 4 * (cell.y & 3) + 16 * (cell.z & 3); }
Vec3i cell_of(const CellCube& cube, int bit) { return cube.at * kEdge + Vec3i(bit & 3, bit >> 2 & 3, bit >> 4); }
Vec3i halved(const Vec3i& v) { return {v.x >> 1, v.y >> 1, v.z >> 1}; }

bool before(const CellCube& a, const CellCube& b) { return array_order(a.at, b.at); }

/// The first cell of a cube, in the order of arrays: that of its bits.
Vec3i first_of(const CellCube& cube) { return cell_of(cube, std::countr_zero(cube.bits)); }

void sort_cubes(CellCubes& cubes) { tbb::parallel_sort(cubes.begin(), cubes.end(), before); }

/// Makes one of cubes that stand in one place, one behind the other.
void join_same(CellCubes& cubes) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cubes.size(); ++i)
    if (kept > 0 && cubes[kept - 1].at == cubes[i].at)
      cubes[kept - 1].bits |= cubes[i].bits;
    else
      cubes[kept++] = cubes[i];
  cubes.resize(kept);
}

/// One of eight bits for each 2 x 2 x 2 cells: is any of them there, or are all?
std::uint64_t eighths_with_any(std::uint64_t bits) {
  bits |= bits >> 1;
  bits |= bits >> 4;
  return bits | bits >> 16;
}
std::uint64_t eighths_with_all(std::uint64_t bits) {
  bits &= bits >> 1;
  bits &= bits >> 4;
  return bits & bits >> 16;
}

/// Parents twice as wide; `of_eighths` answers at the lowest bit of each 2 x 2 x 2 cells.
template <class F>
CellCubes parents(const CellCubes& cells, F&& of_eighths) {
  CellCubes found;
  for (const CellCube& cube : cells) {
    const std::uint64_t eighths = of_eighths(cube.bits);
    const int first = bit_of(cube.at * 2);  // of the cube's 2 x 2 x 2 parents in their own cube
    std::uint64_t bits = 0;
    for (int z = 0; z < 2; ++z)
      for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 2; ++x) bits |= (eighths >> (2 * x + 8 * y + 32 * z) & 1) << (first + x + 4 * y + 16 * z);
    if (bits == 0) continue;
    const Vec3i at = halved(cube.at);
    if (!found.empty() && found.back().at == at)
      found.back().bits |= bits;
    else
      found.push_back({at, bits});
  }
  sort_cubes(found);
  join_same(found);
  return found;
}

template <class F>
CellCubes ancestors(CellCubes cells, int ratio, F&& of_eighths) {
  for (; ratio > 1; ratio /= 2) cells = parents(cells, of_eighths);
  return cells;
}

std::uint64_t bits_at(const CellCubes& cells, const Vec3i& at) {
  const auto found = std::lower_bound(cells.begin(), cells.end(), CellCube{at, 0}, before);
  return found != cells.end() && found->at == at ? found->bits : 0;
}

/// Those cells of a cube that lie in one of the parents.
std::uint64_t inside(const Vec3i& at, const CellCubes& parents, int ratio) {
  if (ratio == 2) {
    const std::uint64_t bits = bits_at(parents, halved(at)) >> bit_of(at * 2);
    std::uint64_t covered = 0;
    for (int z = 0; z < 2; ++z)
      for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 2; ++x) covered |= (bits >> (x + 4 * y + 16 * z) & 1) * kEighth << (2 * x + 8 * y + 32 * z);
    return covered;
  }
  const Vec3i parent = at / (ratio / kEdge);
  return (bits_at(parents, parent / kEdge) >> bit_of(parent) & 1) != 0 ? ~std::uint64_t{0} : 0;
}

/// Adds the runs of cubes that stand in a row.
void add_runs(std::vector<CellCube>::const_iterator begin, std::vector<CellCube>::const_iterator end, std::vector<Box>& runs) {
  for (int row = 0; row < kEdge * kEdge; ++row) {
    const Vec3i offset(0, row % kEdge, row / kEdge);
    Box open;
    for (auto cube = begin; cube != end; ++cube) {
      const auto bits = static_cast<unsigned>(cube->bits >> (kEdge * row)) & 15U;
      const Vec3i first = cube->at * kEdge + offset;
      const auto put = [&](const Vec3i& cell, int count) {
        if (!open.empty() && open.upper.x == cell.x) {
          open.upper.x += count;
          return;
        }
        if (!open.empty()) runs.push_back(open);
        open = {cell, cell + Vec3i(count, 1, 1)};
      };
      if (bits == 15)
        put(first, kEdge);
      else
        for (int x = 0; x < kEdge; ++x)
          if ((bits >> x & 1) != 0) put(first + Vec3i(x, 0, 0), 1);
    }
    if (!open.empty()) runs.push_back(open);
  }
}

std::uint64_t hash_of(const Vec3i& at) {
  std::uint64_t h = static_cast<std::uint64_t>(at.x) * 0x9E3779B97F4A7C15;
  h = (h ^ h >> 32 ^ static_cast<std::uint64_t>(at.y)) * 0xC2B2AE3D27D4EB4F;
  h = (h ^ h >> 32 ^ static_cast<std::uint64_t>(at.z)) * 0x9E3779B97F4A7C15;
  return h ^ h >> 32;
}

}  // namespace

std::int64_t count_cells(const CellCubes& cells) {
  std::int64_t count = 0;
  for (const CellCube& cube : cells) count += std::popcount(cube.bits);
  return count;
}

Vec3i first_cell(const CellCubes& cells) {
  return first_of(*std::min_element(cells.begin(), cells.end(),
                                    [](const CellCube& a, const CellCube& b) { return array_order(first_of(a), first_of(b)); }));
}

CellCubes joined(const CellCubes& a, const CellCubes& b) {
  CellCubes both(a.size() + b.size());
  std::merge(a.begin(), a.end(), b.begin(), b.end(), both.begin(), before);
  join_same(both);
  return both;
}

CellCubes common(const CellCubes& a, const CellCubes& b) {
  CellCubes both;
  for (auto p = a.begin(), q = b.begin(); p != a.end() && q != b.end();) {
    if (before(*p, *q)) {
      ++p;
    } else if (before(*q, *p)) {
      ++q;
    } else {
      if ((p->bits & q->bits) != 0) both.push_back({p->at, p->bits & q->bits});
      ++p;
      ++q;
    }
  }
  return both;
}

CellCubes touched_parents(CellCubes cells, int ratio) { return ancestors(std::move(cells), ratio, eighths_with_any); }
CellCubes whole_parents(CellCubes cells, int ratio) { return ancestors(std::move(cells), ratio, eighths_with_all); }

CellCubes outside(CellCubes cells, const CellCubes& parents, int ratio) {
  if (parents.empty()) return cells;
  tbb::parallel_for(std::size_t{0}, cells.size(), [&](std::size_t i) { cells[i].bits &= ~inside(cells[i].at, parents, ratio); });
  std::erase_if(cells, [](const CellCube& cube) { return cube.bits == 0; });
  return cells;
}

std::vector<Box> runs_of(const CellCubes& cells) {
  const auto same_row = [](const CellCube& a, const CellCube& b) { return a.at.y == b.at.y && a.at.z == b.at.z; };
  const auto begins_row = [&](std::size_t i) { return i == 0 || i == cells.size() || !same_row(cells[i - 1], cells[i]); };
  std::vector<Box> runs;
  std::mutex mutex;
  constexpr std::size_t kAtOnce = 1 << 14;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cells.size(), kAtOnce), [&](const tbb::blocked_range<std::size_t>& range) {
    std::vector<Box> own;  // of rows that begin in the range
    std::size_t begin = range.begin();
    while (begin < range.end() && !begins_row(begin)) ++begin;
    while (begin < range.end()) {
      std::size_t end = begin + 1;
      while (!begins_row(end)) ++end;
      add_runs(cells.begin() + static_cast<std::ptrdiff_t>(begin), cells.begin() + static_cast<std::ptrdiff_t>(end), own);
      begin = end;
    }
    const std::lock_guard lock(mutex);
    runs.insert(runs.end(), own.begin(), own.end());
  });
  return runs;
}

// ---- cells as they come ----

/// Some of the cubes, by their place: a table with open addresses.
struct CellCollector::Shard {
  void add(const CellCube& cube) {
    if (2 * (count + 1) > slots.size()) grow();
    CellCube& slot = slot_of(cube.at);
    if (slot.bits == 0) {
      slot = cube;
      ++count;
      return;
    }
    if ((slot.bits & cube.bits) != 0) note({cube.at, slot.bits & cube.bits});
    slot.bits |= cube.bits;
  }
  void note(const CellCube& cube) {
    const Vec3i cell = first_of(cube);
    if (!twice || array_order(cell, *twice)) twice = cell;
  }
  CellCube& slot_of(const Vec3i& at) {
    const std::size_t mask = slots.size() - 1;
    std::size_t i = hash_of(at) & mask;
    while (slots[i].bits != 0 && slots[i].at != at) i = (i + 1) & mask;
    return slots[i];
  }
  void grow() {
    std::vector<CellCube> old(std::max<std::size_t>(16, 2 * slots.size()));
    old.swap(slots);
    for (const CellCube& cube : old)
      if (cube.bits != 0) slot_of(cube.at) = cube;
  }

  tbb::spin_mutex mutex;
  std::vector<CellCube> slots;  // without bits: free; as many as a power of two
  std::size_t count = 0;
  std::optional<Vec3i> twice;
};

namespace {
constexpr int kShardBits = 6;
constexpr std::size_t kShards = std::size_t{1} << kShardBits;
}  // namespace

CellCollector::CellCollector() : shards_(std::make_unique<Shard[]>(kShards)) {}
CellCollector::~CellCollector() = default;
CellCollector::CellCollector(CellCollector&&) noexcept = default;
CellCollector& CellCollector::operator=(CellCollector&&) noexcept = default;

CellCollector::Shard& CellCollector::shard_of(const Vec3i& at) const { return shards_[hash_of(at) >> (64 - kShardBits)]; }

void CellCollector::add(const CellCube& cube) {
  Shard& shard = shard_of(cube.at);
  const tbb::spin_mutex::scoped_lock lock(shard.mutex);
  shard.add(cube);
}

void CellCollector::note_twice(const CellCube& cube) {
  Shard& shard = shard_of(cube.at);
  const tbb::spin_mutex::scoped_lock lock(shard.mutex);
  shard.note(cube);
}

std::optional<Vec3i> CellCollector::twice() const {
  std::optional<Vec3i> first;
  for (std::size_t i = 0; i < kShards; ++i)
    if (const auto& own = shards_[i].twice; own && (!first || array_order(*own, *first))) first = own;
  return first;
}

CellCubes CellCollector::take() {
  CellCubes all;
  std::size_t count = 0;
  for (std::size_t i = 0; i < kShards; ++i) count += shards_[i].count;
  all.reserve(count);
  for (std::size_t i = 0; i < kShards; ++i) {
    for (const CellCube& cube : std::exchange(shards_[i].slots, {}))
      if (cube.bits != 0) all.push_back(cube);
    shards_[i].count = 0;
  }
  sort_cubes(all);
  return all;
}

void CellGatherer::add(std::size_t level, const Vec3i& cell, std::uint32_t count) {
  Vec3i at = cell;
  while (count > 0) {
    const std::uint32_t here = std::min(count, static_cast<std::uint32_t>(kEdge - (at.x & 3)));
    add(level, CellCube{{at.x >> 2, at.y >> 2, at.z >> 2}, ((std::uint64_t{1} << here) - 1) << bit_of(at)});
    at.x += static_cast<int>(here);
    count -= here;
  }
}

void CellGatherer::add(std::size_t level, const CellCube& cube) {
  // cubes of one block of 64 x 16 x 4 have places of their own, and so have those of one row
  const auto place = static_cast<std::uint32_t>(cube.at.x) + 64 * static_cast<std::uint32_t>(cube.at.y) +
                     1024 * static_cast<std::uint32_t>(cube.at.z);
  OpenCube& open = open_[place % kOpen];
  if (open.level != level || open.cube.at != cube.at) {
    if (open.cube.bits != 0) (*levels_)[open.level].add(open.cube);
    open = {cube, level};
    return;
  }
  if ((open.cube.bits & cube.bits) != 0) (*levels_)[level].note_twice({cube.at, open.cube.bits & cube.bits});
  open.cube.bits |= cube.bits;
}

void CellGatherer::flush() {
  for (OpenCube& open : open_)
    if (open.cube.bits != 0) (*levels_)[open.level].add(std::exchange(open.cube, {}));
}

}  // namespace amrtex
