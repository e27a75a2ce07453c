// An off-screen OpenGL 4.5 core context with its own table of functions.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "structures/common/encoding.hpp"

struct GladGLContext;

namespace amrtex {

/// egl: Mesa's surfaceless platform, else the first EGL device that gives a context.
/// egl_device: the first EGL device that is hardware, or the one that is asked for. osmesa: Mesa's software library.
enum class ContextKind { egl, egl_device, osmesa };
std::string_view context_kind_name(ContextKind kind);

/// How a context is asked for: "egl", "egl_device", "egl_device:1" for the device of that number, "osmesa".
struct ContextChoice {
  ContextKind kind = ContextKind::egl;
  std::optional<int> device;  ///< place in EGL's list; of egl_device alone

  ContextChoice(ContextKind asked = ContextKind::egl, std::optional<int> number = std::nullopt) : kind(asked), device(number) {}
  std::string name() const;
};
/// Throws a UsageError that names what is accepted.
ContextChoice parse_context(std::string_view name);

struct ContextOptions {
  bool debug = true;  ///< collect KHR_debug messages; check() throws either way
};

/// What `doctor` reports beside the part that encodings care about.
struct GlContextInfo : ContextInfo {
  std::string kind;  ///< context_kind_name
  std::string glsl_version;
  std::string environment;             ///< variables that chose the driver, "NAME=value NAME=value"
  int max_texture_units = 0;           ///< of the fragment stage
  int max_storage_bindings = 0;        ///< shader storage blocks of the fragment stage
  int max_viewport_width = 0;          ///< pixels
  int max_viewport_height = 0;         ///< pixels
  int max_compute_invocations = 0;     ///< in one work group
  int timer_bits = 0;                  ///< of GL_TIME_ELAPSED; 0 = no timer
  std::int64_t free_memory_bytes = 0;  ///< as the driver reports it when the context is made; 0 = no memory query
  bool software = false;               ///< a software rasteriser: its times stand in no table with a GPU's
  bool sparse_texture = false;
  std::int64_t total_memory_bytes = 0;  ///< of the GPU; 0 = the driver does not tell
  int device = -1;          ///< its place in EGL's list; negative where that is not known
  std::string device_file;  ///< "/dev/dri/renderD128"; empty where it is not known
  int cuda_index = -1;      ///< NVIDIA's number of the device; negative where it has none
  bool has_extension(std::string_view name) const;
};

class MessageLog;

/// One GL context. GL objects keep a reference to theirs and make it current
/// before they use it, so several contexts may be alive in one thread.
class Context {
 public:
  virtual ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  /// Cheap when it is current already. Throws Error.
  virtual void make_current() = 0;
  const GlContextInfo& info() const { return info_; }
  const GladGLContext& gl() const { return *gl_; }
  /// Bytes that the driver says are free on the GPU now; 0 = it cannot be asked.
  std::int64_t free_memory_bytes();

  /// Throws BudgetError where GL has no memory left, which costs an object and not the context.
  /// Throws Error with every fatal message and GL error since the last call; `what`
  /// says what was being done. Fatal are errors and messages of high severity,
  /// except those of the shader compiler, which Program throws with file names.
  void check(std::string_view what);
  /// Messages that were not fatal, oldest first.
  std::vector<std::string> take_messages();

  /// Counts handles of textures against the context's limit. Throws UnsupportedError with the numbers.
  void reserve_handles(std::int64_t count);
  void release_handles(std::int64_t count) { resident_handles_ -= count; }

 protected:
  using LoadFunction = void (*(*)(const char*))();

  Context();
  /// To be called by the kinds once their context is current: loads the functions,
  /// checks the version, fills the rest of info().
  void initialize(GlContextInfo known, LoadFunction load, const ContextOptions& options);

 private:
  void install_debug_output();

  std::unique_ptr<GladGLContext> gl_;
  std::unique_ptr<MessageLog> log_;  // its address is known to the driver
  GlContextInfo info_;
  std::int64_t resident_handles_ = 0;
};

/// Throws Error that says why not, and which kinds this machine may try.
std::unique_ptr<Context> make_context(const ContextChoice& choice, const ContextOptions& options = {});

namespace detail {  // one function a source file
std::unique_ptr<Context> make_egl_context(const ContextChoice& choice, const ContextOptions& options);
std::unique_ptr<Context> make_osmesa_context(const ContextOptions& options);
}  // namespace detail

}  // namespace amrtex
