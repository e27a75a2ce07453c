// Formats read: AMReX Src/Base, AMReX_PlotFileUtil.cpp (`Header`) and AMReX_VisMF.cpp (`Cell_H`, versions 1 to 4).
// Files are taken as hostile: counts are held against the bytes that are there
// before anything is allocated for them, and no name leads out of the folder.
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <new>

#include "structures/readers/amrex_plotfile/amrex_fab.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kInt32Min = std::numeric_limits<std::int32_t>::min();
constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t kMaxLevels = 64;
constexpr std::size_t kFabLineBytes = 1024;                   // the longest line that AMReX writes has some 200
constexpr std::uint64_t kReadBytes = std::uint64_t{1} << 20;  // read at a time and thread, or one row where that is longer

std::string text(const Vec3l& v) { return fmt::format("({},{},{})", v.x, v.y, v.z); }

// ---- what the text files say ----

/// A range of indices in the file's own convention: both corners inclusive, any origin.
struct IndexBox {
  Vec3l lower{0};
  Vec3l upper{0};

  bool operator==(const IndexBox&) const = default;
  Vec3l size() const { return upper - lower + std::int64_t{1}; }
  bool contains(const IndexBox& b) const {
    return glm::all(glm::lessThanEqual(lower, b.lower)) && glm::all(glm::greaterThanEqual(upper, b.upper));
  }
};
std::string text(const IndexBox& b) { return fmt::format("({} {})", text(b.lower), text(b.upper)); }

struct LevelEntry {
  std::int64_t grids = 0;
  fs::path cell_header;  ///< `Cell_H` of the level
};

struct PlotHeader {
  std::vector<std::string> fields;
  Vec3d lower{0};  ///< world
  Vec3d upper{1};  ///< world
  std::vector<IndexBox> domains;
  std::vector<int> ratios;
  std::vector<LevelEntry> levels;
};

struct FabOnDisk {
  std::string file;
  std::uint64_t offset = 0;
};

struct CellHeader {
  Vec3l ghosts{0};
  std::vector<IndexBox> boxes;
  std::vector<FabOnDisk> fabs;
  std::optional<RealFormat> format;  ///< where the data files hold no FAB lines (versions 2 to 4)
};

Vec3l scan_tuple(TextScanner& in, std::string_view what, std::int64_t lowest, std::int64_t highest) {
  in.expect("(", what);
  const std::int64_t x = in.integer(what, lowest, highest);
  in.expect(",", what);
  const std::int64_t y = in.integer(what, lowest, highest);
  in.expect(",", what);
  const std::int64_t z = in.integer(what, lowest, highest);
  in.expect(")", what);
  return {x, y, z};
}

/// `((0,0,0) (15,15,15) (0,0,0))`; the last triple, the centring, may be absent and must be cells.
IndexBox scan_box(TextScanner& in, std::string_view what) {
  IndexBox box;
  in.expect("(", what);
  box.lower = scan_tuple(in, what, kInt32Min, kInt32Max);
  box.upper = scan_tuple(in, what, kInt32Min, kInt32Max);
  if (in.peek() == '(' && scan_tuple(in, what, 0, 1) != Vec3l(0))
    in.fail(fmt::format("{} {} is not cell-centred; only cell-centred data can be read", what, text(box)));
  in.expect(")", what);
  if (glm::any(glm::lessThan(box.upper, box.lower))) in.fail(fmt::format("{} {} is empty", what, text(box)));
  if (glm::any(glm::greaterThan(box.size(), Vec3l(kInt32Max))))
    in.fail(fmt::format("{} {} is wider than {} cells", what, text(box), kInt32Max));
  return box;
}

/// A count of things that take at least `bytes_each` bytes of the rest of the text.
std::int64_t scan_count(TextScanner& in, std::string_view what, std::int64_t bytes_each) {
  const std::int64_t count = in.integer(fmt::format("the number of {}", what), 0, kInt32Max);
  if (count > in.remaining() / bytes_each)
    in.fail(fmt::format("{} {} are announced, but only {} bytes follow", count, what, in.remaining()));
  return count;
}

bool has_control_characters(const std::string& s) {
  return std::any_of(s.begin(), s.end(), [](char c) { return static_cast<unsigned char>(c) < ' ' || c == 127; });
}

