#include "structures/readers/exabrick/exa_cells.hpp"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <mutex>
#include <optional>

#include "structures/mesh/error.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "the files are little endian and read as they are");

constexpr std::uint64_t kMostCells = std::numeric_limits<std::int32_t>::max();  // a brick's ids are 32-bit
constexpr std::uint64_t kChunkCells = std::uint64_t{1} << 16;
constexpr std::uint64_t kWord = sizeof(std::int32_t);
constexpr std::uint64_t kCellWords = sizeof(ExaCell) / kWord;
constexpr std::uint64_t kHeadWords = 7;  // size, lower corner, level

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(fmt::format("{}: {}", file.string(), what));
}

[[noreturn]] void refuse_brick(const fs::path& file, std::uint64_t brick, const std::string& what) {
  refuse(file, fmt::format("brick {}: {}", brick, what));
}

/// Seven words in front of a brick's cells.
struct BrickHead {
  Vec3i size{0};
  Vec3i lower{0};
  int level = 0;

  std::uint64_t cells() const {
    return static_cast<std::uint64_t>((CheckedSize(size.x) * CheckedSize(size.y) * CheckedSize(size.z)).or_most());
  }
  /// Cell k of it, x fastest.
  Vec3i cell(std::uint64_t k) const {
    const auto x = static_cast<std::uint64_t>(size.x);
    const auto y = static_cast<std::uint64_t>(size.y);
    return {static_cast<int>(k % x), static_cast<int>(k / x % y), static_cast<int>(k / x / y)};
  }
  ExaCell place(const Vec3i& cell) const {
    const auto at = [&](int axis) {
      return static_cast<std::int32_t>(lower[axis] + std::int64_t{cell[axis]} * (std::int64_t{1} << level));
    };
    return {at(0), at(1), at(2), level};
  }
};

BrickHead head_of(const fs::path& file, std::uint64_t brick, const std::int32_t* words) {
  const BrickHead head{{words[0], words[1], words[2]}, {words[3], words[4], words[5]}, words[6]};
  if (glm::any(glm::lessThan(head.size, Vec3i(1))))
    refuse_brick(file, brick, fmt::format("its size is {} x {} x {} cells", head.size.x, head.size.y, head.size.z));
  if (head.level < 0 || head.level > kMostExaLevel)
    refuse_brick(file, brick, fmt::format("its level is {}; accepted: 0 to {}", head.level, kMostExaLevel));
  return head;
}

void check_reach(const fs::path& file, std::uint64_t brick, const BrickHead& head) {
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t last = head.lower[axis] + (std::int64_t{head.size[axis]} - 1) * (std::int64_t{1} << head.level);
    if (last > std::numeric_limits<std::int32_t>::max()) refuse_brick(file, brick, "it reaches beyond 31 bits of index");
  }
}

}  // namespace

/// What a thread reads a chunk into.
struct ExaCellFile::Buffer {
  std::vector<ExaCell> cells;
  std::vector<std::int32_t> words;
  CellChunk chunk;
};

ExaCellFile::ExaCellFile(const ExaFiles& files, std::uint64_t scalars)
    : path_(files.geometry),
      bricks_(files.bricks),
      scalars_(scalars),
      elements_(bricks_ ? count_exa_elements(path_, kWord, "numbers") : count_exa_elements(path_, sizeof(ExaCell), "cells")),
      file_(path_) {
  if (scalars > kMostCells) refuse(path_, fmt::format("{} cells; at most {} are read", scalars, kMostCells));
  if (bricks_)
    find_bricks();
  else
    find_cells();
}

void ExaCellFile::find_cells() {
  cells_ = elements_;
  if (cells_ != scalars_) refuse(path_, fmt::format("{} cells, but its scalars are {} values", cells_, scalars_));
  for (std::uint64_t begin = 0; begin < cells_; begin += kChunkCells)
    chunks_.push_back({kCellWords * begin, kCellWords * std::min(begin + kChunkCells, cells_), 0, 0, begin});
}

/// Goes from head to head and makes chunks of what lies between them.
class ExaCellFile::BrickScanner {
 public:
  explicit BrickScanner(ExaCellFile& out) : out_(out), words_(out.elements_) {}

  void scan() {
    for (std::uint64_t at = 0, brick = 0; at < words_; ++brick) {
      const BrickHead head = load_head(at, brick);
      add(at, brick, head.cells());
      at += kHeadWords + head.cells();
    }
  }

 private:
  BrickHead load_head(std::uint64_t at, std::uint64_t brick) {
    const std::uint64_t left = words_ - at;
    if (left < kHeadWords)
      refuse_brick(out_.path_, brick, fmt::format("its head needs {} bytes, {} are left", kWord * kHeadWords, kWord * left));
    if (at + kHeadWords > window_begin_ + window_.size() || window_.empty()) {
      window_begin_ = at;
      window_.resize(static_cast<std::size_t>(std::min(left, kWindowWords)));
      out_.file_.read(kWord * at, reinterpret_cast<std::byte*>(window_.data()), kWord * window_.size());
    }
    const BrickHead head = head_of(out_.path_, brick, &window_[static_cast<std::size_t>(at - window_begin_)]);
    if (head.cells() > left - kHeadWords)
      refuse_brick(out_.path_, brick,
                   fmt::format("its {} x {} x {} cells need as many numbers, {} are left", head.size.x, head.size.y, head.size.z,
                               left - kHeadWords));
    check_reach(out_.path_, brick, head);
    return head;
  }

