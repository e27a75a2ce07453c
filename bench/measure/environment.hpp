// What a record says about the machine and the program, as far as no GL is needed.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Of the program itself, captured when it was built.
struct BuildInfo {
  std::string build_type;             ///< of CMake; empty where none was chosen
  std::string compiler;               ///< name and version
  std::optional<std::string> commit;  ///< absent outside a repository, and before its first commit
  std::optional<bool> dirty;          ///< files differed from the commit; absent outside a repository
};
BuildInfo build_info();

/// Hex digits of a hash over the sources of shaders, structures and renderers, tests aside, and of the default check: what
/// decides a picture, its bytes and its verdict. Taken when the program was built.
std::string implementation_hash();

/// Name of the processor; absent where the system does not say.
std::optional<std::string> cpu_name();

/// The variables that choose or tune a GL driver, by name: MESA_*, LP_*, GALLIUM_*, LIBGL_*, EGL_*, VK_*, ZINK_*; without the
/// folder of compiled shaders, which each run has for itself.
Json driver_variables();

/// Now, UTC, ISO 8601 to the second.
std::string utc_date();

/// The `context` part of a record; renderer, device, gl_version, extensions_missing,
/// shader_hash and shader_cache are null, for who has a context.
Json context_json();

}  // namespace amrtex
