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

/// What the picture is called in the cache: a hash of all that it depends on, the version of the reference too.
std::string reference_name(const ReferenceRequest& request);

/// The picture by the double reference, from the cache below `folder` where it was drawn before; otherwise it is drawn, and kept
/// there.
ReferencePicture cached_reference(const ReferenceRequest& request, const std::filesystem::path& folder);

/// `reference_error` and `limited_by_reference` of a record's error: null where the reference does not know its own.
void add_reference_error(Json& error, const ReferencePicture& reference, const ErrorMetrics& metrics);

}  // namespace amrtex
