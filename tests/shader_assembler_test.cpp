// The text of a shader: order, includes, line numbers, hash. No GL here; that drivers
// agree with the line numbers is in context_test.cpp.
#include "renderers/gpu/shader_assembler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "shaders/shader_library.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

ShaderKey key_of(std::string entry) {
  ShaderKey key;
  key.entry = std::move(entry);
  return key;
}

/// The message of the Error that assembling throws; empty when it throws none.
std::string error_of(const ShaderKey& key, const ShaderFiles& files) {
  try {
    assemble_shader(key, files);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

std::ptrdiff_t count(const std::string& text, std::string_view part) {
  std::ptrdiff_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

TEST(ShaderAssembler, WritesVersionExtensionsSortedDefinesThenTheEntry) {
  ShaderKey key = key_of("a.frag");
  key.extensions = {"GL_ARB_bindless_texture"};
  key.define("AMRTEX_Z", 3).define("AMRTEX_A", "vec2(1)");
  const AssembledShader shader = assemble_shader(key, {{"a.frag", "void main() {}"}});
  EXPECT_EQ(shader.text,
            "#version 450 core\n#extension GL_ARB_bindless_texture : require\n#define AMRTEX_A vec2(1)\n#define AMRTEX_Z 3\n"
            "#line 1 1\nvoid main() {}\n");
  EXPECT_EQ(shader.files, (std::vector<std::string>{"(defines)", "a.frag"}));
}

TEST(ShaderAssembler, TakesEachFileOnceAndNumbersTheLines) {
  const ShaderFiles files{{"a.frag", "#include \"b.glsl\"\n  #  include \"c.glsl\" // again\nint a;\n"},
                          {"b.glsl", "#pragma once\n#include \"c.glsl\"\nint b;\n"},
                          {"c.glsl", "int c;\n"}};
  const AssembledShader shader = assemble_shader(key_of("a.frag"), files);
  EXPECT_EQ(shader.text,
            "#version 450 core\n#line 1 1\n#line 1 2\n\n#line 1 3\nint c;\n#line 3 2\nint b;\n#line 2 1\n#line 3 1\nint a;\n");
  EXPECT_EQ(shader.files, (std::vector<std::string>{"(defines)", "a.frag", "b.glsl", "c.glsl"}));
}

TEST(ShaderAssembler, ResolvesTheEncodingsFile) {
  const ShaderFiles files{{"a.frag", "#include AMRTEX_ENCODING_FILE\n"}, {"e/e.glsl", "int e;\n"}};
  ShaderKey key = key_of("a.frag");
  EXPECT_NE(error_of(key, files).find("a.frag:1: the key names no encoding's file"), std::string::npos);
  key.use({"e/e.glsl", {{"AMRTEX_PAGE_SIZE", 16}}});
  const AssembledShader shader = assemble_shader(key, files);
  EXPECT_EQ(count(shader.text, "int e;"), 1);
  EXPECT_EQ(count(shader.text, "#define AMRTEX_PAGE_SIZE 16\n"), 1);
  EXPECT_EQ(shader.files.back(), "e/e.glsl");
}

TEST(ShaderAssembler, AMissingIncludeNamesFileLineAndChain) {
  const ShaderFiles files{{"a.frag", "\n#include \"b.glsl\"\n"}, {"b.glsl", "\n\n#include \"gone.glsl\"\n"}};
  EXPECT_EQ(error_of(key_of("a.frag"), files), "b.glsl:3, included from a.frag:2: no shader file 'gone.glsl'");
  EXPECT_EQ(error_of(key_of("x.frag"), files), "shader: no shader file 'x.frag'");
}

TEST(ShaderAssembler, ACycleIsAnError) {
  const ShaderFiles files{{"a.frag", "#include \"b.glsl\"\n"}, {"b.glsl", "#include \"a.frag\"\n"}};
  EXPECT_EQ(error_of(key_of("a.frag"), files), "b.glsl:1, included from a.frag:1: 'a.frag' includes itself");
}

TEST(ShaderAssembler, IncludesInCommentsAreNone) {
  const ShaderFiles files{{"a.frag", "// #include \"x\"\n/* open\n#include \"y\"\n*/ int a;\n"}};
  EXPECT_EQ(error_of(key_of("a.frag"), files), "");
}

TEST(ShaderAssembler, OnceAndIfDoNotMix) {
  // the second include would be dropped although the first one may have been switched off
  const ShaderFiles trap{{"a.frag", "#if X\n#include \"b.glsl\"\n#endif\n#include \"b.glsl\"\n"}, {"b.glsl", "int b;\n"}};
  EXPECT_EQ(error_of(key_of("a.frag"), trap),
            "a.frag:4: 'b.glsl' was taken at a.frag:2 already, inside an #if that may have left it out");
  const ShaderFiles fine{{"a.frag", "#include \"b.glsl\"\n#if X\n#include \"b.glsl\"\n#endif\n"}, {"b.glsl", "int b;\n"}};
  EXPECT_EQ(error_of(key_of("a.frag"), fine), "");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#ifdef X\n"}}), "a.frag: #if without #endif");
}

TEST(ShaderAssembler, OtherIncludesSayWhatIsExpected) {
  EXPECT_NE(error_of(key_of("a.frag"), {{"a.frag", "#include <cmath>\n"}}).find("a.frag:1: #include <cmath>: \"path\" or"),
            std::string::npos);
}

TEST(ShaderAssembler, TwoTextsOfOneDefineAreAnError) {
  ShaderKey key = key_of("a.frag");
  key.define("AMRTEX_A", 1).define("AMRTEX_A", 1);
  EXPECT_THROW(key.define("AMRTEX_A", 2), Error);
}

TEST(ShaderAssembler, TheHashFollowsTheText) {
  ShaderFiles files{{"a.frag", "#include \"b.glsl\"\n"}, {"b.glsl", "int b;\n"}};
  const std::string hash = assemble_shader(key_of("a.frag"), files).hash;
  EXPECT_EQ(hash.size(), 32u);
  EXPECT_EQ(assemble_shader(key_of("a.frag"), files).hash, hash);
  EXPECT_NE(assemble_shader(key_of("a.frag").define("AMRTEX_A", 1), files).hash, hash);
  files["b.glsl"] = "int c;\n";
  EXPECT_NE(assemble_shader(key_of("a.frag"), files).hash, hash);
}

TEST(ShaderAssembler, MapsTheLogsOfAllDrivers) {
  const std::vector<std::string> files{"(defines)", "a.frag", "e/e.glsl"};
  EXPECT_EQ(map_log("2:12(5): error: no\n1:3(1): warning: hm\n", files), "e/e.glsl:12(5): error: no\na.frag:3(1): warning: hm");
  EXPECT_EQ(map_log("2(12) : error C0000: no", files), "e/e.glsl:12 : error C0000: no");
  EXPECT_EQ(map_log("ERROR: 2:12: no", files), "ERROR: e/e.glsl:12: no");
  EXPECT_EQ(map_log("9:12(5): error\nerror: at 1:2", files), "9:12(5): error\nerror: at 1:2");
}

TEST(ShaderAssembler, LiteralsReadBackAsTheSameNumber) {
  for (double value : {0.1, 1.0 / 3.0, 1e300, -5e-324, 1.0, 100000.0})
    EXPECT_EQ(std::strtod(glsl_literal(value).c_str(), nullptr), value) << glsl_literal(value);
  for (float value : {0.1f, 1.0f / 3.0f, 16777216.0f, 1e-45f})
    EXPECT_EQ(std::strtof(glsl_literal(value).c_str(), nullptr), value);
  EXPECT_EQ(glsl_literal(1.0f), "1.0");
  EXPECT_EQ(glsl_literal(0.5), "0.5lf");
  EXPECT_THROW(glsl_literal(std::numeric_limits<double>::infinity()), Error);
}

TEST(ShaderAssembler, FindsTheEmbeddedLibrary) {
  const auto files = shader_files();
  EXPECT_TRUE(std::any_of(files.begin(), files.end(), [](const ShaderFile& f) { return f.path == "fullscreen.vert"; }));
  EXPECT_NE(assemble_shader(key_of("fullscreen.vert")).text.find("gl_Position"), std::string::npos);
}

}  // namespace
}  // namespace amrtex
