// Patches in parts that are small enough for arrays over one.
#pragma once

#include <span>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Of the patches of a level.
struct PatchPart {
  std::size_t patch;
  Box box;
};
inline std::vector<PatchPart> patch_parts(std::span<const Patch> patches) {
  constexpr int kEdge = 32;
  std::vector<PatchPart> parts;
  for (std::size_t k = 0; k < patches.size(); ++k)
    for_each_cell(patches[k].box.coarsened(kEdge), [&](const Vec3i& i) {
      parts.push_back({k, intersection({i * kEdge, (i + Vec3i(1)) * kEdge}, patches[k].box)});
    });
  return parts;
}

}  // namespace amrtex