/// The path of a level's files below the plotfile, such as `Level_0/Cell`.
fs::path scan_level_path(TextScanner& in) {
  const std::string name = in.line("the path of the level's files, such as Level_0/Cell");
  fs::path path(name);
  const bool climbs = std::any_of(path.begin(), path.end(), [](const fs::path& part) { return part == ".."; });
  if (name.empty() || path.is_absolute() || climbs || path.filename().empty() || has_control_characters(name))
    in.fail(fmt::format("'{}' is no path below the plotfile; one such as Level_0/Cell is expected", name));
  return path;
}

void scan_version(TextScanner& in) {
  const std::string version = in.line("the version, HyperCLaw-V1.1 or CartGrid-V2.0");
  if (version == "HyperCLaw-V1.1" || version == "CartGrid-V2.0") return;
  const bool checkpoint = version.rfind("CheckPointVersion", 0) == 0 || version.rfind("Checkpoint", 0) == 0;
  in.fail(fmt::format("not an AMReX plotfile{}: its first line is '{}'; HyperCLaw-V1.1 and CartGrid-V2.0 can be read",
                      checkpoint ? " but a checkpoint" : "", has_control_characters(version) ? "?" : version.substr(0, 40)));
}

void scan_fields(TextScanner& in, PlotHeader& header) {
  const std::int64_t count = scan_count(in, "fields", 2);
  if (count == 0) in.fail("the plotfile has no fields");
  in.line("the end of the line");
  for (std::int64_t i = 0; i < count; ++i)
    header.fields.push_back(in.line(fmt::format("the name of field {} of {}", i + 1, count)));
}

void scan_dimension(TextScanner& in, std::size_t fields) {
  const std::int64_t dimension = in.integer(fmt::format("the dimension behind the names of {} fields", fields), 1, 3);
  if (dimension != 3) in.fail(fmt::format("the data are {}-dimensional; only 3-dimensional plotfiles can be read", dimension));
}

Vec3d scan_corner(TextScanner& in, std::string_view what) {
  Vec3d corner(0);
  for (int axis = 0; axis < 3; ++axis) {
    corner[axis] = in.real(what);
    if (!std::isfinite(corner[axis])) in.fail(fmt::format("{} is not finite", what));
  }
  return corner;
}

/// The ratio between two levels follows from their domains: the line of ratios holds only one axis.
int ratio_between(const TextScanner& in, const IndexBox& coarse, const IndexBox& fine, std::size_t level) {
  const std::string where =
      fmt::format("from level {} with the domain {} to level {} with {}", level, text(coarse), level + 1, text(fine));
  const Vec3l ratio = fine.size() / coarse.size();
  if (ratio * coarse.size() != fine.size() || coarse.lower * ratio != fine.lower)
    in.fail(fmt::format("no whole refinement ratio leads {}", where));
  if (ratio.x != ratio.y || ratio.x != ratio.z)
    in.fail(fmt::format("the refinement ratio differs between the axes, {}, {}; only the same ratio along all can be read",
                        text(ratio), where));
  if (ratio.x < 2) in.fail(fmt::format("the refinement ratio is {} {}; at least 2 is needed", ratio.x, where));
  return static_cast<int>(ratio.x);
}

/// The line of ratios (empty with one level; some codes write more than are used), then the domains.
void scan_domains(TextScanner& in, PlotHeader& header, std::size_t levels) {
  std::vector<std::int64_t> stated;
  while (in.peek() != '(') stated.push_back(in.integer("a refinement ratio or a level's domain", 0, kInt32Max));
  if (stated.size() + 1 < levels) in.fail(fmt::format("{} refinement ratios for {} levels", stated.size(), levels));
  for (std::size_t level = 0; level < levels; ++level) {
    header.domains.push_back(scan_box(in, fmt::format("the domain of level {}", level)));
    if (level == 0) continue;
    header.ratios.push_back(ratio_between(in, header.domains[level - 1], header.domains[level], level - 1));
    if (stated[level - 1] != header.ratios.back())
      in.fail(fmt::format("the refinement ratio from level {} to {} is stated as {}, but the domains make it {}", level - 1,
                          level, stated[level - 1], header.ratios.back()));
  }
}

