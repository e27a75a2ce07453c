#include "structures/readers/flash_hdf5/flash_parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <limits>
#include <map>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();

template <class T>
using Named = std::map<std::string, T>;

/// Scalars, and the parameters of the run.
struct Lists {
  Named<std::int64_t> integers, integer_parameters, logical_parameters;
  Named<double> real_parameters;
  Named<std::string> texts, text_parameters;
};

template <class T, class Read>
Named<T> list_of(const Hdf5File& file, const std::string& name, Read&& read) {
  Named<T> list;
  if (!file.has(name)) return list;
  for (auto& [key, value] : read(name)) list.emplace(key, std::move(value));
  return list;
}

Lists read_lists(const Hdf5File& file) {
  const auto integers = [&](const std::string& name) { return file.read_named_integers(name); };
  const auto reals = [&](const std::string& name) { return file.read_named_reals(name); };
  const auto texts = [&](const std::string& name) { return file.read_named_texts(name); };
  return {list_of<std::int64_t>(file, "integer scalars", integers),
          list_of<std::int64_t>(file, "integer runtime parameters", integers),
          list_of<std::int64_t>(file, "logical runtime parameters", integers),
          list_of<double>(file, "real runtime parameters", reals),
          list_of<std::string>(file, "string scalars", texts),
          list_of<std::string>(file, "string runtime parameters", texts)};
}

template <class T>
std::optional<T> find(const Named<T>& list, const std::string& key) {
  const auto found = list.find(key);
  return found == list.end() ? std::nullopt : std::optional<T>(found->second);
}

std::int64_t scan_version(const Hdf5File& file) {
  constexpr std::int64_t kOldest = 7;
  constexpr std::int64_t kNewest = 9;
  const char* name = "file format version";
  const bool old = file.has(name);
  const auto found = old ? file.read_integers(name).values : file.read_records("sim info", {name});
  if (found.size() != 1) file.fail(old ? name : "sim info", fmt::format("{} versions instead of one", found.size()));
  if (found.front() < kOldest || found.front() > kNewest)
    file.fail(old ? name : "sim info",
              fmt::format("version {} of FLASH's file format; versions {} to {} can be read", found.front(), kOldest, kNewest));
  return found.front();
}

void scan_block_cells(const Hdf5File& file, const Lists& lists, FlashParameters& parameters) {
  const std::array<std::string, 3> names{"nxb", "nyb", "nzb"};
  std::vector<std::int64_t> cells;
  for (const std::string& name : names)
    if (const auto found = find(lists.integers, name)) cells.push_back(*found);
  if (cells.size() < 3) cells = file.read_records("simulation parameters", {names.begin(), names.end()});
  if (cells.size() != 3) file.fail("simulation parameters", "the cells of a block are not there");
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t n = cells[static_cast<std::size_t>(axis)];
    if (n < 1 || n > (1 << 16)) file.fail(names[static_cast<std::size_t>(axis)], fmt::format("blocks of {} cells", n));
    parameters.block_cells[axis] = static_cast<int>(n);
  }
  const Vec3i& n = parameters.block_cells;
  const std::int64_t guessed = n.z > 1 ? 3 : (n.y > 1 ? 2 : 1);
  const std::int64_t dimensions = find(lists.integers, "dimensionality").value_or(guessed);
  if (dimensions == 1) file.fail("integer scalars", "the data are 1-dimensional; 2 and 3 dimensions can be read");
  if (dimensions != 2 && dimensions != 3)
    file.fail("integer scalars", fmt::format("dimensionality is {}; 2 and 3 can be read", dimensions));
  if (dimensions == 2 && n.z != 1)
    file.fail("integer scalars", fmt::format("two dimensions, but blocks of {} cells along z", n.z));
  parameters.dimensions = static_cast<int>(dimensions);
}

void refuse_curved(const Hdf5File& file, const Lists& lists) {
  const auto in_scalars = find(lists.texts, "geometry");
  std::string geometry = in_scalars ? *in_scalars : find(lists.text_parameters, "geometry").value_or("cartesian");
  std::erase(geometry, '"');
  std::transform(geometry.begin(), geometry.end(), geometry.begin(), [](unsigned char c) { return std::tolower(c); });
  if (geometry != "cartesian")
    file.fail("string scalars", fmt::format("the geometry is {}; only cartesian can be read", quote(geometry)));
  // version 7: 0 is planar
  for (const char* axis : {"igeomx", "igeomy", "igeomz"})
    if (const auto kind = find(lists.integer_parameters, axis); kind && *kind != 0)
      file.fail("integer runtime parameters",
                fmt::format("{} is {}, an axis that is not planar; only Cartesian data can be read", axis, *kind));
}

}  // namespace

FlashParameters scan_flash_parameters(const Hdf5File& file) {
  FlashParameters parameters;
  parameters.version = scan_version(file);
  const Lists lists = read_lists(file);
  scan_block_cells(file, lists, parameters);
  refuse_curved(file, lists);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    parameters.lower[axis] = find(lists.real_parameters, std::string(1, "xyz"[axis]) + "min");
    parameters.upper[axis] = find(lists.real_parameters, std::string(1, "xyz"[axis]) + "max");
    parameters.root_blocks[axis] = find(lists.integer_parameters, std::string("nblock") + "xyz"[axis]);
    if (const auto blocks = parameters.root_blocks[axis]; blocks && (*blocks < 1 || *blocks > kInt32Max))
      file.fail("integer runtime parameters", fmt::format("nblock{} is {}", "xyz"[axis], *blocks));
  }
  parameters.double_plot_files = find(lists.logical_parameters, "plotfilegridquantitydp").value_or(0) != 0;
  return parameters;
}

}  // namespace amrtex
