#include "structures/readers/amrex_plotfile/amrex_header.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kInt32Min = std::numeric_limits<std::int32_t>::min();
constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t kMaxLevels = 64;

/// `(x,y,z)`, or `(x,y)` with 0 behind it.
Vec3l scan_tuple(TextScanner& in, int dimensions, std::string_view what, std::int64_t lowest, std::int64_t highest) {
  Vec3l tuple(0);
  in.expect("(", what);
  for (int axis = 0; axis < dimensions; ++axis) {
    if (axis > 0) in.expect(",", what);
    tuple[axis] = in.integer(what, lowest, highest);
  }
  in.expect(")", what);
  return tuple;
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
    in.fail(fmt::format("{} is no path below the plotfile; one such as Level_0/Cell is expected", in.found(name)));
  return path;
}

/// The first lines that codes write over the same layout.
constexpr std::array<std::string_view, 3> kVersions{"HyperCLaw-V1.1", "NavierStokes-V1.1", "CartGrid-V2.0"};

void scan_version(TextScanner& in) {
  const std::string accepted = fmt::format("{}", fmt::join(kVersions, ", "));
  const std::string version = in.line(fmt::format("the version, one of {}", accepted));
  if (std::find(kVersions.begin(), kVersions.end(), version) != kVersions.end()) return;
  const bool checkpoint = version.rfind("CheckPointVersion", 0) == 0 || version.rfind("Checkpoint", 0) == 0;
  in.fail(fmt::format("not an AMReX plotfile{}: its first line is {}; accepted: {}", checkpoint ? " but a checkpoint" : "",
                      in.found(version), accepted));
}

void scan_fields(TextScanner& in, PlotHeader& header) {
  const std::int64_t count = scan_count(in, "fields", 2);
  if (count == 0) in.fail("the plotfile has no fields");
  in.line("the end of the line");
  for (std::int64_t i = 0; i < count; ++i) {
    header.fields.push_back(in.line(fmt::format("the name of field {} of {}", i + 1, count)));
    if (!is_utf8(header.fields.back()))
      in.fail(fmt::format("the name of field {} of {}, {}, is not UTF-8", i + 1, count, in.found(header.fields.back())));
  }
}

int scan_dimensions(TextScanner& in, std::size_t fields) {
  const std::int64_t dimensions = in.integer(fmt::format("the dimension behind the names of {} fields", fields), 1, 3);
  if (dimensions == 1) in.fail("the data are 1-dimensional; 2 and 3 dimensions can be read");
  return static_cast<int>(dimensions);
}

/// Along an axis that there is not: `otherwise`.
Vec3d scan_corner(TextScanner& in, int dimensions, std::string_view what, double otherwise) {
  Vec3d corner(otherwise);
  for (int axis = 0; axis < dimensions; ++axis) {
    corner[axis] = in.real(what);
    if (!std::isfinite(corner[axis])) in.fail(fmt::format("{} is not finite", what));
  }
  return corner;
}

/// The ratio between two levels follows from their domains: the line of ratios holds only one axis.
int ratio_between(const TextScanner& in, int dimensions, const IndexBox& coarse, const IndexBox& fine, std::size_t level) {
  const std::string where =
      fmt::format("from level {} with the domain {} to level {} with {}", level, text(coarse), level + 1, text(fine));
  Vec3l ratio = fine.size() / coarse.size();
  if (ratio * coarse.size() != fine.size() || coarse.lower * ratio != fine.lower)
    in.fail(fmt::format("no whole refinement ratio leads {}", where));
  if (dimensions == 2) ratio.z = ratio.x;
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
    header.domains.push_back(scan_box(in, header.dimensions, fmt::format("the domain of level {}", level)));
    if (level == 0) continue;
    header.ratios.push_back(ratio_between(in, header.dimensions, header.domains[level - 1], header.domains[level], level - 1));
    if (stated[level - 1] != header.ratios.back())
      in.fail(fmt::format("the refinement ratio from level {} to {} is stated as {}, but the domains make it {}", level - 1,
                          level, stated[level - 1], header.ratios.back()));
  }
}