void scan_coordinate_system(TextScanner& in) {
  const std::int64_t system = in.integer("the coordinate system", 0, 2);
  if (system != 0)
    in.fail(fmt::format("the coordinate system is {} ({}); only 0 (Cartesian) can be read", system,
                        system == 1 ? "cylindrical" : "spherical"));
  if (in.integer("the width of boundary regions", 0, kInt32Max) != 0)
    in.fail("boundary regions cannot be read; their width must be 0");
}

/// Physical bounds are passed over: the boxes of `Cell_H` are exact.
LevelEntry scan_level_entry(TextScanner& in, const fs::path& folder, std::int64_t level) {
  LevelEntry entry;
  in.integer(fmt::format("the number {} of the level", level), level, level);
  entry.grids = scan_count(in, "grids", 12);
  in.real("the time of the level");
  in.integer("the step of the level", std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max());
  for (std::int64_t i = 0; i < 6 * entry.grids; ++i) in.real("a bound of a grid");
  in.line("the end of the line");
  entry.cell_header = folder / scan_level_path(in);
  entry.cell_header += "_H";
  return entry;
}

PlotHeader scan_header(const fs::path& folder) {
  const fs::path path = folder / "Header";
  TextScanner in(path.string(), load_text(path));
  PlotHeader header;
  scan_version(in);
  scan_fields(in, header);
  scan_dimension(in, header.fields.size());
  in.real("the time");
  const std::int64_t finest = in.integer("the number of the finest level", 0, kMaxLevels - 1);
  header.lower = scan_corner(in, "the lower corner of the domain");
  header.upper = scan_corner(in, "the upper corner of the domain");
  if (!glm::all(glm::lessThan(header.lower, header.upper))) in.fail("the upper corner of the domain is not above the lower one");
  scan_domains(in, header, static_cast<std::size_t>(finest + 1));
  for (std::int64_t level = 0; level <= finest; ++level)
    in.integer("the step of a level", std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max());
  for (std::int64_t i = 0; i < 3 * (finest + 1); ++i) in.real("the size of a level's cells");
  scan_coordinate_system(in);
  for (std::int64_t level = 0; level <= finest; ++level) header.levels.push_back(scan_level_entry(in, folder, level));
  return header;
}

/// `(n 0`, then n boxes, then `)`.
void scan_boxes(TextScanner& in, CellHeader& cells, std::int64_t level, const LevelEntry& entry, const IndexBox& domain) {
  in.expect("(", "the list of boxes");
  const std::int64_t count = scan_count(in, "boxes", 15);
  if (count != entry.grids) in.fail(fmt::format("{} boxes, but Header has {} grids in level {}", count, entry.grids, level));
  in.integer("the number behind the count of boxes", 0, std::numeric_limits<std::int64_t>::max());
  cells.boxes.reserve(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i) {
    cells.boxes.push_back(scan_box(in, "a box"));
    if (!domain.contains(cells.boxes.back()))
      in.fail(fmt::format("box {} {} lies outside the domain {} of level {}", i, text(cells.boxes.back()), text(domain), level));
  }
  in.expect(")", "the list of boxes");
}

void scan_fabs(TextScanner& in, CellHeader& cells) {
  const std::int64_t count = scan_count(in, "data positions", 14);
  if (count != static_cast<std::int64_t>(cells.boxes.size()))
    in.fail(fmt::format("{} data positions (FabOnDisk) for {} boxes", count, cells.boxes.size()));
  cells.fabs.reserve(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i) {
    in.expect("FabOnDisk:", "the position of a patch");
    const std::string file = in.token("the name of a data file");
    if (file.find_first_of("/\\") != std::string::npos || file == ".." || file == "." || has_control_characters(file))
      in.fail(fmt::format("the data file '{}' is not a plain name in the level's own folder",
                          has_control_characters(file) ? "?" : file));
    const std::int64_t offset = in.integer("the offset of a patch", 0, std::numeric_limits<std::int64_t>::max());
    cells.fabs.push_back({file, static_cast<std::uint64_t>(offset)});
  }
}

void skip_reals(TextScanner& in, std::int64_t count, std::string_view what) {
  for (std::int64_t i = 0; i < count; ++i) {
    in.real(what);
    in.expect(",", what);
  }
}

