// The devices that EGL lists: GPUs, and software rasterisers as one more.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderers/context/egl_library.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

struct EglDevice {
  EGLDeviceEXT handle = nullptr;  ///< of this process alone
  int index = 0;                  ///< place in EGL's list: what `--device` takes
  bool software = false;
  std::string vendor;             ///< as EGL has it; empty where it does not tell
  std::string drm_file;           ///< "/dev/dri/card0"; empty where it does not tell
  std::optional<int> cuda_index;  ///< NVIDIA's number of it

  std::string text() const;  ///< "1 (vendor, /dev/dri/card0)"
};

/// Empty where this EGL lists none.
std::vector<EglDevice> list_devices(const EglLibrary& egl);
/// Device number `index`. Throws Error that lists those that there are.
EglDevice find_device(const EglLibrary& egl, int index);
/// That an initialised display draws on, where EGL tells.
std::optional<EglDevice> device_of(const EglLibrary& egl, EGLDisplay display);

}  // namespace amrtex
