#include "structures/readers/amrex_plotfile/amrex_data.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <span>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/data_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFabLineBytes = 1024;                   // the longest line that AMReX writes has some 200
constexpr std::uint64_t kReadBytes = std::uint64_t{1} << 20;  // read at a time and thread, or one row where that is longer

/// Reads the FAB line in front of the values, checks that it is the patch that `Cell_H` means.
void scan_fab_line(FabSource& fab, const DataFile& file, std::uint64_t offset, const PlotHeader& header) {
  std::string line(static_cast<std::size_t>(std::min<std::uint64_t>(kFabLineBytes, fab.file->bytes - offset)), '\0');
  file.read(offset, reinterpret_cast<std::byte*>(line.data()), line.size());
  const std::size_t length = std::min(line.find('\n'), line.size());
  const bool ends = length < line.size();
  line.resize(length);
  TextScanner in(fmt::format("{}, FAB at byte {}", fab.file->path.string(), offset), std::move(line), false);
  if (fab.file->outside) in.hide_text();
  in.expect("FAB", "the line in front of a patch");
  fab.format = scan_real_format(in);
  const IndexBox box = scan_box(in, header.dimensions, "the box of the FAB");
  if (box != fab.stored) in.fail(fmt::format("its box is {}, but Cell_H makes it {}", text(box), text(fab.stored)));
  const std::int64_t count = in.integer("the number of components", 0, std::numeric_limits<std::int32_t>::max());
  if (count != std::ssize(header.fields))
    in.fail(fmt::format("{} components, but Header names {} fields", count, header.fields.size()));
  if (!ends || in.peek() != '\0') in.fail("its first line does not end behind the number of components");
  fab.values_begin = offset + length + 1;
}

/// The patch's place in its file, which must hold all of it. Returns the bytes that it takes.
std::uint64_t locate_fab(FabSource& fab, const DataFile& file, const CellHeader& cells, std::size_t patch,
                         const PlotHeader& header) {
  const std::size_t components = header.fields.size();
  const std::uint64_t file_size = fab.file->bytes;
  const std::uint64_t offset = cells.fabs[patch].offset;
  if (offset >= file_size)
    throw Error(fmt::format("{}: patch {} is said to begin at byte {}, but the file has only {}", fab.file->path.string(), patch,
                            offset, file_size));
  fab.valid = cells.boxes[patch];
  fab.stored = {fab.valid.lower - cells.ghosts, fab.valid.upper + cells.ghosts};
  fab.values_begin = offset;
  if (cells.format)
    fab.format = *cells.format;
  else
    scan_fab_line(fab, file, offset, header);
  const auto range = fab_component_range(fab.values_begin, fab.stored.size(), components, 0, fab.format.bytes);
  if (!range || range->fab_end > file_size)
    throw Error(fmt::format("{}: too short, {} bytes; patch {} {} of {} components needs {} from byte {} on",
                            fab.file->path.string(), file_size, patch, text(fab.stored), components,
                            range ? fmt::format("{} bytes", range->fab_end - fab.values_begin) : "more than 2^63 bytes",
                            fab.values_begin));
  return range->fab_end - fab.values_begin;
}

/// One component without its ghost cells, which are passed over a few rows at a time; where there are none, it is read in pieces.
template <class Real>
void read_component(const DataFile& file, const FabSource& fab, std::uint64_t components, std::uint64_t component,
                    std::span<Real> out) {
  const Vec3l stored = fab.stored.size();
  const Vec3l size = fab.valid.size();
  const Vec3l skip = fab.valid.lower - fab.stored.lower;
  const std::uint64_t begin = fab_component_range(fab.values_begin, stored, components, component, fab.format.bytes)->begin;
  const auto read = [&](std::uint64_t first, std::span<Real> values) {
    file.read(begin + first * sizeof(Real), reinterpret_cast<std::byte*>(values.data()), values.size_bytes());
  };
  if (fab.stored == fab.valid) {
    constexpr std::size_t kPiece = kReadBytes / sizeof(Real);
    tbb::parallel_for(std::size_t{0}, (out.size() + kPiece - 1) / kPiece, [&](std::size_t piece) {
      const auto part = out.subspan(piece * kPiece, std::min(kPiece, out.size() - piece * kPiece));
      read(piece * kPiece, part);
      set_byte_order(part, fab.format);
    });
    return;
  }
  const std::int64_t rows_at_once =
      std::clamp<std::int64_t>(static_cast<std::int64_t>(kReadBytes / sizeof(Real)) / stored.x, 1, size.y);
  tbb::parallel_for(tbb::blocked_range<std::int64_t>(0, size.z), [&](const tbb::blocked_range<std::int64_t>& planes) {
    CellArray<Real> buffer(static_cast<std::size_t>(stored.x * rows_at_once));
    for (std::int64_t z = planes.begin(); z < planes.end(); ++z)
      for (std::int64_t y = 0; y < size.y; y += rows_at_once) {
        const std::int64_t rows = std::min(rows_at_once, size.y - y);
        const auto values = std::span(buffer).first(static_cast<std::size_t>(stored.x * rows));
        read(static_cast<std::uint64_t>(((z + skip.z) * stored.y + y + skip.y) * stored.x), values);
        set_byte_order(values, fab.format);
        for (std::int64_t row = 0; row < rows; ++row)
          std::copy_n(values.data() + row * stored.x + skip.x, size.x, out.data() + ((z * size.y) + y + row) * size.x);
      }
  });
}

}  // namespace

LevelSources locate_level(const PlotHeader& header, std::size_t level) {
  const CellHeader cells = scan_cell_header(header, level);
  const fs::path folder = header.levels[level].cell_header.parent_path();
  LevelSources sources;
  sources.fabs.resize(cells.boxes.size());
  std::uint64_t present = 0;
  std::uint64_t claimed = 0;
  std::string open_name;
  std::optional<DataFile> open;  // patches of a file follow one another
  for (std::size_t patch = 0; patch < cells.boxes.size(); ++patch) {
    const auto [found, is_new] = sources.files.try_emplace(cells.fabs[patch].file);
    LevelFile& file = found->second;
    if (is_new) {
      file.path = folder / found->first;
      file.bytes = regular_file_size(file.path);
      file.outside = leads_out_of(header.folder, file.path);
      present += file.bytes;
    }
    if (!open || open_name != found->first) open.emplace(file.path);
    open_name = found->first;
    sources.fabs[patch].file = &file;
    claimed += locate_fab(sources.fabs[patch], *open, cells, patch, header);
    if (claimed > present)
      throw Error(fmt::format("{}: its patches take {} bytes, but the data files have only {}; some must share their bytes",
                              header.levels[level].cell_header.string(), claimed, present));
  }
  return sources;
}

std::vector<CellValues> read_components(const FabSource& fab, std::size_t components, const std::vector<std::size_t>& wanted,
                                        const std::shared_ptr<CellMemory>& memory) {
  const DataFile file(fab.file->path);
  const Vec3l size = fab.valid.size();
  const RealType type = fab.format.bytes == 4 ? RealType::float32 : RealType::float64;
  std::vector<CellValues> values;
  for (const std::size_t component : wanted) {
    values.emplace_back(type, static_cast<std::size_t>(size.x * size.y * size.z),
                        memory);  // the file holds them, so that they fit
    values.back().visit_stored([&](auto& out) { read_component(file, fab, components, component, std::span(out)); });
  }
  return values;
}

}  // namespace amrtex