/// `n,components`, then n lines of values.
void skip_range_table(TextScanner& in, std::int64_t patches, std::int64_t components, std::string_view what) {
  const std::int64_t rows = in.integer(fmt::format("the length of {}", what), 0, kInt32Max);
  in.expect(",", what);
  const std::int64_t columns = in.integer(fmt::format("the width of {}", what), 0, kInt32Max);
  if (rows != patches || (rows > 0 && columns != components))
    in.fail(fmt::format("{} has {} by {} entries; {} patches by {} components are expected", what, rows, columns, patches,
                        components));
  skip_reals(in, rows * columns, what);
}

/// Behind the positions: tables of minima and maxima (a patch: versions 1 and 3; in all: 4), then the format of
/// the numbers (2 to 4). The tables are passed over, which also shows that the file is whole.
void scan_ranges(TextScanner& in, CellHeader& cells, std::int64_t version, std::int64_t components) {
  const auto patches = static_cast<std::int64_t>(cells.boxes.size());
  for (const char* what : {"the table of minima", "the table of maxima"}) {
    if (version == 1 || version == 3) skip_range_table(in, patches, components, what);
    if (version == 4) skip_reals(in, components, what);
  }
  if (version != 1) cells.format = scan_real_format(in);
}

CellHeader scan_cell_header(const PlotHeader& header, std::size_t level) {
  const LevelEntry& entry = header.levels[level];
  TextScanner in(entry.cell_header.string(), load_text(entry.cell_header));
  CellHeader cells;
  const std::int64_t version = in.integer("the version", 1, 4);
  in.integer("the way of writing", 0, 1);
  const std::int64_t components = in.integer("the number of components", 0, kInt32Max);
  if (components != static_cast<std::int64_t>(header.fields.size()))
    in.fail(fmt::format("{} components, but Header names {} fields", components, header.fields.size()));
  cells.ghosts = in.peek() == '(' ? scan_tuple(in, "the number of ghost cells", 0, kInt32Max)
                                  : Vec3l(in.integer("the number of ghost cells", 0, kInt32Max));
  scan_boxes(in, cells, static_cast<std::int64_t>(level), entry, header.domains[level]);
  scan_fabs(in, cells);
  scan_ranges(in, cells, version, components);
  return cells;
}

// ---- where the values stand ----

/// A data file opened for reads at any position, from any thread.
class DataFile {
 public:
  explicit DataFile(const fs::path& path) : path_(path.string()), descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor_ < 0) throw Error(fmt::format("{}: {}", path_, std::generic_category().message(errno)));
  }
  ~DataFile() { ::close(descriptor_); }
  DataFile(const DataFile&) = delete;
  DataFile& operator=(const DataFile&) = delete;

  void read(std::uint64_t offset, std::byte* out, std::size_t bytes) const {
    while (bytes > 0) {
      const ssize_t got = ::pread(descriptor_, out, bytes, static_cast<off_t>(offset));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0)
        throw Error(fmt::format("{}: {} bytes at {} cannot be read: {}", path_, bytes, offset,
                                got < 0 ? std::generic_category().message(errno) : "the file ends"));
      out += got;
      offset += static_cast<std::uint64_t>(got);
      bytes -= static_cast<std::size_t>(got);
    }
  }

 private:
  std::string path_;
  int descriptor_;
};

/// A patch's values in a data file.
struct FabSource {
  const fs::path* file = nullptr;
  std::uint64_t values_begin = 0;
  RealFormat format;
  IndexBox stored;  ///< with ghost cells
  IndexBox valid;
};

struct LevelSources {
  std::map<std::string, std::pair<fs::path, std::uint64_t>> files;  ///< by name: path and size in bytes
  std::vector<FabSource> fabs;
};

