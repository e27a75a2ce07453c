// Compiled shaders on disk: whose they are decides what a first frame costs.
#pragma once

#include <filesystem>
#include <string_view>

namespace amrtex {

/// Gives the drivers of contexts that are made from now on a folder of their own for compiled shaders (MESA_SHADER_CACHE_DIR,
/// __GL_SHADER_DISK_CACHE_PATH), so that one measurement finds nothing that other programs compiled. A variable that is set
/// already stays: who sets it shares a cache on purpose.
/// Returns `cold` where Mesa's folder holds nothing yet or caching is off, else `warm`. What this process compiles itself is
/// shared by all of its points either way.
std::string_view use_shader_cache(const std::filesystem::path& folder);

}  // namespace amrtex
