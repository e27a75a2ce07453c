// What the text files of an output of Enzo say: the parameters, and the grids of the hierarchy.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

struct EnzoParameters {
  int rank = 0;                       ///< 2 or 3
  Vec3i root_cells{1};                ///< 1 along axes that there are not
  Vec3d lower{0};                     ///< of the domain, world
  Vec3d upper{1};                     ///< of the domain, world
  int refine_by = 2;                  ///< between any two levels
  std::map<int, std::string> labels;  ///< names of the fields that the code carries along, in its order
  std::map<int, std::string> units;   ///< of these fields, where the file names one
  std::map<int, double> factors;      ///< what makes of a stored value one in the unit, where the file has it
};

/// Of the field's stored values; empty where the file names none, or where they are to be multiplied first.
std::string enzo_unit(const EnzoParameters& parameters, const std::string& field);

struct EnzoGrid {
  std::int64_t number = 0;  ///< as in the file, 1 the first
  int level = -1;
  Vec3i cells{1};    ///< without ghost cells
  Vec3i stored{1};   ///< with ghost cells
  Vec3i ghosts{0};   ///< in front of the first cell
  Vec3d lower{0};    ///< world
  Vec3d upper{1};    ///< world
  std::string file;  ///< a plain name
};

/// Reads the parameter file. Throws Error naming file, line and fault.
EnzoParameters scan_enzo_parameters(const std::filesystem::path& path);

/// Reads all grids of a hierarchy of this many axes; levels follow from the pointers between grids.
std::vector<EnzoGrid> scan_enzo_hierarchy(const std::filesystem::path& path, int rank);

}  // namespace amrtex
