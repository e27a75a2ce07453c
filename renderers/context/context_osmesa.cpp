// Contexts of Mesa's off-screen library, which needs neither EGL nor a display.
#include <fmt/format.h>

#include "renderers/context/context.hpp"
#include "structures/mesh/error.hpp"

#ifdef AMRTEX_HAS_OSMESA
#include <GL/osmesa.h>

#include <array>

namespace amrtex {
namespace {

// OSMesa wants a colour buffer to be current; pictures go to framebuffer objects instead
constexpr int kBufferWidth = 16;

OSMesaContext create_context() {
  const std::array<int, 9> attributes{OSMESA_FORMAT,
                                      OSMESA_RGBA,
                                      OSMESA_PROFILE,
                                      OSMESA_CORE_PROFILE,
                                      OSMESA_CONTEXT_MAJOR_VERSION,
                                      4,
                                      OSMESA_CONTEXT_MINOR_VERSION,
                                      5,
                                      0};
  OSMesaContext context = OSMesaCreateContextAttribs(attributes.data(), nullptr);
  if (!context) throw Error("OSMesaCreateContextAttribs gave no GL 4.5 core context");
  return context;
}

class OsmesaContext final : public Context {
 public:
  explicit OsmesaContext(const ContextOptions& options) : context_(create_context()) {
    try {
      make_current();
      initialize(ContextKind::osmesa, &OSMesaGetProcAddress, options);
    } catch (...) {
      release();
      throw;
    }
  }
  ~OsmesaContext() override { release(); }

  void make_current() override {
    if (OSMesaGetCurrentContext() == context_) return;
    if (!OSMesaMakeCurrent(context_, buffer_.data(), GL_UNSIGNED_BYTE, kBufferWidth, kBufferWidth))
      throw Error("OSMesaMakeCurrent failed");
  }

 private:
  void release() {
    // the next context may get this one's address: it may not look current then
    if (OSMesaGetCurrentContext() == context_) OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
    OSMesaDestroyContext(context_);
  }

  OSMesaContext context_;
  std::array<unsigned char, std::size_t{4} * kBufferWidth * kBufferWidth> buffer_{};
};

}  // namespace

std::unique_ptr<Context> detail::make_osmesa_context(const ContextOptions& options) {
  return std::make_unique<OsmesaContext>(options);
}

}  // namespace amrtex

#else

std::unique_ptr<amrtex::Context> amrtex::detail::make_osmesa_context(const ContextOptions&) {
  throw Error("this program was built without OSMesa (package libosmesa6-dev)");
}

#endif
