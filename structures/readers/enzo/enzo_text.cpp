#include "structures/readers/enzo/enzo_text.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();
constexpr int kMaxLevels = 64;

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// A line `key = value`, or one without "=", which is all key.
struct Line {
  const fs::path& path;
  std::size_t number;
  bool hidden;  ///< the file lies outside of the output's folder: what it says is not shown
  std::string_view key;
  std::string_view value;

  [[noreturn]] void fail(std::string_view what) const {
    throw Error(fmt::format("{}, line {}: {}", path.string(), number, what));
  }
  [[noreturn]] void fail_expected(std::string_view what) const {
    fail(fmt::format("{} = {}: {} expected", hidden ? "(a key)" : clipped(key), hidden ? "..." : clipped(value), what));
  }

  /// The first numbers of the value.
  template <class T, class F>
  void numbers(int count, std::string_view what, F&& take) const {
    std::string_view rest = value;
    for (int i = 0; i < count; ++i) {
      rest = trimmed(rest);
      T number_read{};
      const auto [end, failure] = std::from_chars(rest.data(), rest.data() + rest.size(), number_read);
      if (failure != std::errc()) fail_expected(fmt::format("{} {} are", count, what));
      rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
      take(i, number_read);
    }
  }
  std::int64_t integer(std::int64_t lowest, std::int64_t highest) const {
    std::int64_t found = 0;
    numbers<std::int64_t>(1, "whole number", [&](int, std::int64_t v) { found = v; });
    if (found < lowest || found > highest) fail_expected(fmt::format("{} to {} is", lowest, highest));
    return found;
  }
  Vec3i cells(int count, std::int64_t lowest) const {
    Vec3i found(1);
    numbers<std::int64_t>(count, "whole numbers", [&](int axis, std::int64_t v) {
      if (v < lowest || v >= kInt32Max) fail_expected(fmt::format("{} to {} are", lowest, kInt32Max - 1));
      found[axis] = static_cast<int>(v);
    });
    return found;
  }
  Vec3d corner(int count) const {
    Vec3d found(0);
    numbers<double>(count, "numbers", [&](int axis, double v) {
      if (!std::isfinite(v)) fail_expected("finite numbers are");
      found[axis] = v;
    });
    return found;
  }
};

template <class F>
void for_each_line(const fs::path& path, F&& f) {
  const std::string text = load_text(path);
  const bool hidden = leads_out_of(path.parent_path().empty() ? fs::path(".") : path.parent_path(), path);
  std::size_t number = 1;
  for (std::size_t at = 0; at < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = trimmed(std::string_view(text).substr(at, end - at));
    const std::size_t equals = line.find('=');
    const bool pair = equals != std::string_view::npos;
    f(Line{path, number, hidden, trimmed(line.substr(0, pair ? equals : line.size())),
           pair ? trimmed(line.substr(equals + 1)) : std::string_view{}});
    at = end + 1;
  }
}

void check_version(const Line& line) {
  double version = 0;
  line.numbers<double>(1, "number", [&](int, double v) { version = v; });
  if (!(version < 3)) line.fail(fmt::format("version {} of Enzo; versions 1 and 2 can be read", version));
}

void check_rank(const Line& line, std::int64_t rank) {
  if (rank == 1) line.fail("the data are 1-dimensional; 2 and 3 dimensions can be read");
}

void check_coordinates(const Line& line) {
  const std::int64_t system = line.integer(-kInt32Max, kInt32Max);
  if (system > 0)
    line.fail(fmt::format("the coordinates are {} ({}); only 0 (Cartesian) can be read", system,
                          system == 1 ? "spherical" : (system == 2 ? "cylindrical" : "unknown")));
}

/// The number of `DataLabel[3]`, where `name` is what stands in front of it; -1 for other keys.
int field_number(std::string_view key, std::string_view name) {
  if (!key.starts_with(name) || !key.substr(name.size()).starts_with('[')) return -1;
  int number = -1;
  std::from_chars(key.data() + name.size() + 1, key.data() + key.size(), number);
  return number;
}

void set_field(const Line& line, EnzoParameters& parameters) {
  if (const int number = field_number(line.key, "DataLabel"); number >= 0) parameters.labels[number] = std::string(line.value);
  if (const int number = field_number(line.key, "DataUnits"); number >= 0 && !line.hidden)
    parameters.units[number] = std::string(line.value);
  // a comment to the code itself
  if (const int number = field_number(line.key, "#DataCGSConversionFactor"); number >= 0) {
    double factor = std::numeric_limits<double>::quiet_NaN();
    std::from_chars(line.value.data(), line.value.data() + line.value.size(), factor);
    parameters.factors[number] = factor;
  }
}