/// Reads the FAB line in front of the values, checks that it is the patch that `Cell_H` means.
void scan_fab_line(FabSource& fab, std::uint64_t offset, std::uint64_t file_size, std::size_t components) {
  std::string line(static_cast<std::size_t>(std::min<std::uint64_t>(kFabLineBytes, file_size - offset)), '\0');
  DataFile(*fab.file).read(offset, reinterpret_cast<std::byte*>(line.data()), line.size());
  const std::size_t length = std::min(line.find('\n'), line.size());
  const bool ends = length < line.size();
  line.resize(length);
  TextScanner in(fmt::format("{}, FAB at byte {}", fab.file->string(), offset), std::move(line), false);
  in.expect("FAB", "the line in front of a patch");
  fab.format = scan_real_format(in);
  const IndexBox box = scan_box(in, "the box of the FAB");
  if (box != fab.stored) in.fail(fmt::format("its box is {}, but Cell_H makes it {}", text(box), text(fab.stored)));
  const std::int64_t count = in.integer("the number of components", 0, kInt32Max);
  if (count != static_cast<std::int64_t>(components))
    in.fail(fmt::format("{} components, but Header names {} fields", count, components));
  if (!ends || in.peek() != '\0') in.fail("its first line does not end behind the number of components");
  fab.values_begin = offset + length + 1;
}

/// The patch's place in its file, which must hold all of it. Returns the bytes that it takes.
std::uint64_t locate_fab(FabSource& fab, const CellHeader& cells, std::size_t patch, std::uint64_t file_size,
                         std::size_t components) {
  const std::uint64_t offset = cells.fabs[patch].offset;
  if (offset >= file_size)
    throw Error(fmt::format("{}: patch {} is said to begin at byte {}, but the file has only {}", fab.file->string(), patch,
                            offset, file_size));
  fab.valid = cells.boxes[patch];
  fab.stored = {fab.valid.lower - cells.ghosts, fab.valid.upper + cells.ghosts};
  fab.values_begin = offset;
  if (cells.format)
    fab.format = *cells.format;
  else
    scan_fab_line(fab, offset, file_size, components);
  const auto range = fab_component_range(fab.values_begin, fab.stored.size(), components, 0, fab.format.bytes);
  if (!range || range->fab_end > file_size)
    throw Error(fmt::format("{}: too short, {} bytes; patch {} {} of {} components needs {} from byte {} on", fab.file->string(),
                            file_size, patch, text(fab.stored), components,
                            range ? fmt::format("{} bytes", range->fab_end - fab.values_begin) : "more than 2^63 bytes",
                            fab.values_begin));
  return range->fab_end - fab.values_begin;
}

/// Finds every patch of a level. Together they may not claim more bytes than there
/// are, else a small file could make us allocate without bound by naming the same bytes many times.
LevelSources locate_level(const PlotHeader& header, std::size_t level) {
  const CellHeader cells = scan_cell_header(header, level);
  const fs::path folder = header.levels[level].cell_header.parent_path();
  LevelSources sources;
  sources.fabs.resize(cells.boxes.size());
  std::uint64_t present = 0;
  std::uint64_t claimed = 0;
  for (std::size_t patch = 0; patch < cells.boxes.size(); ++patch) {
    const auto [file, is_new] = sources.files.try_emplace(cells.fabs[patch].file);
    if (is_new) {
      file->second = {folder / file->first, regular_file_size(folder / file->first)};
      present += file->second.second;
    }
    sources.fabs[patch].file = &file->second.first;
    claimed += locate_fab(sources.fabs[patch], cells, patch, file->second.second, header.fields.size());
    if (claimed > present)
      throw Error(fmt::format("{}: its patches take {} bytes, but the data files have only {}; some must share their bytes",
                              header.levels[level].cell_header.string(), claimed, present));
  }
  return sources;
}

// ---- reading the values ----

