// Where the values of a level's patches stand in its data files, and reading them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "structures/mesh/cell_values.hpp"
#include "structures/readers/amrex_plotfile/amrex_header.hpp"

namespace amrtex {

struct LevelFile {
  std::filesystem::path path;
  std::uint64_t bytes = 0;
  bool outside = false;  ///< a link leads to it from the plotfile
};

/// A patch's values in a data file.
struct FabSource {
  const LevelFile* file = nullptr;
  std::uint64_t values_begin = 0;
  RealFormat format;
  IndexBox stored;  ///< with ghost cells
  IndexBox valid;
};

struct LevelSources {
  std::map<std::string, LevelFile> files;  ///< by name
  std::vector<FabSource> fabs;
};

/// Finds every patch of a level. Together they may not claim more bytes than there
/// are, else a small file could make us allocate without bound by naming the same bytes many times.
LevelSources locate_level(const PlotHeader& header, std::size_t level);

/// Reads one array a wanted component, without ghost cells, x fastest, into `memory`.
std::vector<CellValues> read_components(const FabSource& fab, std::size_t components, const std::vector<std::size_t>& wanted,
                                        const std::shared_ptr<CellMemory>& memory);

}  // namespace amrtex
