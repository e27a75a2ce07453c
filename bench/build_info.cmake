# Writes OUTPUT: commit and dirty flag of the repository ROOT, and the build type
# (run as a script at every build, cmake -P). Outside a repository both are empty. The
# file is touched only when its text changes, so that nothing is compiled in vain.
set(commit "")
set(dirty "")
find_program(git git)
if(git)
  execute_process(COMMAND ${git} -C ${ROOT} rev-parse --show-toplevel
                  OUTPUT_VARIABLE top OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  file(REAL_PATH "${ROOT}" root)
  # sources unpacked inside another project's repository have no commit of their own
  if(top AND "${top}" STREQUAL "${root}")
    execute_process(COMMAND ${git} -C ${ROOT} rev-parse --verify --quiet HEAD
                    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    execute_process(COMMAND ${CMAKE_COMMAND} -E env GIT_OPTIONAL_LOCKS=0 ${git} -C ${ROOT} status --porcelain
                    OUTPUT_VARIABLE changes OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
    if(NOT failed)
      if(changes)
        set(dirty true)
      else()
        set(dirty false)
      endif()
    endif()
  endif()
endif()

set(text "// Made by bench/build_info.cmake.
#pragma once

#include <string_view>

namespace amrtex {

inline constexpr std::string_view kBuildType = \"${BUILD_TYPE}\";
inline constexpr std::string_view kBuildCommit = \"${commit}\";
inline constexpr std::string_view kBuildDirty = \"${dirty}\";

}  // namespace amrtex
")
set(before "")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} before)
endif()
if(NOT "${text}" STREQUAL "${before}")
  file(WRITE ${OUTPUT} "${text}")
endif()