/// The name of a data file: paths are those of the machine that wrote them, so that only their last part counts.
std::string file_name(const Line& line) {
  const auto slash = line.value.find_last_of('/');
  std::string name(slash == std::string_view::npos ? line.value : line.value.substr(slash + 1));
  if (name.empty() || name == "." || name == ".." || printable(name) != name) line.fail_expected("the name of a file is");
  return name;
}

/// "Grid[86]->NextGridNextLevel = 0" behind "Pointer: ".
struct Pointer {
  std::int64_t from = 0;
  std::int64_t to = 0;
  bool finer = false;
};

Pointer scan_pointer(const Line& line) {
  constexpr std::string_view kStart = "Pointer: Grid[";
  Pointer pointer;
  const char* end = line.key.data() + line.key.size();
  const auto [behind, failure] = std::from_chars(line.key.data() + kStart.size(), end, pointer.from);
  const std::string_view kind(behind, static_cast<std::size_t>(end - behind));
  pointer.finer = kind == "]->NextGridNextLevel";
  if (failure != std::errc() || (!pointer.finer && kind != "]->NextGridThisLevel"))
    line.fail_expected("Pointer: Grid[n]->NextGridThisLevel or NextGridNextLevel is");
  pointer.to = line.integer(0, kInt32Max);
  return pointer;
}

/// Levels of all grids: they hang together from the first one, each pointed at once.
void assign_levels(const fs::path& path, std::vector<EnzoGrid>& grids, const std::vector<Pointer>& pointers) {
  const auto fail = [&](const std::string& what) { throw Error(fmt::format("{}: {}", path.string(), what)); };
  const std::int64_t count = std::ssize(grids);
  std::vector<std::vector<Pointer>> from(grids.size());
  for (const Pointer& p : pointers) {
    if (p.from < 1 || p.from > count || p.to > count)
      fail(fmt::format("grid {} points at grid {}, but there are {} grids", p.from, p.to, count));
    if (p.to != 0) from[static_cast<std::size_t>(p.from - 1)].push_back(p);
  }
  std::vector<std::size_t> open{0};
  grids.front().level = 0;
  std::size_t reached = 0;
  while (!open.empty()) {
    const std::size_t at = open.back();
    open.pop_back();
    ++reached;
    for (const Pointer& p : from[at]) {
      EnzoGrid& grid = grids[static_cast<std::size_t>(p.to - 1)];
      if (grid.level >= 0) fail(fmt::format("grid {} is pointed at more than once", p.to));
      grid.level = grids[at].level + (p.finer ? 1 : 0);
      if (grid.level >= kMaxLevels)
        fail(fmt::format("grid {} is of level {}; {} levels are supported", p.to, grid.level, kMaxLevels));
      open.push_back(static_cast<std::size_t>(p.to - 1));
    }
  }
  if (reached != grids.size())
    fail(fmt::format("{} of {} grids cannot be reached from the first one", grids.size() - reached, grids.size()));
}

/// What a grid's lines have said so far.
struct GridLines {
  Vec3i start{0};
  Vec3i end{0};
  unsigned seen = 0;
};
enum Seen : unsigned { kStart = 1, kEnd = 2, kDimension = 4, kLower = 8, kUpper = 16, kFile = 32, kNoFields = 64 };

void take_grid_line(const Line& line, int rank, EnzoGrid& grid, GridLines& lines) {
  const auto seen = [&](Seen what) { lines.seen |= what; };
  if (line.key == "GridRank") {
    const std::int64_t stated = line.integer(1, 3);
    check_rank(line, stated);
    if (stated != rank) line.fail(fmt::format("rank {}, but the parameter file says {}", stated, rank));
  } else if (line.key == "GridDimension") {
    grid.stored = line.cells(rank, 1);
    seen(kDimension);
  } else if (line.key == "GridStartIndex") {
    lines.start = line.cells(rank, 0);
    seen(kStart);
  } else if (line.key == "GridEndIndex") {
    lines.end = line.cells(rank, 0);
    seen(kEnd);
  } else if (line.key == "GridLeftEdge") {
    grid.lower = line.corner(rank);
    seen(kLower);
  } else if (line.key == "GridRightEdge") {
    grid.upper = line.corner(rank);
    seen(kUpper);
  } else if (line.key == "NumberOfBaryonFields") {
    if (line.integer(0, kInt32Max) == 0) seen(kNoFields);
  } else if (line.key == "BaryonFileName") {
    grid.file = file_name(line);
    seen(kFile);
  }
}

