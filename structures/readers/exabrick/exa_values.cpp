#include "structures/readers/exabrick/exa_values.hpp"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <mutex>
#include <span>

#include "structures/mesh/error.hpp"
#include "structures/readers/exabrick/patch_tree.hpp"

namespace amrtex {
namespace {

/// Cells of a patch that follow one another along x, and whose scalars do so.
struct Piece {
  std::uint32_t scalar;  ///< of the first cell
  std::uint32_t patch;   ///< number among those of all levels
  std::uint32_t offset;  ///< of the first cell in the patch. Refined cells are a seventh of the leaves at most: it fits
  std::uint32_t count;
};

std::uint64_t end_of(const Piece& piece) { return std::uint64_t{piece.scalar} + piece.count; }

/// Pieces whose scalars are read at once.
struct Window {
  std::span<const Piece> pieces;
  std::uint64_t begin;  ///< scalars
  std::uint64_t end;
};

/// Windows of pieces in the order of their scalars: what lies between pieces is read where it is little.
std::vector<Window> windows_of(std::span<const Piece> pieces) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 18;  // scalars of a window: 1 MiB, or one piece
  constexpr std::uint64_t kGap = std::uint64_t{1} << 10;   // 4 KiB are read in less time than a call to the system takes
  std::vector<Window> windows;
  for (std::size_t first = 0; first < pieces.size();) {
    const std::uint64_t begin = pieces[first].scalar;
    std::uint64_t end = end_of(pieces[first]);
    std::size_t last = first + 1;
    for (; last < pieces.size() && pieces[last].scalar <= end + kGap && end_of(pieces[last]) <= begin + kMost; ++last)
      end = std::max(end, end_of(pieces[last]));
    windows.push_back({pieces.subspan(first, last - first), begin, end});
    first = last;
  }
  return windows;
}

class ValueReader {
 public:
  ValueReader(const ExaCellFile& file, const ExaGrid& grid, const std::vector<ExaField>& fields,
              std::vector<std::vector<Patch>>& levels)
      : file_(file), grid_(grid), levels_(levels) {
    for (const ExaField& field : fields) scalars_.push_back(std::make_unique<DataFile>(field.scalars));
    for (std::size_t l = 0; l < levels.size(); ++l) {
      allocate(levels[l]);
      trees_.emplace_back(levels[l]);
      first_patch_.push_back(l == 0 ? 0 : first_patch_[l - 1] + static_cast<std::uint32_t>(levels[l - 1].size()));
    }
    arrays_.resize(fields.size());
    for (std::vector<Patch>& level : levels)
      for (Patch& patch : level)
        for (std::size_t f = 0; f < fields.size(); ++f) patch.values[f].visit_stored([&](auto& array) { add_array(f, array); });
  }

  void read() {
    for (std::size_t begin = 0; begin < file_.chunks(); begin += kChunksAtOnce) {
      file_.for_each_chunk(begin, std::min(begin + kChunksAtOnce, file_.chunks()),
                           [&](const CellChunk& chunk) { read_chunk(chunk); });
      if (scattered_.size() >= kMostScattered) read_scattered();
    }
    read_scattered();
  }

 private:
  static constexpr std::size_t kChunksAtOnce = 32;                     // 2 million cells
  static constexpr std::size_t kMostScattered = std::size_t{1} << 22;  // 64 MiB, and half as much of the last chunks
  static constexpr std::uint64_t kMostSpread = 4;                      // scalars that a chunk reads for one that it takes

  struct Buffer {
    std::vector<Piece> pieces;
    std::vector<float> scalars;
  };

  void add_array(std::size_t field, CellArray<float>& array) { arrays_[field].push_back(array.data()); }
  void add_array(std::size_t, CellArray<double>&) {}  // none is of this type

  void allocate(std::vector<Patch>& level) const {
    std::size_t bytes = 0;
    for (const Patch& patch : level) bytes += scalars_.size() * CellMemory::taken(sizeof(float) * cells_of(patch));
    const auto memory = CellMemory::for_arrays(bytes);
    tbb::parallel_for(std::size_t{0}, level.size(), [&](std::size_t k) {
      for (std::size_t f = 0; f < scalars_.size(); ++f) {
        CellArray<float> array(cells_of(level[k]), UnsetAllocator<float>(memory));
        constexpr std::size_t kAtOnce = std::size_t{1} << 18;
        tbb::parallel_for(std::size_t{0}, (array.size() + kAtOnce - 1) / kAtOnce, [&](std::size_t part) {
          const auto begin = array.begin() + static_cast<std::ptrdiff_t>(part * kAtOnce);
          std::fill_n(begin, std::min(kAtOnce, array.size() - part * kAtOnce), std::numeric_limits<float>::quiet_NaN());
        });
        level[k].values.emplace_back(std::move(array));
      }
    });
  }