/// One component without its ghost cells, a few rows at a time.
void read_component(const DataFile& file, const FabSource& fab, std::uint64_t components, std::uint64_t component,
                    std::vector<double>& out) {
  const Vec3l stored = fab.stored.size();
  const Vec3l size = fab.valid.size();
  const Vec3l skip = fab.valid.lower - fab.stored.lower;
  const auto value_bytes = static_cast<std::uint64_t>(fab.format.bytes);
  const auto row_bytes = static_cast<std::uint64_t>(stored.x) * value_bytes;
  const auto rows_at_once = static_cast<std::int64_t>(std::max<std::uint64_t>(1, kReadBytes / row_bytes));
  const std::uint64_t begin = fab_component_range(fab.values_begin, stored, components, component, fab.format.bytes)->begin;
  std::vector<std::byte> buffer(static_cast<std::size_t>(row_bytes) * static_cast<std::size_t>(std::min(rows_at_once, size.y)));
  double* target = out.data();
  for (std::int64_t z = 0; z < size.z; ++z)
    for (std::int64_t y = 0; y < size.y; y += rows_at_once) {
      const std::int64_t rows = std::min(rows_at_once, size.y - y);
      const auto first_row = static_cast<std::uint64_t>((z + skip.z) * stored.y + y + skip.y);
      file.read(begin + first_row * row_bytes, buffer.data(),
                static_cast<std::size_t>(row_bytes) * static_cast<std::size_t>(rows));
      for (std::int64_t row = 0; row < rows; ++row, target += size.x)
        decode_reals(
            buffer.data() + static_cast<std::uint64_t>(row) * row_bytes + static_cast<std::uint64_t>(skip.x) * value_bytes,
            static_cast<std::size_t>(size.x), fab.format, target);
    }
}

void read_patch(const FabSource& fab, const IndexBox& domain, std::size_t components, const std::vector<std::size_t>& wanted,
                Patch& patch) {
  // the box lies in a domain of at most 2^31 - 1 cells an axis, so that both corners fit
  patch.box = {Vec3i(fab.valid.lower - domain.lower), Vec3i(fab.valid.upper - domain.lower + std::int64_t{1})};
  const DataFile file(*fab.file);
  patch.values.resize(wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    patch.values[i].resize(static_cast<std::size_t>(patch.box.cells()));
    read_component(file, fab, components, wanted[i], patch.values[i]);
  }
}

/// Sparse files make sizes that no memory holds: found out before anything is allocated.
void check_memory(const fs::path& path, const std::vector<LevelSources>& sources, std::size_t fields) {
  double bytes = 0;
  for (const LevelSources& level : sources)
    for (const FabSource& fab : level.fabs) {
      const Vec3d size(fab.valid.size());
      bytes += size.x * size.y * size.z * static_cast<double>(fields * sizeof(double));
    }
  const double memory = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  if (bytes > memory)
    throw BudgetError(fmt::format("{}: the values of {} fields take {:.3e} bytes, this machine has {:.3e}", path.string(), fields,
                                  bytes, memory));
}

void read_levels(const fs::path& path, const PlotHeader& header, const std::vector<LevelSources>& sources,
                 const std::vector<std::size_t>& wanted, MeshDescription& mesh) {
  try {
    mesh.levels.resize(sources.size());
    for (std::size_t level = 0; level < sources.size(); ++level) {
      const auto& fabs = sources[level].fabs;
      mesh.levels[level].resize(fabs.size());
      tbb::parallel_for(std::size_t{0}, fabs.size(), [&](std::size_t patch) {
        read_patch(fabs[patch], header.domains[level], header.fields.size(), wanted, mesh.levels[level][patch]);
      });
    }
  } catch (const std::bad_alloc&) {
    throw Error(fmt::format("{}: not enough memory for the values of {} fields", path.string(), wanted.size()));
  }
}

/// Components to read: those of the fields, or all.
std::vector<std::size_t> wanted_components(const fs::path& path, const PlotHeader& header,
                                           const std::vector<std::string>& fields) {
  std::vector<std::size_t> wanted;
  for (const std::string& field : fields.empty() ? header.fields : fields) {
    const auto found = std::find(header.fields.begin(), header.fields.end(), field);
    if (found == header.fields.end())
      throw UsageError(fmt::format("{}: no field '{}'; its fields are {}", path.string(), field, fmt::join(header.fields, ", ")));
    wanted.push_back(static_cast<std::size_t>(found - header.fields.begin()));
  }
  return wanted;
}

// ---- writing ----

