# Writes OUTPUT: commit and dirty flag of the repository ROOT, the build type, and a hash
# over the sources that decide what is drawn (run as a script at every build, cmake -P).
# Outside a repository commit and flag are empty. The file is touched only when its text
# changes, so that nothing is compiled in vain.
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

# Documents, tests and what measures or reports are left out: they change no picture.
set(patterns bench/measure/check_bound.*)
foreach(folder shaders structures renderers)
  foreach(kind cpp hpp h glsl vert frag comp in)
    list(APPEND patterns ${folder}/*.${kind})
  endforeach()
endforeach()
list(TRANSFORM patterns PREPEND "${ROOT}/")
file(GLOB_RECURSE sources RELATIVE ${ROOT} ${patterns})
list(FILTER sources EXCLUDE REGEX "_test\\.cpp$")
list(SORT sources)
set(hashes "")
foreach(source ${sources})
  file(SHA256 ${ROOT}/${source} hash)
  string(APPEND hashes "${source} ${hash}\n")
endforeach()
string(SHA256 implementation "${hashes}")
string(SUBSTRING ${implementation} 0 32 implementation)

set(text "// Made by bench/build_info.cmake.
#pragma once

#include <string_view>

namespace amrtex {

inline constexpr std::string_view kBuildType = \"${BUILD_TYPE}\";
inline constexpr std::string_view kBuildCommit = \"${commit}\";
inline constexpr std::string_view kBuildDirty = \"${dirty}\";
inline constexpr std::string_view kImplementation = \"${implementation}\";

}  // namespace amrtex
")
set(before "")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} before)
endif()
if(NOT "${text}" STREQUAL "${before}")
  file(WRITE ${OUTPUT} "${text}")
endif()
