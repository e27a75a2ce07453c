// From a key to the text of one shader: version, extensions, defines, and files with their includes resolved; and what that
// text needs. Pure functions; nothing here knows GL.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Everything that decides the text of a shader.
struct ShaderKey {
  std::string entry;                           ///< file with main()
  std::string encoding_file;                   ///< what `#include AMRTEX_ENCODING_FILE` stands for
  std::vector<std::string> extensions;         ///< required
  std::map<std::string, std::string> defines;  ///< name -> text, so always in the same order

  /// Throws Error when the name has another text already.
  ShaderKey& define(std::string_view name, std::string_view text);
  ShaderKey& define(std::string_view name, int value);
  /// The encoding's file, defines and extensions.
  ShaderKey& use(const ShaderPart& part);
};

/// A uniform, texture or buffer that a text declares with the macros of portable_glsl.h.
struct ShaderInput {
  std::string name;
  std::string place;  ///< "march.glsl:12"
  int count = 1;      ///< elements of an array of uniforms
};

struct AssembledShader {
  std::string text;
  std::vector<std::string> files;      ///< index = second number of `#line`; 0 is the part before the entry file
  std::string hash;                    ///< of the text, 32 hexadecimal digits
  std::vector<ShaderInput> uniforms;   ///< what the host has to set, ...
  std::vector<ShaderInput> resources;  ///< ... and to bind
};

/// path -> text
using ShaderFiles = std::map<std::string, std::string, std::less<>>;

/// Includes are resolved in the embedded library; each file is taken once, and not where an #if leaves it out. Throws Error
/// naming file, line and chain of includes for a missing file, a cycle, an active #error, a define of DEFINE_INT that the key
/// does not have, and a name in an #if that is not defined.
AssembledShader assemble_shader(const ShaderKey& key);
AssembledShader assemble_shader(const ShaderKey& key, const ShaderFiles& files);

/// A driver's log with its "file number:line" replaced by names, in the spellings of
/// Mesa and Intel (`0:12(5): `), NVIDIA (`0(12) : `) and AMD (`ERROR: 0:12: `).
std::string map_log(std::string_view log, const std::vector<std::string>& files);

/// 32 hexadecimal digits.
std::string hash_text(std::string_view text);

/// Literals that read back as the same number; throw Error unless finite.
std::string glsl_literal(float value);
std::string glsl_literal(double value);  ///< with the suffix `lf`

}  // namespace amrtex
