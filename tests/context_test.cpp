// Contexts, programs and uploads on every kind of context that this machine has.
#include "renderers/context/context.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fmt/format.h>

#include <csignal>
#include <cstdlib>
#include <cstring>
#include <numeric>

#include "renderers/context/context_probe.hpp"
#include "renderers/gpu/draw_target.hpp"
#include "renderers/gpu/gpu_field.hpp"
#include "renderers/gpu/gpu_timer.hpp"
#include "renderers/gpu/program.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {

/// In lists of tests.
static void PrintTo(ContextKind kind, std::ostream* out) { *out << context_kind_name(kind); }

namespace {

using namespace std::chrono_literals;

AssembledShader assemble(std::string entry, const ShaderFiles& files) {
  ShaderKey key;
  key.entry = std::move(entry);
  return assemble_shader(key, files);
}

AssembledShader fullscreen_vertex() {
  ShaderKey key;
  key.entry = "fullscreen.vert";
  return assemble_shader(key);
}

Program picture_program(Context& context, const std::string& fragment) {
  return Program(context, fullscreen_vertex(), assemble("test.frag", {{"test.frag", fragment}}));
}

template <class F>
std::string error_of(F&& f) {
  try {
    f();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

void expect_contains(const std::string& text, std::string_view part) {
  EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in:\n" << text;
}

HostTexture host_texture(std::string name, HostTexture::Kind kind, TexelFormat format, Vec3i size) {
  HostTexture t;
  t.name = std::move(name);
  t.kind = kind;
  t.format = format;
  t.size = size;
  t.data.resize(static_cast<std::size_t>(t.bytes()));
  // below 0x3c: a byte that starts no NaN, whose bits a driver may change
  for (std::size_t i = 0; i < t.data.size(); ++i) t.data[i] = static_cast<std::byte>((i * 7 + 1) % 0x3c);
  t.roles.payload = t.bytes();
  return t;
}

HostTexture host_3d(std::string name, TexelFormat format, Vec3i size) {
  return host_texture(std::move(name), HostTexture::Kind::texture_3d, format, size);
}

HostTexture host_buffer(std::string name, TexelFormat format, int elements) {
  return host_texture(std::move(name), HostTexture::Kind::buffer, format, {elements, 1, 1});
}

EncodedField field_of(std::vector<HostTexture> textures) {
  EncodedField field;
  field.encoding = "test";
  field.textures = std::move(textures);
  return field;
}

// Before any test that starts a driver in this process: a fork copies none of its threads.
TEST(ContextA0Probe, ReportsResultErrorCrashAndHang) {
  const ChildResult good = run_in_child([] { return std::string(100000, 'x'); }, 20s);
  EXPECT_TRUE(good.ok);
  EXPECT_EQ(good.text.size(), 100000u);
  const ChildResult error = run_in_child([]() -> std::string { throw Error("no driver"); }, 20s);
  EXPECT_FALSE(error.ok);
  EXPECT_EQ(error.reason, "no driver");
  const ChildResult crash = run_in_child([]() -> std::string { return std::to_string(::kill(::getpid(), SIGKILL)); }, 20s);
  EXPECT_FALSE(crash.ok);
  expect_contains(crash.reason, "crashed: signal 9");
  const ChildResult hang = run_in_child([] { return std::string(1, static_cast<char>(::sleep(60))); }, 200ms);
  EXPECT_TRUE(hang.timed_out);
  EXPECT_LT(hang.seconds, 10.0);
}

TEST(ContextA0Probe, DescribesTheContext) {
  const ContextProbe probe = probe_context(ContextKind::egl, 60s);
  ASSERT_TRUE(probe.ok) << probe.reason;
  EXPECT_EQ(probe.info.kind, "egl");
  EXPECT_FALSE(probe.info.extensions.empty());
  EXPECT_EQ(to_json(context_info_from_json(to_json(probe.info))), to_json(probe.info));
}

/// Why a context cannot be had where variables say what is opened; in a child, since a driver reads them once.
std::string refusal(const ContextChoice& choice, const std::vector<std::pair<const char*, const char*>>& variables) {
  const ChildResult child = run_in_child(
      [&] {
        for (const auto& [name, value] : variables) ::setenv(name, value, 1);
        return make_context(choice)->info().version;
      },
      60s);
  EXPECT_FALSE(child.ok) << choice.name() << ": " << child.text;
  EXPECT_LE(child.reason.size(), 400u) << child.reason;
  EXPECT_EQ(child.reason.find('\n'), std::string::npos) << child.reason;
  return child.reason;
}

TEST(ContextA0Probe, WhereNoDriverIsTheLineSaysWhatIsThereAndWhatIsNeeded) {
  const std::string no_egl = refusal(ContextKind::egl, {{"AMRTEX_EGL", "/nonexistent/libEGL.so.1"}});
  for (const char* part : {"context egl: no EGL", "/nonexistent/libEGL.so.1", "needed", "AMRTEX_EGL"}) expect_contains(no_egl, part);
  const std::string no_osmesa = refusal(ContextKind::osmesa, {{"AMRTEX_OSMESA", "/nonexistent/libOSMesa.so"}});
  for (const char* part : {"no OSMesa", "/nonexistent/libOSMesa.so", "libosmesa6", "AMRTEX_OSMESA"}) expect_contains(no_osmesa, part);
  expect_contains(refusal(ContextKind::egl, {{"AMRTEX_EGL", "libc.so.6"}}), "libc.so.6 has no eglGetError");
  expect_contains(refusal(ContextKind::osmesa, {{"AMRTEX_OSMESA", "libc.so.6"}}), "libc.so.6 has no function OSMesa");
}

TEST(ContextA0Probe, AnEglWithoutOpenGlIsTold) {
  const std::string reason = refusal(ContextKind::egl, {{"AMRTEX_EGL", AMRTEX_EGL_WITHOUT_OPENGL}});
  for (const char* part : {"this EGL has no OpenGL, it has OpenGL_ES", "needed: OpenGL 4.5 core"}) expect_contains(reason, part);
}

TEST(ContextA0Probe, ADriverThatIsTooOldIsTold) {
  const ContextProbe usual = probe_context(ContextKind::egl, 60s);
  if (!usual.ok || usual.info.version.find("Mesa") == std::string::npos) GTEST_SKIP() << "only Mesa can be told to be old";
  const std::string reason = refusal(ContextKind::egl, {{"MESA_GL_VERSION_OVERRIDE", "3.3"}});
  for (const char* part : {"3.3", "needed", "4.5"}) expect_contains(reason, part);
}

TEST(ContextA0Probe, DevicesAreListedAndEachIsChosenByItsNumber) {
  std::string reason;
  const std::vector<ListedDevice> devices = probe_devices(60s, reason);
  if (devices.empty()) GTEST_SKIP() << reason;
  int last = 0;
  for (const ListedDevice& device : devices) {
    EXPECT_EQ(device.index, last++);
    EXPECT_EQ(device.text.find(std::to_string(device.index)), 0u) << device.text;
    const ContextProbe probe = probe_context({ContextKind::egl_device, device.index}, 60s);
    if (probe.ok)
      EXPECT_EQ(probe.info.device, device.index);
    else
      EXPECT_FALSE(probe.reason.empty());
  }
  const std::string absent = refusal({ContextKind::egl_device, last}, {});
  expect_contains(absent, fmt::format("context egl_device:{0}: no device {0}; there", last));
  for (const ListedDevice& device : devices) expect_contains(absent, device.text);
}

TEST(ContextKinds, AnUnknownNameNamesTheKnownOnes) {
  EXPECT_EQ(parse_context("osmesa").kind, ContextKind::osmesa);
  EXPECT_EQ(parse_context("egl_device:2").device, 2);
  EXPECT_EQ(parse_context("egl_device:2").name(), "egl_device:2");
  for (const char* wrong : {"glx", "egl_device:", "egl_device:-1", "egl_device:1x", "egl_device:99999999999", "egl:0"}) {
    EXPECT_THROW(parse_context(wrong), UsageError) << wrong;
    expect_contains(error_of([&] { parse_context(wrong); }), "egl, egl_device, osmesa");
  }
}

class ContextTest : public testing::TestWithParam<ContextKind> {
 protected:
  void SetUp() override {
    try {
      context_ = make_context(GetParam());
    } catch (const Error& e) {
      if (GetParam() != ContextKind::egl_device) throw;
      expect_contains(e.what(), "context egl_device: no hardware device found");
      expect_contains(e.what(), "accepted: egl, egl_device, osmesa");
      GTEST_SKIP() << e.what();
    }
  }

  std::unique_ptr<Context> context_;
};

TEST_P(ContextTest, IsCore45AndKnowsItsLimits) {
  const GlContextInfo& info = context_->info();
  EXPECT_EQ(info.kind, context_kind_name(GetParam()));
  EXPECT_GE(info.version.substr(0, 3), "4.5");
  EXPECT_FALSE(info.renderer.empty());
  EXPECT_GE(info.max_3d_texture_size, 2048);
  EXPECT_GE(info.max_texture_bytes, 1 << 28);
  EXPECT_GE(info.max_buffer_bytes, 1 << 24);
  EXPECT_GE(info.max_texture_units, 16);
  EXPECT_GE(info.max_viewport_width, 4096);
  EXPECT_EQ(info.bindless_texture, info.has_extension("GL_ARB_bindless_texture"));
}

TEST_P(ContextTest, AFragmentShaderFillsAFloatPicture) {
  Program program = picture_program(
      *context_,
      "layout(location = 0) out vec4 color;\n"
      "layout(location = 1) out uvec4 counted;\n"
      "void main() { color = vec4(gl_FragCoord.xy, -1e-30, 1e30); counted = uvec4(gl_FragCoord.yx, 7u, ~0u); }\n");
  DrawTarget target(*context_, 5, 3, true);
  target.clear();
  target.draw(program);
  const Picture picture = target.read_picture();
  const std::vector<glm::uvec4> counters = target.read_counters();
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 5; ++x) {
      const int gl_row = 2 - y;
      const double* p = picture.pixel(x, y);
      EXPECT_EQ(p[0], x + 0.5);
      EXPECT_EQ(p[1], gl_row + 0.5);
      EXPECT_EQ(p[2], static_cast<double>(-1e-30f));
      EXPECT_EQ(p[3], static_cast<double>(1e30f));
      EXPECT_EQ(counters[static_cast<std::size_t>(y * 5 + x)], glm::uvec4(gl_row, x, 7, ~0u));
    }
  EXPECT_EQ(target.read_picture(1).pixel(4, 0)[0], 4.5);
  EXPECT_THROW(DrawTarget(*context_, context_->info().max_viewport_width + 1, 1), UnsupportedError);
}

TEST_P(ContextTest, AGlErrorIsFatalAtTheNextCheck) {
  EXPECT_NO_THROW(context_->check("nothing"));
  context_->gl().Enable(0x1234);
  const std::string message = error_of([&] { context_->check("testing"); });
  expect_contains(message, "testing");
  expect_contains(message, "GL_INVALID_ENUM");
  EXPECT_NO_THROW(context_->check("afterwards"));
}

TEST_P(ContextTest, WhereGlHasNoMemoryLeftItIsTheBudgetAndTheContextGoesOn) {
  const GlBuffer buffer = make_buffer(*context_);
  const GLsizeiptr petabyte = GLsizeiptr{1} << 50;
  context_->gl().NamedBufferStorage(buffer.id(), petabyte, nullptr, 0);
  EXPECT_THROW(context_->check("allocating"), BudgetError);
  const GlBuffer small = make_buffer(*context_);
  context_->gl().NamedBufferStorage(small.id(), 64, nullptr, 0);
  EXPECT_NO_THROW(context_->check("allocating less"));
}

TEST_P(ContextTest, WithoutDebugOutputErrorsAreFatalToo) {
  const auto quiet = make_context(GetParam(), {.debug = false});
  quiet->gl().Enable(0x1234);
  EXPECT_THROW(quiet->check("testing"), Error);
}

TEST_P(ContextTest, TwoContextsAreAliveAndSwitched) {
  const auto other = make_context(GetParam());
  std::vector<EncodedField> fields;
  for (int i = 0; i < 2; ++i) {
    fields.push_back(field_of({host_3d("tex_values", TexelFormat::r32f, {1, 1, 1})}));
    *fields.back().textures[0].as<float>() = static_cast<float>(10 + i);
  }
  const std::string text =
      "uniform highp sampler3D tex_values;\nout vec4 color;\nvoid main() { color = texelFetch(tex_values, ivec3(0), 0); }\n";
  Program a = picture_program(*context_, text);
  Program b = picture_program(*other, text);
  const GpuField on_a(fields[0], *context_);
  DrawTarget target_b(*other, 1, 1);
  {
    const GpuField on_b(fields[1], *other);
    DrawTarget target_a(*context_, 1, 1);
    on_a.bind(a);
    on_b.bind(b);
    target_a.draw(a);
    target_b.draw(b);
    EXPECT_EQ(target_a.read_picture().values[0], 10);
    EXPECT_EQ(target_b.read_picture().values[0], 11);
    other->make_current();
  }  // on_b dies; an object of the same number lives on in the first context
  context_->make_current();
  DrawTarget target_a(*context_, 1, 1);
  on_a.bind(a);
  target_a.draw(a);
  EXPECT_EQ(target_a.read_picture().values[0], 10);
}

TEST(Contexts, EglAndOsmesaLiveInOneProcess) {
  const auto egl = make_context(ContextKind::egl);
  const auto osmesa = make_context(ContextKind::osmesa);
  for (int round = 0; round < 2; ++round)
    for (Context* context : {egl.get(), osmesa.get()}) {
      Program program =
          picture_program(*context, "uniform float u_value;\nout vec4 color;\nvoid main() { color = vec4(u_value); }\n");
      const float value = context == egl.get() ? 2.0f : 3.0f;
      program.set("u_value", value);
      DrawTarget target(*context, 2, 2);
      target.draw(program);
      EXPECT_EQ(target.read_picture().values[0], value);
    }
}

TEST_P(ContextTest, ASyntaxErrorNamesFileAndLine) {
  const ShaderFiles files{{"test.frag", "#include \"part.glsl\"\nvoid main() {}\n"}, {"part.glsl", "int a;\n\nint b = ;\n"}};
  const std::string message = error_of([&] { Program(*context_, fullscreen_vertex(), assemble("test.frag", files)); });
  expect_contains(message, "test.frag does not compile");
  expect_contains(message, "part.glsl:3");
  // the lines after an include are counted on
  const ShaderFiles later{{"test.frag", "#include \"part.glsl\"\nvoid main() { no_such_thing(); }\n"},
                          {"part.glsl", "int a;\n\n\n"}};
  expect_contains(error_of([&] { Program(*context_, fullscreen_vertex(), assemble("test.frag", later)); }), "test.frag:2");
  EXPECT_NO_THROW(context_->check("the compiler's messages are in the exception"));
}

TEST_P(ContextTest, AProgramThatDoesNotLinkIsAnError) {
  const std::string message =
      error_of([&] { picture_program(*context_, "in vec4 nobody_writes;\nout vec4 c;\nvoid main() { c = nobody_writes; }\n"); });
  expect_contains(message, "fullscreen.vert + test.frag: does not link");
}

TEST_P(ContextTest, UniformsOfEveryTypeArrive) {
  const std::string text =
      "layout(local_size_x = 1) in;\n"
      "uniform int u_i; uniform uint u_u; uniform float u_f; uniform double u_d; uniform bool u_b;\n"
      "uniform vec2 u_v2; uniform vec3 u_v3; uniform vec4 u_v4; uniform ivec2 u_i2; uniform ivec3 u_i3; uniform ivec4 u_i4;\n"
      "uniform dvec2 u_d2; uniform dvec3 u_d3; uniform dvec4 u_d4; uniform int u_ia[3]; uniform float u_fa[3]; uniform vec2 "
      "u_va[2];\n"
      "layout(std430) buffer sums_block { double sums[]; };\n"
      "void main() {\n"
      "  sums[0] = double(u_i) + double(u_u) + double(u_f) + u_d + (u_b ? 1.0lf : 0.0lf);\n"
      "  sums[1] = double(u_v2.y + u_v3.z + u_v4.w) + double(u_i2.y + u_i3.z + u_i4.w);\n"
      "  sums[2] = u_d2.y + u_d3.z + u_d4.w;\n"
      "  sums[3] = double(u_ia[0] + u_ia[2]) + double(u_fa[1]) + double(u_va[1].y);\n"
      "}\n";
  Program program(*context_, assemble("test.comp", {{"test.comp", text}}));
  program.set("u_i", -1);
  program.set("u_u", 4000000000u);
  program.set("u_f", 0.5f);
  program.set("u_d", 1e-12);
  program.set("u_b", true);
  program.set("u_v2", glm::vec2(0, 1));
  program.set("u_v3", glm::vec3(0, 0, 2));
  program.set("u_v4", glm::vec4(0, 0, 0, 4));
  program.set("u_i2", glm::ivec2(0, 8));
  program.set("u_i3", glm::ivec3(0, 0, 16));
  program.set("u_i4", glm::ivec4(0, 0, 0, 32));
  program.set("u_d2", glm::dvec2(0, 0.1));
  program.set("u_d3", glm::dvec3(0, 0, 0.2));
  program.set("u_d4", glm::dvec4(0, 0, 0, 0.4));
  program.set("u_ia", std::vector<int>{1, 2, 4});
  program.set(UniformValue{"u_fa", std::vector<double>{0, 0.25, 0}});
  program.set(UniformValue{"u_va", std::vector<double>{0, 0, 0, 100}});
  GlBuffer sums = make_buffer(*context_);
  context_->gl().NamedBufferStorage(sums.id(), 4 * sizeof(double), nullptr, 0);
  EXPECT_EQ(program.unbound(), std::vector<std::string>{"sums_block"});
  EXPECT_TRUE(program.bind_buffer("sums_block", sums.id()));
  program.use();
  context_->gl().DispatchCompute(1, 1, 1);
  context_->gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  std::array<double, 4> got{};
  context_->gl().GetNamedBufferSubData(sums.id(), 0, sizeof got, got.data());
  context_->check("uniforms");
  EXPECT_EQ(got[0], -1.0 + 4000000000.0 + 0.5 + 1e-12 + 1.0);
  EXPECT_EQ(got[1], 63);
  EXPECT_EQ(got[2], 0.1 + 0.2 + 0.4);
  EXPECT_EQ(got[3], 105.25);
}

TEST_P(ContextTest, WrongUniformsAreNamed) {
  Program program = picture_program(
      *context_,
      "uniform float u_f; uniform int u_a[2];\nout vec4 c;\nvoid main() { c = vec4(u_f + float(u_a[0] + u_a[1])); }\n");
  expect_contains(error_of([&] { program.set("u_none", 1); }), "test.frag: no uniform 'u_none' is active");
  EXPECT_FALSE(program.set_optional("u_none", 1));
  EXPECT_TRUE(program.set_optional("u_f", 1.0f));
  expect_contains(error_of([&] { program.set("u_f", 1); }), "uniform 'u_f' is float, not int");
  expect_contains(error_of([&] {
                    program.set(UniformValue{"u_f", std::vector<int>{1}});
                  }),
                  "uniform 'u_f' is float, integers given");
  expect_contains(error_of([&] { program.set("u_f", std::vector<float>{1, 2}); }), "uniform 'u_f' is float, 2 numbers given");
  expect_contains(error_of([&] { program.set("u_a", std::vector<int>{}); }), "uniform 'u_a' is int[], 0 numbers given");
  EXPECT_NO_THROW(context_->check("no GL error came of it"));
}

TEST_P(ContextTest, EveryFormatIsUploadedByteForByte) {
  struct Case {
    TexelFormat format;
    GLenum read_format, read_type;
  };
  const std::array<Case, 9> cases{{{TexelFormat::r8, GL_RED, GL_UNSIGNED_BYTE},
                                   {TexelFormat::r16, GL_RED, GL_UNSIGNED_SHORT},
                                   {TexelFormat::r16f, GL_RED, GL_HALF_FLOAT},
                                   {TexelFormat::r32f, GL_RED, GL_FLOAT},
                                   {TexelFormat::rg32f, GL_RG, GL_FLOAT},
                                   {TexelFormat::rgba32f, GL_RGBA, GL_FLOAT},
                                   {TexelFormat::r32ui, GL_RED_INTEGER, GL_UNSIGNED_INT},
                                   {TexelFormat::rg32ui, GL_RG_INTEGER, GL_UNSIGNED_INT},
                                   {TexelFormat::rgba32ui, GL_RGBA_INTEGER, GL_UNSIGNED_INT}}};
  for (const Case& c : cases) {
    SCOPED_TRACE(format_name(c.format));
    // an odd width shows a row alignment that was left at 4
    const EncodedField field = field_of({host_3d("tex_a", c.format, {5, 3, 2}), host_buffer("buf_a", c.format, 24)});
    const GpuField gpu(field, *context_);
    EXPECT_EQ(gpu.bytes(), field.memory().total());
    EXPECT_EQ(gpu.bytes_reported(), field.memory().total());
    Program program =
        picture_program(*context_,
                        "uniform highp sampler3D tex_a;\nlayout(std430) readonly buffer buf_a_block { uint buf_a[]; };\n"
                        "out vec4 c;\nvoid main() { c = texelFetch(tex_a, ivec3(0), 0) + vec4(buf_a[0]); }\n");
    gpu.bind(program);
    const GladGLContext& gl = context_->gl();
    GLint texture = 0, buffer = 0;
    gl.GetIntegerv(GL_TEXTURE_BINDING_3D, &texture);
    gl.GetIntegeri_v(GL_SHADER_STORAGE_BUFFER_BINDING, 0, &buffer);
    std::vector<std::byte> got(field.textures[0].data.size());
    gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl.GetTextureImage(static_cast<GLuint>(texture), 0, c.read_format, c.read_type, static_cast<GLsizei>(got.size()), got.data());
    EXPECT_EQ(got, field.textures[0].data);
    got.resize(field.textures[1].data.size());
    gl.GetNamedBufferSubData(static_cast<GLuint>(buffer), 0, static_cast<GLsizeiptr>(got.size()), got.data());
    EXPECT_EQ(got, field.textures[1].data);
    context_->check("reading back");
  }
}

TEST_P(ContextTest, TheShaderSeesFilterUniformsAndBuffers) {
  EncodedField field =
      field_of({host_3d("tex_linear", TexelFormat::r32f, {2, 1, 1}), host_3d("tex_nearest", TexelFormat::r32ui, {2, 1, 1}),
                host_buffer("nodes", TexelFormat::rg32ui, 3)});
  field.textures[0].hardware_linear = true;
  field.textures[0].as<float>()[0] = 1;
  field.textures[0].as<float>()[1] = 3;
  field.textures[1].as<std::uint32_t>()[1] = 0xfedcba98u;
  for (std::uint32_t i = 0; i < 6; ++i) field.textures[2].as<std::uint32_t>()[i] = 100 + i;
  field.integer_uniforms = {{"u_table_size", {1, 2, 3}}, {"u_optimised_away", {0, 0, 0}}};
  const GpuField gpu(field, *context_);
  Program program = picture_program(
      *context_,
      "uniform highp sampler3D tex_linear;\nuniform highp usampler3D tex_nearest;\nuniform ivec3 u_table_size;\n"
      "layout(std430) readonly buffer nodes_block { uvec2 nodes[]; };\nout vec4 c;\n"
      "void main() { c = vec4(texture(tex_linear, vec3(0.5)).x, texelFetch(tex_nearest, ivec3(1, 0, 0), 0).x == 0xfedcba98u ? "
      "1.0 : 0.0,\n"
      "                       float(nodes[2].y), float(u_table_size.x * 100 + u_table_size.y * 10 + u_table_size.z)); }\n");
  gpu.bind(program);
  DrawTarget target(*context_, 1, 1);
  target.draw(program);
  EXPECT_EQ(target.read_picture().values, (std::vector<double>{2, 1, 105, 123}));
  EXPECT_TRUE(gpu.unused(program).empty());
}

TEST_P(ContextTest, WhatNobodyProvidesIsNamed) {
  const EncodedField field =
      field_of({host_3d("tex_a", TexelFormat::r32f, {1, 1, 1}), host_buffer("nodes", TexelFormat::r32ui, 4)});
  const GpuField gpu(field, *context_);
  Program program = picture_program(
      *context_,
      "uniform highp sampler3D tex_a, tex_transfer;\nlayout(std430) readonly buffer trees_block { uint trees[]; };\n"
      "out vec4 c;\nvoid main() { c = texelFetch(tex_a, ivec3(0), 0) + texelFetch(tex_transfer, ivec3(0), 0) + vec4(trees[0]); "
      "}\n");
  expect_contains(error_of([&] { gpu.bind(program); }), "test.frag reads tex_transfer, trees_block, which neither");
  EXPECT_EQ(gpu.unused(program), std::vector<std::string>{"nodes"});
  const GlTexture transfer = make_texture(*context_, GL_TEXTURE_3D);
  const GlBuffer trees = make_buffer(*context_);
  program.bind_texture("tex_transfer", transfer.id());
  program.bind_buffer("trees_block", trees.id());
  EXPECT_NO_THROW(gpu.bind(program));
}

TEST_P(ContextTest, LimitsAreCheckedBeforeAnythingIsAllocated) {
  const int limit = context_->info().max_3d_texture_size;
  const EncodedField wide = field_of({host_3d("tex_wide", TexelFormat::r8, {limit + 1, 1, 1})});
  EXPECT_THROW(GpuField(wide, *context_), UnsupportedError);
  const std::string message = error_of([&] { GpuField(wide, *context_); });
  expect_contains(message, "encoding test: 'tex_wide'");
  expect_contains(message, std::to_string(limit));
  const EncodedField cpu_only = field_of({host_3d("tex_double", TexelFormat::r64f, {1, 1, 1})});
  expect_contains(error_of([&] { GpuField(cpu_only, *context_); }), "format r64f exists on the CPU only");
  EXPECT_NO_THROW(context_->check("refusals leave no GL error"));
}

TEST_P(ContextTest, HostDataThatContradictsItselfIsRefused) {
  EncodedField field = field_of({host_3d("tex_a", TexelFormat::r8, {2, 2, 2})});
  field.textures[0].roles.padding = 1;
  expect_contains(error_of([&] { GpuField(field, *context_); }), "its roles sum to 9 bytes, it has 8");
  field = field_of({host_3d("tex_a", TexelFormat::r8, {2, 2, 2})});
  field.textures[0].data.pop_back();
  expect_contains(error_of([&] { GpuField(field, *context_); }), "7 bytes of data, 8 by its size");
  field = field_of({host_3d("tex_a", TexelFormat::r32ui, {2, 2, 2})});
  field.textures[0].hardware_linear = true;
  expect_contains(error_of([&] { GpuField(field, *context_); }), "no hardware filter");
}

TEST_P(ContextTest, TheTimerMeasures) {
  if (context_->info().timer_bits == 0) GTEST_SKIP() << "no GL_TIME_ELAPSED";
  Program program = picture_program(
      *context_,
      "uniform int u_n;\nout vec4 c;\nvoid main() { float s = 0.0; for (int i = 0; i < u_n; ++i) s += sin(s + gl_FragCoord.x); "
      "c = vec4(s); }\n");
  DrawTarget target(*context_, 256, 256);
  GpuTimer timer(*context_);
  const auto time = [&](int n) {
    program.set("u_n", n);
    timer.begin();
    target.draw(program);
    timer.end();
    return timer.milliseconds();
  };
  time(1);  // compiles for real
  const double little = time(1);
  const double much = time(2000);
  EXPECT_GE(little, 0);
  EXPECT_GT(much, little);
}

INSTANTIATE_TEST_SUITE_P(Kinds, ContextTest, testing::Values(ContextKind::egl, ContextKind::egl_device, ContextKind::osmesa),
                         [](const auto& test) { return std::string(context_kind_name(test.param)); });

}  // namespace
}  // namespace amrtex
