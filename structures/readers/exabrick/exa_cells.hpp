// The cells of an ExaBrick data set as a stream: read in chunks, as often as somebody needs them, and never held.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "structures/readers/data_file.hpp"
#include "structures/readers/exabrick/exa_files.hpp"

namespace amrtex {

/// Cells of one level that follow one another along x.
struct CellRun {
  ExaCell first;
  std::uint32_t count;
  std::uint32_t place;  ///< of the first among the cells of the chunk
};

/// Some tens of thousands of cells that follow one another in the file.
struct CellChunk {
  std::uint64_t first_cell = 0;  ///< its number in the file
  std::uint32_t cells = 0;
  std::vector<CellRun> runs;
  std::vector<std::uint32_t> scalars;  ///< each cell's place in the arrays of scalars; empty: its number in the file

  std::uint64_t scalar(std::uint32_t place) const { return scalars.empty() ? first_cell + place : scalars[place]; }
};

/// What is wrong with a cell.
struct BadCell {
  std::uint64_t cell;  ///< number in the file
  std::string what;
};

/// A file `.cells` or `.bricks`.
class ExaCellFile {
 public:
  /// `scalars`: how many values each array has. Throws Error where the file does not hold as many cells, and for bricks that
  /// are none.
  ExaCellFile(const ExaFiles& files, std::uint64_t scalars);

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t cells() const { return cells_; }
  std::size_t chunks() const { return chunks_.size(); }

  /// Calls f(chunk) for the chunks from `begin` to `end`, in any order and from several threads. Levels are in range. Throws
  /// Error for the first cell that is none, or of which `f` throws BadCell.
  void for_each_chunk(std::size_t begin, std::size_t end, const std::function<void(const CellChunk&)>& f) const;
  void for_each_chunk(const std::function<void(const CellChunk&)>& f) const { for_each_chunk(0, chunks(), f); }

 private:
  /// Where a chunk stands in the file, in units of 4 bytes.
  struct Place {
    std::uint64_t begin;  ///< of bricks: the head of the first one
    std::uint64_t end;
    std::uint64_t skipped;  ///< cells of the first brick that lie in earlier chunks
    std::uint64_t first_brick;
    std::uint64_t first_cell;
  };
  struct Buffer;
  class BrickScanner;

  void find_cells();
  void find_bricks();
  void load(const Place& place, Buffer& buffer) const;
  void load_cells(const Place& place, Buffer& buffer) const;
  void load_bricks(const Place& place, Buffer& buffer) const;

  std::filesystem::path path_;
  bool bricks_;
  std::uint64_t scalars_;
  std::uint64_t elements_;  ///< of `.cells`: cells; of `.bricks`: numbers of 32 bits
  DataFile file_;
  std::uint64_t cells_ = 0;
  std::vector<Place> chunks_;
};

}  // namespace amrtex