/// A folder that vanishes with this object unless it is published under its final name.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const fs::path& target) : target_(target) {
    std::error_code failure;
    for (int attempt = 0; attempt < 100 && path_.empty() && !failure; ++attempt) {
      const fs::path candidate = target.parent_path() / fmt::format(".{}.{}-{}", target.filename().string(), ::getpid(), attempt);
      if (fs::create_directory(candidate, failure)) path_ = candidate;
    }
    if (path_.empty())
      throw Error(fmt::format("{}: no folder can be made beside it: {}", target.string(),
                              failure ? failure.message() : "all names are taken"));
  }
  ~TemporaryFolder() {
    std::error_code ignored;  // a destructor has nobody to tell
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const fs::path& path() const { return path_; }
  void publish() {
    refuse_existing(target_);
    std::error_code failure;
    fs::rename(path_, target_, failure);
    if (failure) throw Error(fmt::format("{}: cannot be given its name: {}", target_.string(), failure.message()));
    path_.clear();
  }

  static void refuse_existing(const fs::path& target) {
    if (fs::exists(fs::symlink_status(target)))
      throw Error(fmt::format("{}: exists already; give the name of a folder that does not", target.string()));
  }

 private:
  fs::path target_;
  fs::path path_;
};

/// A file of the plotfile; closing it tells whether all went well.
class OutputFile {
 public:
  explicit OutputFile(const fs::path& path) : path_(path), out_(path, std::ios::binary) { check(); }
  void write(const char* bytes, std::size_t count) {
    out_.write(bytes, static_cast<std::streamsize>(count));
    check();
    written_ += count;
  }
  void write(const std::string& s) { write(s.data(), s.size()); }
  std::uint64_t written() const { return written_; }
  void close() {
    out_.close();
    check();
  }

 private:
  void check() const {
    if (!out_) throw Error(fmt::format("{}: cannot be written (is the disk full?)", path_.string()));
  }
  fs::path path_;
  std::ofstream out_;
  std::uint64_t written_ = 0;
};

std::string box_text(const Box& box) {
  const Vec3i upper = box.upper - Vec3i(1);
  return fmt::format("(({},{},{}) ({},{},{}) (0,0,0))", box.lower.x, box.lower.y, box.lower.z, upper.x, upper.y, upper.z);
}

std::string header_of_level(const AmrHierarchy& mesh, int level) {
  const auto patches = mesh.patches(level);
  const Vec3d h = mesh.spacing(level);
  std::string s = fmt::format("{} {} 0\n0\n", level, patches.size());
  for (const Patch& patch : patches)
    for (int axis = 0; axis < 3; ++axis)
      s += fmt::format("{} {}\n", mesh.domain_lower()[axis] + patch.box.lower[axis] * h[axis],
                       mesh.domain_lower()[axis] + patch.box.upper[axis] * h[axis]);
  return s + fmt::format("Level_{}/Cell\n", level);
}

std::string header_text(const AmrHierarchy& mesh) {
  std::string s = fmt::format("HyperCLaw-V1.1\n{}\n{}\n3\n0\n{}\n", mesh.fields().size(), fmt::join(mesh.fields(), "\n"),
                              mesh.finest_level());
  const Vec3d lower = mesh.domain_lower();
  const Vec3d upper = mesh.domain_upper();
  s += fmt::format("{} {} {}\n{} {} {}\n", lower.x, lower.y, lower.z, upper.x, upper.y, upper.z);
  for (int level = 0; level < mesh.finest_level(); ++level) s += fmt::format("{} ", mesh.ratio_to_finer(level));
  s += "\n";
  for (int level = 0; level < mesh.level_count(); ++level) s += box_text(mesh.domain(level)) + " ";
  s += "\n";
  for (int level = 0; level < mesh.level_count(); ++level) s += "0 ";
  s += "\n";
  for (int level = 0; level < mesh.level_count(); ++level) {
    const Vec3d h = mesh.spacing(level);
    s += fmt::format("{} {} {}\n", h.x, h.y, h.z);
  }
  s += "0\n0\n";
  for (int level = 0; level < mesh.level_count(); ++level) s += header_of_level(mesh, level);
  return s;
}

/// Range of the values that are numbers: AMReX reads its tables by stream extraction, which fails on "nan".
/// Without any number, the range that AMReX takes for empty.
std::pair<double, double> finite_range(const std::vector<double>& values) {
  std::pair<double, double> range{std::numeric_limits<double>::max(), std::numeric_limits<double>::lowest()};
  for (double v : values)
    if (std::isfinite(v)) range = {std::min(range.first, v), std::max(range.second, v)};
  return range;
}

