// The files of an ExaBrick data set as they are: cells in units of the finest ones, level 0 the finest.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// As the file has it: `width()` finest cells wide from `lower` on.
struct ExaCell {
  std::int32_t x, y, z;  ///< lower corner, finest cells
  std::int32_t level;    ///< 0 the finest

  std::int64_t width() const { return std::int64_t{1} << level; }
};
static_assert(sizeof(ExaCell) == 16);

struct ExaField {
  std::string name;
  std::filesystem::path scalars;
};

/// From the units of cells to the world, a box to a box.
struct ExaRemap {
  Vec3d from_lower{0}, from_upper{1};
  Vec3d to_lower{0}, to_upper{1};
};

/// Which files a data set is made of.
struct ExaFiles {
  std::filesystem::path geometry;  ///< `.cells` or `.bricks`
  bool bricks = false;
  std::vector<ExaField> fields;
  std::optional<ExaRemap> remap;
};

inline constexpr int kMostExaLevel = 30;

/// What belongs to the file or folder that somebody named.
ExaFiles find_exa_files(const std::filesystem::path& path);

/// Elements of `bytes` each that the file holds. Throws Error where they are no whole number; `what` names them.
std::uint64_t count_exa_elements(const std::filesystem::path& file, std::uint64_t bytes, std::string_view what);
/// How many values a file of scalars holds.
std::uint64_t count_exa_scalars(const std::filesystem::path& scalars);

}  // namespace amrtex