  static std::size_t cells_of(const Patch& patch) { return static_cast<std::size_t>(patch.box.cells()); }

  void read_chunk(const CellChunk& chunk) {
    Buffer& buffer = buffers_.local();
    buffer.pieces.clear();
    std::vector<int> patch(levels_.size(), -1);  // the last one: cells beside one another mostly lie in one
    for (const CellRun& run : chunk.runs) place(chunk, run, patch[grid_.level_of(run.first)], buffer.pieces);
    if (buffer.pieces.empty()) return;
    std::uint64_t begin = std::numeric_limits<std::uint64_t>::max();
    std::uint64_t end = 0;
    for (const Piece& piece : buffer.pieces) {
      begin = std::min<std::uint64_t>(begin, piece.scalar);
      end = std::max(end, end_of(piece));
    }
    if (end - begin <= kMostSpread * chunk.cells) {
      read_window({buffer.pieces, begin, end}, buffer.scalars);
      return;
    }
    const std::lock_guard lock(mutex_);
    scattered_.insert(scattered_.end(), buffer.pieces.begin(), buffer.pieces.end());
  }

  /// Cuts a run at patches and where scalars do not follow one another.
  void place(const CellChunk& chunk, const CellRun& run, int& patch, std::vector<Piece>& pieces) const {
    const std::size_t level = grid_.level_of(run.first);
    const std::vector<Patch>& patches = levels_[level];
    Vec3i cell = grid_.place(run.first);
    for (std::uint32_t done = 0; done < run.count;) {
      if (patch < 0 || !patches[static_cast<std::size_t>(patch)].box.contains(cell)) patch = trees_[level].find(cell);
      if (patch < 0) throw Error(fmt::format("{}: changed while it was read", file_.path().string()));
      const Box& box = patches[static_cast<std::size_t>(patch)].box;
      const std::uint32_t count = std::min(run.count - done, static_cast<std::uint32_t>(box.upper.x - cell.x));
      const std::uint32_t number = first_patch_[level] + static_cast<std::uint32_t>(patch);
      add_pieces(chunk, run.place + done, number, static_cast<std::uint32_t>(box.offset(cell)), count, pieces);
      cell.x += static_cast<int>(count);
      done += count;
    }
  }

  static void add_pieces(const CellChunk& chunk, std::uint32_t place, std::uint32_t patch, std::uint32_t offset,
                         std::uint32_t count, std::vector<Piece>& pieces) {
    for (std::uint32_t done = 0; done < count;) {
      const std::uint64_t scalar = chunk.scalar(place + done);
      std::uint32_t same = chunk.scalars.empty() ? count - done : 1;
      while (done + same < count && chunk.scalar(place + done + same) == scalar + same) ++same;
      pieces.push_back({static_cast<std::uint32_t>(scalar), patch, offset + done, same});
      done += same;
    }
  }

  void read_scattered() {
    tbb::parallel_sort(scattered_.begin(), scattered_.end(), [](const Piece& a, const Piece& b) { return a.scalar < b.scalar; });
    const std::vector<Window> windows = windows_of(scattered_);
    tbb::parallel_for(std::size_t{0}, windows.size(), [&](std::size_t i) { read_window(windows[i], buffers_.local().scalars); });
    scattered_.clear();
  }

  void read_window(const Window& window, std::vector<float>& scalars) const {
    scalars.resize(static_cast<std::size_t>(window.end - window.begin));
    for (std::size_t f = 0; f < scalars_.size(); ++f) {
      scalars_[f]->read(sizeof(float) * window.begin, reinterpret_cast<std::byte*>(scalars.data()),
                        sizeof(float) * scalars.size());
      for (const Piece& piece : window.pieces)
        std::copy_n(scalars.data() + (piece.scalar - window.begin), piece.count, arrays_[f][piece.patch] + piece.offset);
    }
  }

  const ExaCellFile& file_;
  const ExaGrid& grid_;
  std::vector<std::vector<Patch>>& levels_;
  std::vector<std::unique_ptr<DataFile>> scalars_;
  std::vector<PatchTree> trees_;             // a level
  std::vector<std::uint32_t> first_patch_;   // a level
  std::vector<std::vector<float*>> arrays_;  // field, patch of all levels
  tbb::enumerable_thread_specific<Buffer> buffers_;
  std::mutex mutex_;
  std::vector<Piece> scattered_;  // those of chunks whose scalars lie far from one another
};

}  // namespace

void read_exa_values(const ExaCellFile& file, const ExaGrid& grid, const std::vector<ExaField>& fields,
                     std::vector<std::vector<Patch>>& levels) {
  ValueReader(file, grid, fields, levels).read();
}

}  // namespace amrtex