/// Writes the data file of a level; returns where each patch begins.
std::vector<std::uint64_t> write_level_data(const AmrHierarchy& mesh, int level, const fs::path& path) {
  static_assert(std::endian::native == std::endian::little, "values are written as they stand in memory");
  std::vector<std::uint64_t> offsets;
  OutputFile out(path);
  for (const Patch& patch : mesh.patches(level)) {
    offsets.push_back(out.written());
    out.write(fmt::format("FAB ((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1))){} {}\n", box_text(patch.box),
                          patch.values.size()));
    for (const auto& values : patch.values)
      out.write(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
  }
  out.close();
  return offsets;
}

void write_cell_header(const AmrHierarchy& mesh, int level, const std::vector<std::uint64_t>& offsets, const fs::path& path) {
  const auto patches = mesh.patches(level);
  OutputFile out(path);
  out.write(fmt::format("1\n1\n{}\n0\n({} 0\n", mesh.fields().size(), patches.size()));
  for (const Patch& patch : patches) out.write(box_text(patch.box) + "\n");
  out.write(fmt::format(")\n{}\n", patches.size()));
  for (std::uint64_t offset : offsets) out.write(fmt::format("FabOnDisk: Cell_D_00000 {}\n", offset));
  std::string minima = fmt::format("\n{},{}\n", patches.size(), patches.empty() ? 0 : mesh.fields().size());
  std::string maxima = minima;
  for (const Patch& patch : patches) {
    for (const auto& values : patch.values) {
      const auto [lowest, highest] = finite_range(values);
      minima += fmt::format("{:.17e},", lowest);
      maxima += fmt::format("{:.17e},", highest);
    }
    minima += "\n";
    maxima += "\n";
  }
  out.write(minima + maxima + "\n");
  out.close();
}

/// Names stand one a line, and readers trim them.
void check_field_names(const AmrHierarchy& mesh, const fs::path& path) {
  for (const std::string& name : mesh.fields())
    if (name.empty() || has_control_characters(name) || name.front() == ' ' || name.back() == ' ')
      throw Error(fmt::format("{}: the field name '{}' cannot be written; a plotfile has one name a line", path.string(), name));
}

}  // namespace

bool is_amrex_plotfile(const fs::path& path) {
  // a plotfile that lost its Header is still one, and its reader says what is missing
  std::error_code ignored;
  return fs::is_regular_file(path / "Header", ignored) || fs::is_directory(path / "Level_0", ignored);
}

MeshDescription read_amrex_plotfile(const fs::path& path, const std::vector<std::string>& fields) {
  const PlotHeader header = scan_header(path);
  const std::vector<std::size_t> wanted = wanted_components(path, header, fields);
  std::vector<LevelSources> sources;
  for (std::size_t level = 0; level < header.levels.size(); ++level) sources.push_back(locate_level(header, level));
  check_memory(path, sources, wanted.size());
  MeshDescription mesh;
  mesh.name = dataset_name(path);
  mesh.domain_lower = header.lower;
  mesh.domain_upper = header.upper;
  mesh.root_cells = Vec3i(header.domains.front().size());
  mesh.ratios = header.ratios;
  for (std::size_t component : wanted) mesh.fields.push_back(header.fields[component]);
  read_levels(path, header, sources, wanted, mesh);
  return mesh;
}

void write_amrex_plotfile(const AmrHierarchy& hierarchy, const fs::path& path) {
  fs::path target = path.lexically_normal();
  if (target.filename().empty()) target = target.parent_path();
  check_field_names(hierarchy, target);
  TemporaryFolder::refuse_existing(target);
  TemporaryFolder folder(target);
  for (int level = 0; level < hierarchy.level_count(); ++level) {
    const fs::path level_folder = folder.path() / fmt::format("Level_{}", level);
    std::error_code failure;
    if (!fs::create_directory(level_folder, failure))
      throw Error(fmt::format("{}: {}", level_folder.string(), failure.message()));
    const auto offsets = write_level_data(hierarchy, level, level_folder / "Cell_D_00000");
    write_cell_header(hierarchy, level, offsets, level_folder / "Cell_H");
  }
  OutputFile header(folder.path() / "Header");
  header.write(header_text(hierarchy));
  header.close();
  folder.publish();
}

}  // namespace amrtex
