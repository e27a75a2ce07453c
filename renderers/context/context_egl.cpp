// Contexts through EGL, without any window system.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "renderers/context/egl_devices.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// An initialised display. EGL hands out one display a platform and process, so
/// it may be terminated only where the driver counts its users.
class EglDisplay {
 public:
  EglDisplay(const EglLibrary& egl, EGLenum platform, void* native) : egl_(egl) {
    counted_ = egl.has_client_extension("EGL_KHR_display_reference");
    const std::array<EGLAttrib, 3> attributes{EGL_TRACK_REFERENCES_KHR, EGL_TRUE, EGL_NONE};
    display_ = egl.get_platform_display(platform, native, counted_ ? attributes.data() : nullptr);
    if (display_ == EGL_NO_DISPLAY)
      throw Error(fmt::format("{}: {} has no driver that takes it; needed: a GPU's driver, or Mesa's (packages libegl-mesa0 libgl1-mesa-dri)",
                              egl.error_text("eglGetPlatformDisplay"), egl.name()));
    if (!egl.initialize(display_, nullptr, nullptr)) throw Error(egl.error_text("eglInitialize"));
  }
  EglDisplay(EglDisplay&& other) noexcept
      : egl_(other.egl_), display_(std::exchange(other.display_, EGL_NO_DISPLAY)), counted_(other.counted_) {}
  EglDisplay& operator=(EglDisplay&&) = delete;
  ~EglDisplay() {
    if (display_ != EGL_NO_DISPLAY && counted_) egl_.terminate(display_);
  }
  const EglLibrary& egl() const { return egl_; }
  EGLDisplay get() const { return display_; }
  bool has(std::string_view extension) const { return lists_extension(egl_.query_string(display_, EGL_EXTENSIONS), extension); }

 private:
  EglLibrary egl_;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  bool counted_ = false;
};

