// Contexts through EGL, without any window system.
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "renderers/context/context.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

bool lists_extension(const char* list, std::string_view name) {
  std::string_view rest = list ? list : "";
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    if (rest.substr(0, end) == name) return true;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return false;
}

std::string egl_error_text(std::string_view call) {
  const EGLint code = eglGetError();
  switch (code) {
    case EGL_SUCCESS:
      return fmt::format("{} failed", call);
    case EGL_NOT_INITIALIZED:
      return fmt::format("{}: EGL_NOT_INITIALIZED", call);
    case EGL_BAD_ALLOC:
      return fmt::format("{}: EGL_BAD_ALLOC", call);
    case EGL_BAD_MATCH:
      return fmt::format("{}: EGL_BAD_MATCH", call);
    case EGL_BAD_PARAMETER:
      return fmt::format("{}: EGL_BAD_PARAMETER", call);
    case EGL_BAD_CONFIG:
      return fmt::format("{}: EGL_BAD_CONFIG", call);
    case EGL_CONTEXT_LOST:
      return fmt::format("{}: EGL_CONTEXT_LOST", call);
    default:
      return fmt::format("{}: EGL error 0x{:04x}", call, static_cast<unsigned>(code));
  }
}

/// An initialised display. EGL hands out one display a platform and process, so
/// it may be terminated only where the driver counts its users.
class EglDisplay {
 public:
  EglDisplay(EGLenum platform, void* native) {
    const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    counted_ = lists_extension(client, "EGL_KHR_display_reference");
    const std::array<EGLAttrib, 3> attributes{EGL_TRACK_REFERENCES_KHR, EGL_TRUE, EGL_NONE};
    display_ = eglGetPlatformDisplay(platform, native, counted_ ? attributes.data() : nullptr);
    if (display_ == EGL_NO_DISPLAY) throw Error(egl_error_text("eglGetPlatformDisplay"));
    if (!eglInitialize(display_, nullptr, nullptr)) throw Error(egl_error_text("eglInitialize"));
  }
  EglDisplay(EglDisplay&& other) noexcept : display_(std::exchange(other.display_, EGL_NO_DISPLAY)), counted_(other.counted_) {}
  EglDisplay& operator=(EglDisplay&&) = delete;
  ~EglDisplay() {
    if (display_ != EGL_NO_DISPLAY && counted_) eglTerminate(display_);
  }
  EGLDisplay get() const { return display_; }
  bool has(std::string_view extension) const { return lists_extension(eglQueryString(display_, EGL_EXTENSIONS), extension); }

 private:
  EGLDisplay display_ = EGL_NO_DISPLAY;
  bool counted_ = false;
};

EGLConfig choose_config(const EglDisplay& display) {
  if (display.has("EGL_KHR_no_config_context")) return EGL_NO_CONFIG_KHR;
  const std::array<EGLint, 5> wanted{EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint n = 0;
  if (!eglChooseConfig(display.get(), wanted.data(), &config, 1, &n)) throw Error(egl_error_text("eglChooseConfig"));
  if (n == 0) throw Error("no EGL configuration for desktop OpenGL");
  return config;
}

EGLContext create_context(const EglDisplay& display, bool debug) {
  if (!display.has("EGL_KHR_surfaceless_context")) throw Error("EGL_KHR_surfaceless_context is missing");
  if (!eglBindAPI(EGL_OPENGL_API)) throw Error(egl_error_text("eglBindAPI"));
  const std::array<EGLint, 9> attributes{EGL_CONTEXT_MAJOR_VERSION,
                                         4,
                                         EGL_CONTEXT_MINOR_VERSION,
                                         5,
                                         EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                         EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                         EGL_CONTEXT_OPENGL_DEBUG,
                                         debug ? EGL_TRUE : EGL_FALSE,
                                         EGL_NONE};
  EGLContext context = eglCreateContext(display.get(), choose_config(display), EGL_NO_CONTEXT, attributes.data());
  if (context == EGL_NO_CONTEXT) throw Error(egl_error_text("eglCreateContext (GL 4.5 core)"));
  return context;
}

class EglContext final : public Context {
 public:
  EglContext(ContextKind kind, EglDisplay display, const ContextOptions& options)
      : display_(std::move(display)), context_(create_context(display_, options.debug)) {
    try {
      make_current();
      initialize(kind, &eglGetProcAddress, options);
    } catch (...) {
      release();
      throw;
    }
  }
  ~EglContext() override { release(); }

  void make_current() override {
    if (eglGetCurrentContext() == context_) return;
    if (!eglMakeCurrent(display_.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) throw Error(egl_error_text("eglMakeCurrent"));
  }

 private:
  void release() {
    if (eglGetCurrentContext() == context_) eglMakeCurrent(display_.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_.get(), context_);
  }

  EglDisplay display_;
  EGLContext context_;
};

struct EglDevice {
  EGLDeviceEXT handle;
  bool software;
};

std::vector<EglDevice> list_devices() {
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const bool listed = lists_extension(client, "EGL_EXT_device_base") || lists_extension(client, "EGL_EXT_device_enumeration");
  if (!listed || !lists_extension(client, "EGL_EXT_platform_device")) return {};
  const auto query_devices = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  const auto query_string = reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
  if (!query_devices || !query_string) return {};
  EGLint n = 0;
  if (!query_devices(0, nullptr, &n) || n <= 0) return {};
  std::vector<EGLDeviceEXT> handles(static_cast<std::size_t>(n));
  query_devices(n, handles.data(), &n);
  std::vector<EglDevice> devices;
  for (EGLDeviceEXT handle : handles)
    devices.push_back({handle, lists_extension(query_string(handle, EGL_EXTENSIONS), "EGL_MESA_device_software")});
  return devices;
}

std::unique_ptr<Context> make_device_context(ContextKind kind, bool hardware_only, const ContextOptions& options) {
  std::string reasons;
  for (const EglDevice& device : list_devices()) {
    if (hardware_only && device.software) continue;
    try {
      auto context = std::make_unique<EglContext>(kind, EglDisplay(EGL_PLATFORM_DEVICE_EXT, device.handle), options);
      // a device node without a usable driver may come back as a software rasteriser
      if (!hardware_only || !context->info().software) return context;
      reasons += fmt::format(" ({} is software)", context->info().renderer);
    } catch (const Error& e) {
      reasons += fmt::format(" ({})", e.what());
    }
  }
  throw Error(fmt::format("no {} found{}", hardware_only ? "hardware device" : "EGL device with GL 4.5 core", reasons));
}

}  // namespace

namespace detail {

std::unique_ptr<Context> make_egl_context(ContextKind kind, const ContextOptions& options) {
  if (kind == ContextKind::egl_device) return make_device_context(kind, true, options);
  std::string reason = "EGL_MESA_platform_surfaceless is missing";
  if (lists_extension(eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS), "EGL_MESA_platform_surfaceless")) try {
      return std::make_unique<EglContext>(kind, EglDisplay(EGL_PLATFORM_SURFACELESS_MESA, nullptr), options);
    } catch (const Error& e) {
      reason = fmt::format("surfaceless platform: {}", e.what());
    }
  try {
    return make_device_context(kind, false, options);
  } catch (const Error& e) {
    throw Error(fmt::format("{}; {}", reason, e.what()));
  }
}

}  // namespace detail
}  // namespace amrtex