  /// Puts a brick into the open chunk, or into chunks of its own where it is large.
  void add(std::uint64_t at, std::uint64_t brick, std::uint64_t cells) {
    const std::uint64_t end = at + kHeadWords + cells;
    const bool fits = !out_.chunks_.empty() && end - out_.chunks_.back().begin <= kChunkCells;
    if (fits) {
      out_.chunks_.back().end = end;
    } else {
      for (std::uint64_t first = 0; first < cells; first += kChunkCells)
        out_.chunks_.push_back({at, at + kHeadWords + std::min(first + kChunkCells, cells), first, brick, out_.cells_ + first});
    }
    out_.cells_ += cells;
  }

  static constexpr std::uint64_t kWindowWords = 4096;  // holds many heads of small bricks, and skips most of large ones

  ExaCellFile& out_;
  std::uint64_t words_;
  std::vector<std::int32_t> window_;
  std::uint64_t window_begin_ = 0;
};

void ExaCellFile::find_bricks() {
  BrickScanner(*this).scan();
  if (cells_ == scalars_) return;
  for_each_chunk([](const CellChunk&) {});  // says of a cell's number first that there are not so many scalars
  refuse(path_, fmt::format("its bricks hold {} cells, but its scalars are {} values", cells_, scalars_));
}

void ExaCellFile::load_cells(const Place& place, Buffer& buffer) const {
  const std::uint64_t count = (place.end - place.begin) / kCellWords;
  buffer.cells.resize(static_cast<std::size_t>(count));
  file_.read(kWord * place.begin, reinterpret_cast<std::byte*>(buffer.cells.data()), sizeof(ExaCell) * buffer.cells.size());
  CellChunk& chunk = buffer.chunk;
  chunk.cells = static_cast<std::uint32_t>(count);
  std::int64_t next_x = 0;
  for (std::uint32_t i = 0; i < chunk.cells; ++i) {
    const ExaCell& cell = buffer.cells[i];
    if (cell.level < 0 || cell.level > kMostExaLevel)
      throw BadCell{place.first_cell + i,
                    fmt::format("cell {} has level {}; accepted: 0 to {}", place.first_cell + i, cell.level, kMostExaLevel)};
    const ExaCell* first = i > 0 ? &chunk.runs.back().first : nullptr;
    if (first != nullptr && cell.x == next_x && cell.y == first->y && cell.z == first->z && cell.level == first->level)
      ++chunk.runs.back().count;
    else
      chunk.runs.push_back({cell, 1, i});
    next_x = cell.x + cell.width();
  }
}

void ExaCellFile::load_bricks(const Place& place, Buffer& buffer) const {
  // the first brick's head, then the cells from the first one of this chunk on
  buffer.words.resize(static_cast<std::size_t>(place.end - place.begin - place.skipped));
  auto* bytes = reinterpret_cast<std::byte*>(buffer.words.data());
  file_.read(kWord * place.begin, bytes, kWord * kHeadWords);
  file_.read(kWord * (place.begin + kHeadWords + place.skipped), bytes + kWord * kHeadWords,
             kWord * (buffer.words.size() - kHeadWords));
  CellChunk& chunk = buffer.chunk;
  std::uint64_t skipped = place.skipped;
  std::uint64_t brick = place.first_brick;
  for (std::size_t at = 0; at + kHeadWords <= buffer.words.size(); ++brick, skipped = 0) {
    const BrickHead head = head_of(path_, brick, &buffer.words[at]);
    check_reach(path_, brick, head);
    at += kHeadWords;
    const std::uint64_t end = std::min<std::uint64_t>(head.cells(), skipped + (buffer.words.size() - at));
    for (std::uint64_t k = skipped; k < end;) {
      const Vec3i cell = head.cell(k);
      const std::uint64_t count = std::min(static_cast<std::uint64_t>(head.size.x - cell.x), end - k);
      chunk.runs.push_back({head.place(cell), static_cast<std::uint32_t>(count), chunk.cells});
      chunk.cells += static_cast<std::uint32_t>(count);
      k += count;
    }
    for (; skipped < end; ++skipped, ++at) {
      const std::int32_t id = buffer.words[at];
      const std::uint64_t number = place.first_cell + chunk.scalars.size();
      if (id < 0 || static_cast<std::uint64_t>(id) >= scalars_)
        throw BadCell{number, fmt::format("brick {}: a cell's number is {}; its scalars are {} values", brick, id, scalars_)};
      chunk.scalars.push_back(static_cast<std::uint32_t>(id));
    }
  }
}

void ExaCellFile::load(const Place& place, Buffer& buffer) const {
  buffer.chunk.first_cell = place.first_cell;
  buffer.chunk.cells = 0;
  buffer.chunk.runs.clear();
  buffer.chunk.scalars.clear();
  if (bricks_)
    load_bricks(place, buffer);
  else
    load_cells(place, buffer);
}

void ExaCellFile::for_each_chunk(std::size_t begin, std::size_t end, const std::function<void(const CellChunk&)>& f) const {
  tbb::enumerable_thread_specific<Buffer> buffers;
  std::mutex mutex;
  std::optional<BadCell> first;
  tbb::parallel_for(begin, end, [&](std::size_t i) {
    Buffer& buffer = buffers.local();
    try {
      load(chunks_[i], buffer);
      f(buffer.chunk);
    } catch (const BadCell& bad) {
      const std::lock_guard lock(mutex);
      if (!first || bad.cell < first->cell) first = bad;
    }
  });
  if (first) refuse(path_, first->what);
}

}  // namespace amrtex