EGLConfig choose_config(const EglDisplay& display) {
  if (display.has("EGL_KHR_no_config_context")) return EGL_NO_CONFIG_KHR;
  const std::array<EGLint, 5> wanted{EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint n = 0;
  if (!display.egl().choose_config(display.get(), wanted.data(), &config, 1, &n))
    throw Error(display.egl().error_text("eglChooseConfig"));
  if (n == 0) throw Error("no EGL configuration for desktop OpenGL");
  return config;
}

/// What the driver gives where no version is asked for: "3.3 (Core Profile) Mesa 22.3.6, renderer".
std::string version_there(const EglDisplay& display) {
  const EglLibrary& egl = display.egl();
  EGLContext context = egl.create_context(display.get(), choose_config(display), EGL_NO_CONTEXT, nullptr);
  if (context == EGL_NO_CONTEXT) return "";
  std::string text;
  const auto get_string = reinterpret_cast<const unsigned char* (*)(unsigned)>(egl.get_proc_address("glGetString"));
  if (get_string != nullptr && egl.make_current(display.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
    constexpr unsigned renderer = 0x1f01;
    constexpr unsigned version = 0x1f02;
    for (const unsigned name : {version, renderer})
      if (const auto* found = reinterpret_cast<const char*>(get_string(name)))
        text += fmt::format("{}{}", text.empty() ? "" : ", ", found);
    egl.make_current(display.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  }
  egl.destroy_context(display.get(), context);
  return text;
}

EGLContext create_context(const EglDisplay& display, bool debug) {
  const EglLibrary& egl = display.egl();
  if (!display.has("EGL_KHR_surfaceless_context")) throw Error("EGL_KHR_surfaceless_context is missing");
  if (!egl.bind_api(EGL_OPENGL_API)) {
    const char* offered = egl.query_string(display.get(), EGL_CLIENT_APIS);
    throw Error(fmt::format("this EGL has no OpenGL, it has {}; needed: OpenGL 4.5 core", offered != nullptr ? offered : "nothing"));
  }
  const std::array<EGLint, 9> attributes{EGL_CONTEXT_MAJOR_VERSION,
                                         4,
                                         EGL_CONTEXT_MINOR_VERSION,
                                         5,
                                         EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                         EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                         EGL_CONTEXT_OPENGL_DEBUG,
                                         debug ? EGL_TRUE : EGL_FALSE,
                                         EGL_NONE};
  EGLContext context = egl.create_context(display.get(), choose_config(display), EGL_NO_CONTEXT, attributes.data());
  if (context != EGL_NO_CONTEXT) return context;
  const std::string reason = egl.error_text("eglCreateContext (GL 4.5 core)");
  const std::string there = version_there(display);
  throw Error(there.empty() ? reason : fmt::format("{}: the driver gives GL {}; needed: 4.5 core", reason, there));
}

class EglContext final : public Context {
 public:
  EglContext(ContextKind kind, EglDisplay display, const ContextOptions& options)
      : display_(std::move(display)), egl_(&display_.egl()), context_(create_context(display_, options.debug)) {
    try {
      make_current();
      initialize(known(kind), egl_->get_proc_address, options);
    } catch (...) {
      release();
      throw;
    }
  }
  ~EglContext() override { release(); }

  void make_current() override {
    if (egl_->get_current_context() == context_) return;
    if (!egl_->make_current(display_.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
      throw Error(egl_->error_text("eglMakeCurrent"));
  }

 private:
  GlContextInfo known(ContextKind kind) const {
    GlContextInfo info;
    info.kind = context_kind_name(kind);
    if (const auto device = device_of(*egl_, display_.get())) {
      info.device = device->index;
      info.device_file = device->drm_file;
      info.cuda_index = device->cuda_index.value_or(-1);
    }
    return info;
  }

  void release() {
    if (egl_->get_current_context() == context_)
      egl_->make_current(display_.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    egl_->destroy_context(display_.get(), context_);
  }

  EglDisplay display_;
  const EglLibrary* egl_;
  EGLContext context_;
};

EglDisplay display_of(const EglLibrary& egl, const EglDevice& device) {
  return {egl, EGL_PLATFORM_DEVICE_EXT, device.handle};
}

/// The first device of EGL's list that gives a context. `told`: a reason that need not be told again.
std::unique_ptr<Context> make_first_device_context(const EglLibrary& egl, ContextKind kind, bool hardware_only,
                                                   const ContextOptions& options, std::string_view told = "") {
  std::string reasons;
  for (const EglDevice& device : list_devices(egl)) {
    if (hardware_only && device.software) continue;
    try {
      auto context = std::make_unique<EglContext>(kind, display_of(egl, device), options);
      // a device node without a usable driver may come back as a software rasteriser
      if (!hardware_only || !context->info().software) return context;
      reasons += fmt::format(" ({} is software)", context->info().renderer);
    } catch (const Error& e) {
      if (e.what() != told) reasons += fmt::format(" ({})", e.what());
    }
  }
  throw Error(fmt::format("no {} found{}", hardware_only ? "hardware device" : "EGL device with GL 4.5 core", reasons));
}

}  // namespace

namespace detail {

std::unique_ptr<Context> make_egl_context(const ContextChoice& choice, const ContextOptions& options) {
  const EglLibrary egl;
  if (choice.device) return std::make_unique<EglContext>(choice.kind, display_of(egl, find_device(egl, *choice.device)), options);
  if (choice.kind == ContextKind::egl_device) return make_first_device_context(egl, choice.kind, true, options);
  std::string reason = "EGL_MESA_platform_surfaceless is missing";
  std::string told;
  if (egl.has_client_extension("EGL_MESA_platform_surfaceless")) try {
      return std::make_unique<EglContext>(choice.kind, EglDisplay(egl, EGL_PLATFORM_SURFACELESS_MESA, nullptr), options);
    } catch (const Error& e) {
      told = e.what();
      reason = fmt::format("surfaceless platform: {}", told);
    }
  try {
    return make_first_device_context(egl, choice.kind, false, options, told);
  } catch (const Error& e) {
    throw Error(fmt::format("{}; {}", reason, e.what()));
  }
}

}  // namespace detail
}  // namespace amrtex
