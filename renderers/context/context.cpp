#include "renderers/context/context.hpp"

#include <fmt/format.h>
#include <glad/gl.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstdlib>
#include <limits>
#include <utility>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr std::array<ContextKind, 3> kKinds{ContextKind::egl, ContextKind::egl_device, ContextKind::osmesa};
constexpr std::string_view kKindNames = "egl, egl_device, osmesa";
constexpr std::string_view kDevicePrefix = "egl_device:";
// a driver may repeat one message for every draw call
constexpr std::size_t kMaxKeptMessages = 64;

std::string_view debug_type_name(GLenum type) {
  switch (type) {
    case GL_DEBUG_TYPE_ERROR:
      return "error";
    case GL_DEBUG_TYPE_DEPRECATED_BEHAVIOR:
      return "deprecated";
    case GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR:
      return "undefined behaviour";
    case GL_DEBUG_TYPE_PORTABILITY:
      return "portability";
    case GL_DEBUG_TYPE_PERFORMANCE:
      return "performance";
    default:
      return "message";
  }
}

std::string_view gl_error_name(GLenum error) {
  switch (error) {
    case GL_INVALID_ENUM:
      return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
      return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
      return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY:
      return "GL_OUT_OF_MEMORY";
    case GL_CONTEXT_LOST:
      return "GL_CONTEXT_LOST";
    default:
      return "unknown GL error";
  }
}

std::string get_text(const GladGLContext& gl, GLenum name) {
  const GLubyte* text = gl.GetString(name);
  return text ? reinterpret_cast<const char*>(text) : "";
}

int get_int(const GladGLContext& gl, GLenum name) {
  GLint value = 0;
  gl.GetIntegerv(name, &value);
  return value;
}

std::int64_t get_int64(const GladGLContext& gl, GLenum name) {
  GLint64 value = 0;
  gl.GetInteger64v(name, &value);
  return value;
}

std::vector<std::string> get_extensions(const GladGLContext& gl) {
  std::vector<std::string> names;
  const int n = get_int(gl, GL_NUM_EXTENSIONS);
  for (int i = 0; i < n; ++i)
    names.emplace_back(reinterpret_cast<const char*>(gl.GetStringi(GL_EXTENSIONS, static_cast<GLuint>(i))));
  std::sort(names.begin(), names.end());
  return names;
}

constexpr std::int64_t kKib = 1024;  // both extensions count in it

std::int64_t get_free_memory(const GladGLContext& gl, const GlContextInfo& info) {
  if (info.has_extension("GL_NVX_gpu_memory_info")) return kKib * get_int(gl, GL_GPU_MEMORY_INFO_CURRENT_AVAILABLE_VIDMEM_NVX);
  if (!info.has_extension("GL_ATI_meminfo")) return 0;
  std::array<GLint, 4> values{};
  gl.GetIntegerv(GL_TEXTURE_FREE_MEMORY_ATI, values.data());
  return kKib * values[0];
}

/// GL_ATI_meminfo tells only what is free.
std::int64_t get_total_memory(const GladGLContext& gl, const GlContextInfo& info) {
  if (!info.has_extension("GL_NVX_gpu_memory_info")) return 0;
  return kKib * get_int(gl, GL_GPU_MEMORY_INFO_DEDICATED_VIDMEM_NVX);
}

bool is_software(std::string_view renderer) {
  for (std::string_view name : {"llvmpipe", "softpipe", "swrast", "lavapipe", "SwiftShader"})
    if (renderer.find(name) != std::string_view::npos) return true;
  return false;
}

std::string driver_environment() {
  std::vector<std::string> set;
  for (const char* name : {"LIBGL_ALWAYS_SOFTWARE", "MESA_LOADER_DRIVER_OVERRIDE", "GALLIUM_DRIVER", "LP_NUM_THREADS",
                           "LP_NATIVE_VECTOR_WIDTH", "VK_DRIVER_FILES", "VK_ICD_FILENAMES", "__EGL_VENDOR_LIBRARY_FILENAMES"})
    if (const char* value = std::getenv(name)) set.push_back(fmt::format("{}={}", name, value));
  return fmt::format("{}", fmt::join(set, " "));
}

/// GL has no query for it. Mesa's zink keeps a table of 1024 (its first stays empty) and crashes beyond; of other
/// drivers no limit is known.
std::int64_t max_resident_handles(std::string_view renderer) {
  return renderer.starts_with("zink") ? 1023 : std::numeric_limits<std::int64_t>::max();
}

