// The data set that a run measures at the moment.
#pragma once

#include <map>
#include <string>

#include "bench/settings/experiment.hpp"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// One data set of an experiment, read, and the names that its points have in records.
class LoadedData {
 public:
  /// `experiment` must outlive it.
  LoadedData(const Experiment& experiment, std::size_t dataset);

  std::size_t dataset() const { return dataset_; }
  const DatasetSource& source() const { return experiment_.datasets[dataset_]; }
  const AmrHierarchy& mesh() const { return mesh_; }
  /// Of the drawn field, equal over formats.
  const std::string& content_hash() const { return content_hash_; }
  /// Of what is drawn (exact_data_hash); the mesh is hashed once for each choice of fields and triangles.
  const std::string& exact_hash(const Scene& scene);
  /// Of all that decides what the point measures; it names the record.
  std::string point_hash(const BuildPoint& build, const RenderPoint& render);

 private:
  const Experiment& experiment_;
  std::size_t dataset_;
  AmrHierarchy mesh_;
  std::string content_hash_;
  std::map<std::string, std::string> exact_hashes_;  ///< by fields and triangles in use
};

}  // namespace amrtex
