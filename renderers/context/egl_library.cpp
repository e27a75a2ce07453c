#include "renderers/context/egl_library.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

SharedLibrary open_egl() {
  try {
    return SharedLibrary(library_names("AMRTEX_EGL", {"libEGL.so.1", "libEGL.so"}));
  } catch (const Error& e) {
    throw Error(fmt::format("no EGL: {}; needed: a GPU driver's libEGL, or Mesa's (packages libegl1 libegl-mesa0 libgl1-mesa-dri), or its "
                            "path in AMRTEX_EGL",
                            e.what()));
  }
}

}  // namespace

bool lists_extension(const char* list, std::string_view name) {
  std::string_view rest = list != nullptr ? list : "";
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    if (rest.substr(0, end) == name) return true;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return false;
}

template <class Function>
Function* EglLibrary::load(const char* name) const {
  auto* function = library_.find<Function>(name);
  if (function == nullptr) throw Error(fmt::format("{} has no {}: it is older than EGL 1.5, which is needed", library_.name(), name));
  return function;
}

template <class Function>
Function* EglLibrary::load_extension(const char* name) const {
  return reinterpret_cast<Function*>(get_proc_address(name));
}

EglLibrary::EglLibrary()
    : library_(open_egl()),
      get_error(load<decltype(eglGetError)>("eglGetError")),
      query_string(load<decltype(eglQueryString)>("eglQueryString")),
      get_proc_address(load<decltype(eglGetProcAddress)>("eglGetProcAddress")),
      get_platform_display(load<decltype(eglGetPlatformDisplay)>("eglGetPlatformDisplay")),
      initialize(load<decltype(eglInitialize)>("eglInitialize")),
      terminate(load<decltype(eglTerminate)>("eglTerminate")),
      bind_api(load<decltype(eglBindAPI)>("eglBindAPI")),
      choose_config(load<decltype(eglChooseConfig)>("eglChooseConfig")),
      create_context(load<decltype(eglCreateContext)>("eglCreateContext")),
      destroy_context(load<decltype(eglDestroyContext)>("eglDestroyContext")),
      make_current(load<decltype(eglMakeCurrent)>("eglMakeCurrent")),
      get_current_context(load<decltype(eglGetCurrentContext)>("eglGetCurrentContext")),
      query_devices(load_extension<std::remove_pointer_t<PFNEGLQUERYDEVICESEXTPROC>>("eglQueryDevicesEXT")),
      query_device_string(load_extension<std::remove_pointer_t<PFNEGLQUERYDEVICESTRINGEXTPROC>>("eglQueryDeviceStringEXT")),
      query_device_attribute(load_extension<std::remove_pointer_t<PFNEGLQUERYDEVICEATTRIBEXTPROC>>("eglQueryDeviceAttribEXT")),
      query_display_attribute(load_extension<std::remove_pointer_t<PFNEGLQUERYDISPLAYATTRIBEXTPROC>>("eglQueryDisplayAttribEXT")) {}

bool EglLibrary::has_client_extension(std::string_view name) const {
  return lists_extension(query_string(EGL_NO_DISPLAY, EGL_EXTENSIONS), name);
}

std::string EglLibrary::error_text(std::string_view call) const {
  const EGLint code = get_error();
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

}  // namespace amrtex
