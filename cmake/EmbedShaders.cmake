# Writes OUTPUT: the texts of FILES as C++ string literals. Shaders are keyed by their path below shaders/, an encoding's by that
# below the folder that its own lies in (run as a script, cmake -P).
set(text "// Made by cmake/EmbedShaders.cmake.\n#include \"shaders/shader_library.hpp\"\n\nnamespace amrtex {\n\n")
string(APPEND text "std::span<const ShaderFile> shader_files() {\n  static constexpr ShaderFile files[] = {\n")
foreach(file IN LISTS FILES)
  file(RELATIVE_PATH path ${ROOT} ${file})
  string(REGEX REPLACE "^[^/]+/(.*)$" "\\1" path ${path})
  file(READ ${file} contents)
  # string literals of at most 64 KiB are portable; ours are far below
  string(APPEND text "    {\"${path}\", R\"glsl_text(${contents})glsl_text\"},\n")
endforeach()
string(APPEND text "  };\n  return files;\n}\n\n}  // namespace amrtex\n")
file(WRITE ${OUTPUT} "${text}")
