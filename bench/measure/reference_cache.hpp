// Reference pictures, kept on disk from one run to the next.
#pragma once

#include <filesystem>
#include <string>

#include "bench/numbers/image_error.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

struct ReferenceRequest {
  const AmrHierarchy& hierarchy;
  std::string data_hash;  ///< of what the scene is made of (exact_data_hash)
  FilterDefinition definition;
  const Scene& scene;
  ReferenceRule rule;
};

/// The picture by the double reference, from the cache below `folder` where this version of the reference drew it before by the
/// same rule. `hash` receives the name of that file.
ReferencePicture cached_reference(const ReferenceRequest& request, const std::filesystem::path& folder, std::string& hash);

/// `reference_error` and `limited_by_reference` of a record's error: null where the reference does not know its own.
void add_reference_error(Json& error, const ReferencePicture& reference, const ErrorMetrics& metrics);

}  // namespace amrtex