void finish_grid(const fs::path& path, int rank, EnzoGrid& grid, const GridLines& lines) {
  const auto fail = [&](std::string_view what) { throw Error(fmt::format("{}: grid {}: {}", path.string(), grid.number, what)); };
  if ((lines.seen & kNoFields) != 0) fail("it has no baryon fields; only outputs with fields on their grids can be read");
  for (const auto& [bit, key] :
       {std::pair{kDimension, "GridDimension"}, std::pair{kStart, "GridStartIndex"}, std::pair{kEnd, "GridEndIndex"},
        std::pair{kLower, "GridLeftEdge"}, std::pair{kUpper, "GridRightEdge"}, std::pair{kFile, "BaryonFileName"}})
    if ((lines.seen & bit) == 0) fail(fmt::format("no line {}", key));
  for (int axis = 0; axis < rank; ++axis) {
    grid.ghosts[axis] = lines.start[axis];
    grid.cells[axis] = lines.end[axis] - lines.start[axis] + 1;
    if (grid.cells[axis] < 1 || lines.end[axis] >= grid.stored[axis])
      fail(fmt::format("its cells from {} to {} along {} do not lie in its {}", lines.start[axis], lines.end[axis], "xyz"[axis],
                       grid.stored[axis]));
    if (!(grid.upper[axis] > grid.lower[axis]))
      fail(fmt::format("its edges along {} are {} and {}", "xyz"[axis], grid.lower[axis], grid.upper[axis]));
  }
}

}  // namespace

std::string enzo_unit(const EnzoParameters& parameters, const std::string& field) {
  for (const auto& [number, label] : parameters.labels) {
    if (label != field) continue;
    const auto unit = parameters.units.find(number);
    const auto factor = parameters.factors.find(number);
    const bool said =
        unit != parameters.units.end() && unit->second != "none" && unit->second != "(none)" && is_utf8(unit->second);
    return said && (factor == parameters.factors.end() || factor->second == 1) ? unit->second : "";
  }
  return "";
}

EnzoParameters scan_enzo_parameters(const fs::path& path) {
  EnzoParameters parameters;
  bool cells = false;
  for_each_line(path, [&](const Line& line) {
    if (line.key == "VersionNumber") check_version(line);
    if (line.key == "TopGridRank") {
      parameters.rank = static_cast<int>(line.integer(1, 3));
      check_rank(line, parameters.rank);
    }
    if (line.key == "Coordinate") check_coordinates(line);
    if (line.key == "RefineBy") parameters.refine_by = static_cast<int>(line.integer(2, 1 << 16));
    set_field(line, parameters);
    // of the lines whose length depends on it, none stands in front of the rank
    const bool is_cells = line.key == "TopGridDimensions";
    const bool is_lower = line.key == "DomainLeftEdge";
    const bool is_upper = line.key == "DomainRightEdge";
    if (!is_cells && !is_lower && !is_upper) return;
    if (parameters.rank == 0) line.fail("a line TopGridRank is expected in front of this one");
    if (is_cells) parameters.root_cells = line.cells(parameters.rank, 1);
    if (is_lower) parameters.lower = line.corner(parameters.rank);
    if (is_upper) parameters.upper = line.corner(parameters.rank);
    cells = cells || is_cells;
  });
  if (!cells) throw Error(fmt::format("{}: no line TopGridDimensions", path.string()));
  return parameters;
}

std::vector<EnzoGrid> scan_enzo_hierarchy(const fs::path& path, int rank) {
  std::vector<EnzoGrid> grids;
  std::vector<Pointer> pointers;
  GridLines lines;
  for_each_line(path, [&](const Line& line) {
    if (line.key == "Grid") {
      if (!grids.empty()) finish_grid(path, rank, grids.back(), lines);
      const std::int64_t next = std::ssize(grids) + 1;
      if (line.integer(1, kInt32Max) != next) line.fail_expected(fmt::format("grid {} is", next));
      grids.emplace_back().number = next;
      lines = {};
    } else if (line.key.starts_with("Pointer: Grid[")) {
      pointers.push_back(scan_pointer(line));
    } else if (!grids.empty()) {
      take_grid_line(line, rank, grids.back(), lines);
    }
  });
  if (grids.empty()) throw Error(fmt::format("{}: no grid", path.string()));
  finish_grid(path, rank, grids.back(), lines);
  assign_levels(path, grids, pointers);
  return grids;
}

}  // namespace amrtex
