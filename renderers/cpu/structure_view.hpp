// What an encoding made of a mesh, for people to look at: its regions, and where a ray samples them.
#pragma once

#include <optional>
#include <vector>

#include "renderers/cpu/cpu_field.hpp"
#include "renderers/cpu/sampled_reference.hpp"

namespace amrtex {

/// Finest cells of the largest domain whose regions are listed: each cell is looked at.
inline constexpr std::int64_t kMostListedCells = std::int64_t{1} << 24;

/// All regions, as the encoding's own text finds them in double precision, in ascending order of z, y, x of their lower cells.
/// Throws UnsupportedError where the domain has more than kMostListedCells.
std::vector<FieldRegion> list_regions(const DomainGeometry& geometry, const EncodedField& field);

struct SamplePlace {
  Vec3d position{0};            ///< world
  std::optional<double> value;  ///< none where the mesh has none
};

/// Where the march samples one ray, in the order in which it does so, and `values` there. Nothing is skipped. `step` as in
/// RenderSettings.
std::vector<SamplePlace> list_samples(const DomainGeometry& geometry, const EncodedField& field, const FieldValues& values,
                                      const WorldRay& ray, Sampling sampling, double step);

}  // namespace amrtex
