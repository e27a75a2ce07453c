// Pictures of the double reference, each drawn once in an output folder.
#pragma once

#include <filesystem>
#include <string>

#include "renderers/scene/picture.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/filter.hpp"

namespace amrtex {

/// The picture of the scene by the double reference of `definition`, from the cache
/// below `folder` where it was drawn before. `hash` receives the name of that file.
Picture cached_reference(const AmrHierarchy& hierarchy, FilterDefinition definition, const Scene& scene, double step,
                         const std::filesystem::path& folder, std::string& hash);

}  // namespace amrtex
