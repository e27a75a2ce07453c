// EGL as it is found when the program runs: nothing of it is linked.
#pragma once

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <string>
#include <string_view>
#include <vector>

#include "renderers/context/context.hpp"
#include "structures/mesh/shared_library.hpp"

namespace amrtex {

/// The functions that contexts need, and those about devices where this EGL lists devices.
class EglLibrary {
 public:
  /// AMRTEX_EGL where it is set, else the loader's libEGL. Throws Error that says what is needed.
  EglLibrary();

  bool has_client_extension(std::string_view name) const;
  /// "call: EGL_BAD_MATCH" of the last call that failed.
  std::string error_text(std::string_view call) const;
  const std::string& name() const { return library_.name(); }

 private:
  SharedLibrary library_;
  template <class Function>
  Function* load(const char* name) const;
  template <class Function>
  Function* load_extension(const char* name) const;

 public:
  decltype(&eglGetError) get_error;
  decltype(&eglQueryString) query_string;
  decltype(&eglGetProcAddress) get_proc_address;
  decltype(&eglGetPlatformDisplay) get_platform_display;
  decltype(&eglInitialize) initialize;
  decltype(&eglTerminate) terminate;
  decltype(&eglBindAPI) bind_api;
  decltype(&eglChooseConfig) choose_config;
  decltype(&eglCreateContext) create_context;
  decltype(&eglDestroyContext) destroy_context;
  decltype(&eglMakeCurrent) make_current;
  decltype(&eglGetCurrentContext) get_current_context;
  PFNEGLQUERYDEVICESEXTPROC query_devices;
  PFNEGLQUERYDEVICESTRINGEXTPROC query_device_string;
  PFNEGLQUERYDEVICEATTRIBEXTPROC query_device_attribute;
  PFNEGLQUERYDISPLAYATTRIBEXTPROC query_display_attribute;
};

/// Is `name` among the words of `list`, which may be null?
bool lists_extension(const char* list, std::string_view name);

}  // namespace amrtex
