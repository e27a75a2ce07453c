// Sets of cells of a level, a bit a cell: what the shape of a mesh is worked out with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// 4 x 4 x 4 cells. Cell (x, y, z) of them is bit x + 4 y + 16 z.
struct CellCube {
  Vec3i at{0};             ///< in cubes; none is below 0
  std::uint64_t bits = 0;  ///< cells that are in the set
};

/// A set of cells: cubes in the order of arrays, each with a bit at least.
using CellCubes = std::vector<CellCube>;

std::int64_t count_cells(const CellCubes& cells);
/// In the order of arrays.
Vec3i first_cell(const CellCubes& cells);

CellCubes joined(const CellCubes& a, const CellCubes& b);
CellCubes common(const CellCubes& a, const CellCubes& b);

/// Cells `ratio` times as wide with any of these cells in them. `ratio` is a power of two from 2 on, here and below.
CellCubes touched_parents(CellCubes cells, int ratio);
/// Cells `ratio` times as wide that these cells fill.
CellCubes whole_parents(CellCubes cells, int ratio);
/// Those of the cells that do not lie in one of the parents, `ratio` times as wide.
CellCubes outside(CellCubes cells, const CellCubes& parents, int ratio);

/// Rows along x, as long as they can be, in any order.
std::vector<Box> runs_of(const CellCubes& cells);

/// Cells as they come, in any order and from any thread.
class CellCollector {
 public:
  CellCollector();
  ~CellCollector();
  CellCollector(CellCollector&&) noexcept;
  CellCollector& operator=(CellCollector&&) noexcept;

  void add(const CellCube& cube);
  /// Says of cells that they were added twice, as add() finds out by itself for those that it has.
  void note_twice(const CellCube& cube);

  /// The first cell, in the order of arrays, that was added twice.
  std::optional<Vec3i> twice() const;
  /// All of them; none are left here.
  CellCubes take();

 private:
  struct Shard;
  Shard& shard_of(const Vec3i& at) const;
  std::unique_ptr<Shard[]> shards_;
};

/// Gathers the cells of a few cubes that are being filled, so that a collector is asked once a cube and not once a cell.
/// For one thread.
class CellGatherer {
 public:
  explicit CellGatherer(std::vector<CellCollector>& levels) : levels_(&levels), open_(kOpen) {}

  /// `count` cells of a level from `cell` on, along x.
  void add(std::size_t level, const Vec3i& cell, std::uint32_t count);
  /// Hands over what it has.
  void flush();

 private:
  static constexpr std::size_t kOpen = 4096;
  struct OpenCube {
    CellCube cube;
    std::size_t level = 0;
  };
  void add(std::size_t level, const CellCube& cube);

  std::vector<CellCollector>* levels_;
  std::vector<OpenCube> open_;
};

}  // namespace amrtex