bool takes_texture(const GladGLContext& gl, int width, int height, int depth) {
  gl.TexStorage3D(GL_PROXY_TEXTURE_3D, 1, GL_R32F, width, height, depth);
  GLint taken = 0;
  gl.GetTexLevelParameteriv(GL_PROXY_TEXTURE_3D, 0, GL_TEXTURE_WIDTH, &taken);
  return taken != 0;
}

/// GL has no query for it either, but drivers tell of a size whether they would take it: textures of four bytes a texel and of
/// growing depth are asked about. No limit where even the longest axes are taken.
std::int64_t max_texture_bytes(const GladGLContext& gl, int longest_axis) {
  if (takes_texture(gl, longest_axis, longest_axis, longest_axis)) return std::numeric_limits<std::int64_t>::max();
  const int edge = std::min(longest_axis, 1024);
  int taken = 0;
  for (int step = std::bit_floor(static_cast<unsigned>(longest_axis)); step > 0; step /= 2)
    if (taken + step <= longest_axis && takes_texture(gl, edge, edge, taken + step)) taken += step;
  return taken == longest_axis ? std::numeric_limits<std::int64_t>::max() : std::int64_t{4} * edge * edge * taken;
}

void read_limits(const GladGLContext& gl, GlContextInfo& info) {
  info.max_3d_texture_size = get_int(gl, GL_MAX_3D_TEXTURE_SIZE);
  info.max_texture_bytes = max_texture_bytes(gl, info.max_3d_texture_size);
  info.max_buffer_bytes = get_int64(gl, GL_MAX_SHADER_STORAGE_BLOCK_SIZE);
  info.max_texture_units = get_int(gl, GL_MAX_TEXTURE_IMAGE_UNITS);
  info.max_storage_bindings = get_int(gl, GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS);
  info.max_compute_invocations = get_int(gl, GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS);
  std::array<GLint, 2> viewport{};
  gl.GetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport.data());
  info.max_viewport_width = viewport[0];
  info.max_viewport_height = viewport[1];
  gl.GetQueryiv(GL_TIME_ELAPSED, GL_QUERY_COUNTER_BITS, &info.timer_bits);
}

GlContextInfo read_info(const GladGLContext& gl, GlContextInfo info) {
  info.renderer = get_text(gl, GL_RENDERER);
  info.version = get_text(gl, GL_VERSION);
  info.vendor = get_text(gl, GL_VENDOR);
  info.glsl_version = get_text(gl, GL_SHADING_LANGUAGE_VERSION);
  info.environment = driver_environment();
  info.software = is_software(info.renderer);
  info.extensions = get_extensions(gl);
  info.bindless_texture = info.has_extension("GL_ARB_bindless_texture");
  info.sparse_texture = info.has_extension("GL_ARB_sparse_texture");
  info.shader_ballot = info.has_extension("GL_ARB_shader_ballot");
  // GL_ARB_bindless_texture asks for one handle in all invocations that run together; this extension lifts that
  info.handles_may_differ = info.has_extension("GL_NV_gpu_shader5");
  info.max_resident_handles = max_resident_handles(info.renderer);
  read_limits(gl, info);
  info.total_memory_bytes = get_total_memory(gl, info);
  info.free_memory_bytes = get_free_memory(gl, info);
  return info;
}

}  // namespace

/// Collects what the driver says; an exception may not pass through the driver's C code.
class MessageLog {
 public:
  void add(GLenum source, GLenum type, GLenum severity, std::string_view text) {
    const bool fatal =
        (type == GL_DEBUG_TYPE_ERROR || severity == GL_DEBUG_SEVERITY_HIGH) && source != GL_DEBUG_SOURCE_SHADER_COMPILER;
    if (!fatal && severity == GL_DEBUG_SEVERITY_NOTIFICATION) return;
    while (!text.empty() && text.back() == '\n') text.remove_suffix(1);
    std::vector<std::string>& list = fatal ? fatal_ : messages_;
    if (list.size() < kMaxKeptMessages) list.push_back(fmt::format("{}: {}", debug_type_name(type), text));
  }
  std::vector<std::string> take_fatal() { return std::exchange(fatal_, {}); }
  std::vector<std::string> take_messages() { return std::exchange(messages_, {}); }

