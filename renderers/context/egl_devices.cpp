#include "renderers/context/egl_devices.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

std::string string_of(const EglLibrary& egl, EGLDeviceEXT device, const char* extensions, const char* needed, EGLint name) {
  if (!lists_extension(extensions, needed)) return "";
  const char* text = egl.query_device_string(device, name);
  return text != nullptr ? text : "";
}

EglDevice describe(const EglLibrary& egl, EGLDeviceEXT handle, int index) {
  EglDevice device;
  device.handle = handle;
  device.index = index;
  const char* extensions = egl.query_device_string(handle, EGL_EXTENSIONS);
  const auto text = [&](const char* needed, EGLint name) { return string_of(egl, handle, extensions, needed, name); };
  device.software = lists_extension(extensions, "EGL_MESA_device_software");
  device.vendor = text("EGL_EXT_device_query_name", EGL_VENDOR);
  if (const std::string renderer = text("EGL_EXT_device_query_name", EGL_RENDERER_EXT); !renderer.empty())
    device.vendor += (device.vendor.empty() ? "" : " ") + renderer;
  device.drm_file = text("EGL_EXT_device_drm", EGL_DRM_DEVICE_FILE_EXT);
  if (device.drm_file.empty()) device.drm_file = text("EGL_EXT_device_drm_render_node", EGL_DRM_RENDER_NODE_FILE_EXT);
  EGLAttrib number = 0;
  if (lists_extension(extensions, "EGL_NV_device_cuda") && egl.query_device_attribute != nullptr &&
      egl.query_device_attribute(handle, EGL_CUDA_DEVICE_NV, &number) == EGL_TRUE)
    device.cuda_index = static_cast<int>(number);
  return device;
}

}  // namespace

std::string EglDevice::text() const {
  std::vector<std::string> facts;
  if (!vendor.empty()) facts.push_back(vendor);
  if (!drm_file.empty()) facts.push_back(drm_file);
  if (software) facts.emplace_back("software");
  return facts.empty() ? fmt::format("{}", index) : fmt::format("{} ({})", index, fmt::join(facts, ", "));
}

std::vector<EglDevice> list_devices(const EglLibrary& egl) {
  const bool listed = egl.has_client_extension("EGL_EXT_device_base") || egl.has_client_extension("EGL_EXT_device_enumeration");
  if (!listed || !egl.has_client_extension("EGL_EXT_platform_device")) return {};
  if (egl.query_devices == nullptr || egl.query_device_string == nullptr) return {};
  EGLint n = 0;
  if (egl.query_devices(0, nullptr, &n) != EGL_TRUE || n <= 0) return {};
  std::vector<EGLDeviceEXT> handles(static_cast<std::size_t>(n));
  egl.query_devices(n, handles.data(), &n);
  std::vector<EglDevice> devices;
  for (int i = 0; i < n; ++i) devices.push_back(describe(egl, handles[static_cast<std::size_t>(i)], i));
  return devices;
}

EglDevice find_device(const EglLibrary& egl, int index) {
  const std::vector<EglDevice> devices = list_devices(egl);
  if (index >= 0 && index < std::ssize(devices)) return devices[static_cast<std::size_t>(index)];
  std::vector<std::string> texts;
  for (const EglDevice& device : devices) texts.push_back(device.text());
  if (devices.empty()) throw Error(fmt::format("no device {}: {} lists none", index, egl.name()));
  throw Error(fmt::format("no device {}; there {}: {}", index, devices.size() == 1 ? "is one" : "are", fmt::join(texts, ", ")));
}

std::optional<EglDevice> device_of(const EglLibrary& egl, EGLDisplay display) {
  if (egl.query_display_attribute == nullptr || !egl.has_client_extension("EGL_EXT_device_base")) return std::nullopt;
  EGLAttrib handle = 0;
  if (egl.query_display_attribute(display, EGL_DEVICE_EXT, &handle) != EGL_TRUE) return std::nullopt;
  for (const EglDevice& device : list_devices(egl))
    if (device.handle == reinterpret_cast<EGLDeviceEXT>(handle)) return device;
  return std::nullopt;
}

}  // namespace amrtex
