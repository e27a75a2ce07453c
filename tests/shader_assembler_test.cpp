// The text of a shader: order, includes, line numbers, hash. No GL here; that drivers
// agree with the line numbers is in context_test.cpp.
#include "renderers/bindings/shader_assembler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "renderers/bindings/shader_macros.hpp"
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

TEST(ShaderAssembler, TakesAFileWhereTheDefinesLeaveItIn) {
  const ShaderFiles files{{"a.frag", "#if X\n#include \"b.glsl\"\n#endif\n#include \"b.glsl\"\n"}, {"b.glsl", "int b;\n"}};
  for (const int x : {0, 1}) {
    const AssembledShader shader = assemble_shader(key_of("a.frag").define("X", x), files);
    EXPECT_EQ(count(shader.text, "int b;"), 1);
    EXPECT_EQ(shader.text.find("int b;") < shader.text.find("#endif"), x == 1);
  }
  const ShaderFiles gone{{"a.frag", "#if !X\n#include \"gone.glsl\"\n#elif X > 1\n#include \"two.glsl\"\n#else\n#endif\n"}};
  EXPECT_EQ(error_of(key_of("a.frag").define("X", 1), gone), "");
  EXPECT_EQ(error_of(key_of("a.frag").define("X", 2), gone), "a.frag:4: no shader file 'two.glsl'");
  EXPECT_EQ(error_of(key_of("a.frag").define("X", 0), gone), "a.frag:2: no shader file 'gone.glsl'");
}

TEST(ShaderAssembler, AnIfWithoutItsPartnersIsAnError) {
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#ifdef X\n"}}), "a.frag: #if without #endif");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "\n#endif\n"}}), "a.frag:2: #endif without #if");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#else\n"}}), "a.frag:1: #else without #if");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#elif 1\n"}}), "a.frag:1: #elif without #if");
}

TEST(ShaderAssembler, AMissingDefineNamesFileNameAndMeaning) {
  const ShaderFiles files{
      {"a.frag", "#include \"b.glsl\"\n"},
      {"b.glsl", "DEFINE_INT(AMRTEX_A)\n#if AMRTEX_A > 0\nDEFINE_INT(AMRTEX_B)  // 1 where b, else 0\n#endif\n"}};
  EXPECT_EQ(error_of(key_of("a.frag"), files), "b.glsl:1, included from a.frag:1: AMRTEX_A is not defined");
  EXPECT_EQ(error_of(key_of("a.frag").define("AMRTEX_A", 1), files),
            "b.glsl:3, included from a.frag:1: AMRTEX_B is not defined: 1 where b, else 0");
  EXPECT_EQ(error_of(key_of("a.frag").define("AMRTEX_A", 1).define("AMRTEX_B", 0), files), "");
  EXPECT_EQ(error_of(key_of("a.frag").define("AMRTEX_A", 0), files), "") << "what an #if leaves out needs nothing";
}

TEST(ShaderAssembler, ANameInAnIfThatIsNotDefinedIsAnErrorAndNever0) {
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "\n#if AMRTEX_X\n#endif\n"}}),
            "a.frag:2: #if AMRTEX_X: AMRTEX_X is not defined");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#if 0\n#elif 1 || AMRTEX_X\n#endif\n"}}),
            "a.frag:2: #elif 1 || AMRTEX_X: AMRTEX_X is not defined");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#if 0\n#if AMRTEX_X\n#endif\n#elif 1\n#elif AMRTEX_X\n#endif\n"}}), "");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#ifndef AMRTEX_X\n#error AMRTEX_X is missing\n#endif\n"}}),
            "a.frag:2: AMRTEX_X is missing");
}

TEST(ShaderAssembler, MacrosOfTheFilesCountInAnIf) {
  const std::string text =
      "#define A 2\n#define BOTH (A == 2 && \\\n  defined(KEY))\n#if BOTH\n#undef A\n#endif\n#ifdef A\n#error A is "
      "left\n#endif\n";
  EXPECT_EQ(error_of(key_of("a.frag").define("KEY", 0), {{"a.frag", text}}), "");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", text}}), "a.frag:8: A is left");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#define F(x) x\n#if F(1)\n#endif\n"}}),
            "a.frag:2: #if F(1): F takes arguments, which an #if cannot give it");
  EXPECT_EQ(error_of(key_of("a.frag"), {{"a.frag", "#define A (A)\n#if A\n#endif\n"}}),
            "a.frag:2: #if A: A is defined through itself");
}

TEST(ShaderMacros, EvaluatesExpressionsAsCDoes) {
  ShaderMacros macros;
  macros.define("TWO", "2");
  macros.define("SUM 1 + TWO");
  const std::vector<std::pair<const char*, int>> cases{
      {"1 + 2 * 3", 7},        {"(1 + 2) * 3", 9},    {"10 - 4 - 3", 3},       {"7 / 2 + 7 % 2", 4},
      {"1 << 4 >> 1", 8},      {"!0 && 3", 1},        {"0 || !5", 0},          {"1 < 2 == 2 >= 2", 1},
      {"-3 < 0 && +3 > 0", 1}, {"0x10u == 16", 1},    {"SUM * TWO", 5},        {"2 * SUM", 4},
      {"defined TWO", 1},      {"defined(THREE)", 0}, {"1 != 1 || 2 <= 1", 0}, {"TWO*3-defined(TWO)", 5}};
  for (const auto& [expression, value] : cases) EXPECT_EQ(macros.evaluate(expression), value) << expression;
}

TEST(ShaderMacros, RefusesWhatIsNoExpression) {
  const ShaderMacros macros;
  for (const char* expression : {"", "1 +", "(1", "1)", "1 2", "real(1)", "1 / 0", "1 % 0", "1 << 40", "0.5", "5000000000",
                                 "defined", "2147483647 + 1", "1 ? 2", "defined("})
    EXPECT_THROW(macros.evaluate(expression), Error) << expression;
}

TEST(ShaderAssembler, TellsWhatTheHostHasToProvide) {
  const ShaderFiles files{
      {"a.frag",
       "DEFINE_INT(N)\nUNIFORM(real, u_a)  // a (b)\n#if N > 2\nUNIFORM(int, u_out)\n#endif\n"
       "UNIFORM_ARRAY(vec2r, u_array, 2 * N, 16)\nVALUE_TEXTURES(tex_v, N, 4)\n  BUFFER(uint, words, words_block)\n"
       "INTEGER_TEXTURE(tex_i)\nVALUE_TEXTURE(tex_w)\nVALUE_TEXTURE_SET(tex_s, handles, handles_block)\n"
       "// UNIFORM(int, u_comment)\n"}};
  const AssembledShader shader = assemble_shader(key_of("a.frag").define("N", 2), files);
  std::vector<std::string> uniforms;
  for (const ShaderInput& i : shader.uniforms) uniforms.push_back(i.name + " " + std::to_string(i.count) + " " + i.place);
  EXPECT_EQ(uniforms, (std::vector<std::string>{"u_a 1 a.frag:2", "u_array 4 a.frag:6"}));
  std::vector<std::string> resources;
  for (const ShaderInput& i : shader.resources) resources.push_back(i.name);
  EXPECT_EQ(resources, (std::vector<std::string>{"tex_v", "tex_v[1]", "words", "tex_i", "tex_w", "tex_s"}));
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