  static void GLAD_API_PTR callback(GLenum source, GLenum type, GLuint, GLenum severity, GLsizei length, const GLchar* text,
                                    const void* user) {
    auto* log = const_cast<MessageLog*>(static_cast<const MessageLog*>(user));
    log->add(source, type, severity,
             length < 0 ? std::string_view(text) : std::string_view(text, static_cast<std::size_t>(length)));
  }

 private:
  std::vector<std::string> fatal_;
  std::vector<std::string> messages_;
};

std::string_view context_kind_name(ContextKind kind) {
  switch (kind) {
    case ContextKind::egl:
      return "egl";
    case ContextKind::egl_device:
      return "egl_device";
    case ContextKind::osmesa:
      return "osmesa";
  }
  return "";
}

std::string ContextChoice::name() const {
  return device ? fmt::format("{}{}", kDevicePrefix, *device) : std::string(context_kind_name(kind));
}

ContextChoice parse_context(std::string_view name) {
  for (ContextKind kind : kKinds)
    if (context_kind_name(kind) == name) return kind;
  if (name.starts_with(kDevicePrefix)) {
    const std::string_view digits = name.substr(kDevicePrefix.size());
    int device = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), device);
    if (error == std::errc() && end == digits.data() + digits.size() && device >= 0) return {ContextKind::egl_device, device};
  }
  throw UsageError(fmt::format("no context {}; accepted: {}, egl_device:N", quote(name), kKindNames));
}

bool GlContextInfo::has_extension(std::string_view name) const {
  return std::find(extensions.begin(), extensions.end(), name) != extensions.end();
}

Context::Context() : gl_(std::make_unique<GladGLContext>()), log_(std::make_unique<MessageLog>()) {}
Context::~Context() = default;

void Context::initialize(GlContextInfo known, LoadFunction load, const ContextOptions& options) {
  const int version = gladLoadGLContext(gl_.get(), load);
  if (version == 0) throw Error("the GL functions could not be loaded");
  if (GLAD_VERSION_MAJOR(version) * 10 + GLAD_VERSION_MINOR(version) < 45)
    throw Error(fmt::format("GL {}.{} ({}), but 4.5 is needed", GLAD_VERSION_MAJOR(version), GLAD_VERSION_MINOR(version),
                            get_text(*gl_, GL_RENDERER)));
  if (options.debug) install_debug_output();
  info_ = read_info(*gl_, std::move(known));
  check("reading the context's limits");
}

std::int64_t Context::free_memory_bytes() {
  // llvmpipe has the extensions, tells 0 at first and a few KiB later
  if (info_.free_memory_bytes == 0) return 0;
  make_current();
  return get_free_memory(*gl_, info_);
}

void Context::install_debug_output() {
  gl_->Enable(GL_DEBUG_OUTPUT);
  // the message comes inside the call that caused it, on its thread
  gl_->Enable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
  gl_->DebugMessageCallback(&MessageLog::callback, log_.get());
}

void Context::check(std::string_view what) {
  std::vector<std::string> problems = log_->take_fatal();
  bool out_of_memory = false;
  // bounded: a lost context may report its error for ever
  for (int i = 0; i < 16; ++i) {
    const GLenum error = gl_->GetError();
    if (error == GL_NO_ERROR) break;
    problems.emplace_back(gl_error_name(error));
    out_of_memory = out_of_memory || error == GL_OUT_OF_MEMORY;
  }
  if (out_of_memory) throw BudgetError(fmt::format("context {}, {}: {}", info_.kind, what, fmt::join(problems, "; ")));
  if (!problems.empty()) throw Error(fmt::format("context {}, {}: {}", info_.kind, what, fmt::join(problems, "; ")));
}

void Context::reserve_handles(std::int64_t count) {
  if (count > info_.max_resident_handles - resident_handles_)
    throw UnsupportedError(fmt::format("{} handles of textures beside {} in use, the context takes {}", count, resident_handles_,
                                       info_.max_resident_handles));
  resident_handles_ += count;
}

std::vector<std::string> Context::take_messages() { return log_->take_messages(); }

std::unique_ptr<Context> make_context(const ContextChoice& choice, const ContextOptions& options) {
  try {
    return choice.kind == ContextKind::osmesa ? detail::make_osmesa_context(options) : detail::make_egl_context(choice, options);
  } catch (const Error& e) {
    throw Error(fmt::format("context {}: {}; accepted: {}", choice.name(), e.what(), kKindNames));
  }
}

}  // namespace amrtex
