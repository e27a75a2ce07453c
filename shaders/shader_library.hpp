// The texts under shaders/ and structures/<encoding>/, embedded at build time.
#pragma once

#include <span>
#include <string_view>

namespace amrtex {

struct ShaderFile {
  std::string_view path;  ///< "march.glsl", "page_table/page_table.glsl"
  std::string_view text;
};

std::span<const ShaderFile> shader_files();

}  // namespace amrtex
