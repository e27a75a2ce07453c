// What the text files of a plotfile say: `Header` and a `Cell_H` a level.
//
// Formats read: AMReX Src/Base, AMReX_PlotFileUtil.cpp (`Header`) and AMReX_VisMF.cpp (`Cell_H`, versions 1 to 4).
// Files are taken as hostile: counts are held against the bytes that are there
// before anything is allocated for them, and no name leads out of the folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/spaces.hpp"
#include "structures/readers/amrex_plotfile/amrex_fab.hpp"
#include "structures/readers/index_box.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {

struct LevelEntry {
  std::int64_t grids = 0;
  std::filesystem::path cell_header;  ///< `Cell_H` of the level
};

struct PlotHeader {
  std::filesystem::path folder;
  std::vector<std::string> fields;
  int dimensions = 3;  ///< 2 or 3; along the third axis of 2, boxes have the one cell 0
  Vec3d lower{0};      ///< world
  Vec3d upper{1};      ///< world
  std::vector<IndexBox> domains;
  std::vector<int> ratios;
  std::vector<LevelEntry> levels;
};

struct FabOnDisk {
  std::string file;  ///< a plain name
  std::uint64_t offset = 0;
};

struct CellHeader {
  Vec3l ghosts{0};
  std::vector<IndexBox> boxes;
  std::vector<FabOnDisk> fabs;
  std::optional<RealFormat> format;  ///< where the data files hold no FAB lines (versions 2 to 4)
};

/// Reads `Header`. Throws Error naming file, line and fault.
PlotHeader scan_header(const std::filesystem::path& folder);
/// Reads the `Cell_H` of a level, which must agree with `Header`.
CellHeader scan_cell_header(const PlotHeader& header, std::size_t level);

/// `((0,0,0) (15,15,15) (0,0,0))`; the last triple, the centring, may be absent and must be cells.
IndexBox scan_box(TextScanner& in, int dimensions, std::string_view what);

}  // namespace amrtex