/// The sizes of a level's cells say again what the domain and its cells say; a file where they differ is damaged or was
/// put together from two. Old codes write few digits.
void scan_cell_size(TextScanner& in, const PlotHeader& header, std::size_t level) {
  constexpr double kRounding = 1e-4;  // relative
  const Vec3d cells(header.domains[level].size());
  const Vec3d expected = (header.upper - header.lower) / cells;
  for (int axis = 0; axis < header.dimensions; ++axis) {
    const double stated = in.real("the size of a level's cells");
    if (std::abs(stated - expected[axis]) <= kRounding * expected[axis]) continue;
    in.fail(fmt::format("the cells of level {} are said to be {} wide along {}, but the domain and its {} cells make them {}",
                        level, stated, "xyz"[axis], cells[axis], expected[axis]));
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
LevelEntry scan_level_entry(TextScanner& in, const PlotHeader& header, std::int64_t level) {
  LevelEntry entry;
  in.integer(fmt::format("the number {} of the level", level), level, level);
  entry.grids = scan_count(in, "grids", 4 * header.dimensions);
  in.real("the time of the level");
  in.integer("the step of the level", std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max());
  for (std::int64_t i = 0; i < 2 * header.dimensions * entry.grids; ++i) in.real("a bound of a grid");
  in.line("the end of the line");
  entry.cell_header = header.folder / scan_level_path(in);
  entry.cell_header += "_H";
  return entry;
}

/// `(n 0`, then n boxes, then `)`.
void scan_boxes(TextScanner& in, CellHeader& cells, const PlotHeader& header, std::size_t level) {
  const LevelEntry& entry = header.levels[level];
  const IndexBox& domain = header.domains[level];
  in.expect("(", "the list of boxes");
  const std::int64_t count = scan_count(in, "boxes", 13);
  if (count != entry.grids) in.fail(fmt::format("{} boxes, but Header has {} grids in level {}", count, entry.grids, level));
  in.integer("the number behind the count of boxes", 0, std::numeric_limits<std::int64_t>::max());
  cells.boxes.reserve(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i) {
    cells.boxes.push_back(scan_box(in, header.dimensions, "a box"));
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
      in.fail(fmt::format("the data file {} is not a plain name in the level's own folder", in.found(file)));
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

}  // namespace

IndexBox scan_box(TextScanner& in, int dimensions, std::string_view what) {
  IndexBox box;
  in.expect("(", what);
  box.lower = scan_tuple(in, dimensions, what, kInt32Min, kInt32Max);
  box.upper = scan_tuple(in, dimensions, what, kInt32Min, kInt32Max);
  if (in.peek() == '(' && scan_tuple(in, dimensions, what, 0, 1) != Vec3l(0))
    in.fail(fmt::format("{} {} is not cell-centred; only cell-centred data can be read", what, text(box)));
  in.expect(")", what);
  if (glm::any(glm::lessThan(box.upper, box.lower))) in.fail(fmt::format("{} {} is empty", what, text(box)));
  if (glm::any(glm::greaterThan(box.size(), Vec3l(kInt32Max))))
    in.fail(fmt::format("{} {} is wider than {} cells", what, text(box), kInt32Max));
  return box;
}

PlotHeader scan_header(const fs::path& folder) {
  const fs::path path = folder / "Header";
  TextScanner in = open_text(path, folder);
  PlotHeader header;
  header.folder = folder;
  scan_version(in);
  scan_fields(in, header);
  header.dimensions = scan_dimensions(in, header.fields.size());
  in.real("the time");
  const std::int64_t finest = in.integer("the number of the finest level", 0, kMaxLevels - 1);
  header.lower = scan_corner(in, header.dimensions, "the lower corner of the domain", 0);
  header.upper = scan_corner(in, header.dimensions, "the upper corner of the domain", 1);
  if (!glm::all(glm::lessThan(header.lower, header.upper))) in.fail("the upper corner of the domain is not above the lower one");
  scan_domains(in, header, static_cast<std::size_t>(finest + 1));
  for (std::int64_t level = 0; level <= finest; ++level)
    in.integer("the step of a level", std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max());
  for (std::int64_t level = 0; level <= finest; ++level) scan_cell_size(in, header, static_cast<std::size_t>(level));
  scan_coordinate_system(in);
  for (std::int64_t level = 0; level <= finest; ++level) header.levels.push_back(scan_level_entry(in, header, level));
  return header;
}

CellHeader scan_cell_header(const PlotHeader& header, std::size_t level) {
  const LevelEntry& entry = header.levels[level];
  TextScanner in = open_text(entry.cell_header, header.folder);
  CellHeader cells;
  const std::int64_t version = in.integer("the version", 1, 4);
  in.integer("the way of writing", 0, 1);
  const std::int64_t components = in.integer("the number of components", 0, kInt32Max);
  if (components != static_cast<std::int64_t>(header.fields.size()))
    in.fail(fmt::format("{} components, but Header names {} fields", components, header.fields.size()));
  cells.ghosts = in.peek() == '(' ? scan_tuple(in, header.dimensions, "the number of ghost cells", 0, kInt32Max)
                                  : Vec3l(in.integer("the number of ghost cells", 0, kInt32Max));
  if (header.dimensions == 2) cells.ghosts.z = 0;
  scan_boxes(in, cells, header, level);
  scan_fabs(in, cells);
  scan_ranges(in, cells, version, components);
  return cells;
}

}  // namespace amrtex
