// The data that an experiment names and a scene draws: the mesh, its fields in use, and a name for both.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench/settings/experiment.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// The mesh of one data set of an experiment, with the field that is wanted first, and after it
/// those that some render point colours surfaces by.
AmrHierarchy load_dataset(const Experiment& experiment, const DatasetSource& source);

/// The field that a generated data set samples; null for a file.
std::unique_ptr<AnalyticField> analytic_field(const DatasetSource& source);

/// Fields beside the drawn one that the scene fetches. Throws UsageError naming the fields there are.
std::vector<int> more_fields(const AmrHierarchy& hierarchy, const Scene& scene);

/// Hex digits that tell apart what a scene of this mesh is made of: every field in use to the bit, the mesh with its place and
/// spacing, and the corners of triangles, whatever their files are called.
std::string exact_data_hash(const AmrHierarchy& hierarchy, const Scene& scene);

/// What is legal about a scene of field 0 of this mesh, and yet likely not meant.
std::vector<std::string> scene_warnings(const AmrHierarchy& hierarchy, const Scene& scene);

}  // namespace amrtex
