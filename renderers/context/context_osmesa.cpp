// Contexts of Mesa's off-screen library, which needs neither EGL nor a display. It is opened when the program runs.
#include <fmt/format.h>

#include <array>

#include "renderers/context/context.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/shared_library.hpp"

namespace amrtex {
namespace {

// OSMesa wants a colour buffer to be current; pictures go to framebuffer objects instead
constexpr int kBufferWidth = 16;

// of GL/osmesa.h and GL/gl.h, so that this program is built without Mesa's headers
constexpr int kFormat = 0x22;
constexpr int kProfile = 0x33;
constexpr int kCoreProfile = 0x34;
constexpr int kMajorVersion = 0x36;
constexpr int kMinorVersion = 0x37;
constexpr int kRgba = 0x1908;
constexpr unsigned kUnsignedByte = 0x1401;
using OsmesaHandle = struct osmesa_context*;

SharedLibrary open_osmesa() {
  try {
    return SharedLibrary(library_names("AMRTEX_OSMESA", {"libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"}));
  } catch (const Error& e) {
    throw Error(fmt::format("no OSMesa: {}; needed: Mesa's libOSMesa (package libosmesa6), or its path in AMRTEX_OSMESA", e.what()));
  }
}

class OsmesaLibrary {
 public:
  OsmesaLibrary() : library_(open_osmesa()) {}

 private:
  SharedLibrary library_;

 public:
  OsmesaHandle (*create)(const int* attributes, OsmesaHandle shared) =
      library_.require<OsmesaHandle(const int*, OsmesaHandle)>("OSMesaCreateContextAttribs");
  void (*destroy)(OsmesaHandle context) = library_.require<void(OsmesaHandle)>("OSMesaDestroyContext");
  unsigned char (*make_current)(OsmesaHandle context, void* buffer, unsigned type, int width, int height) =
      library_.require<unsigned char(OsmesaHandle, void*, unsigned, int, int)>("OSMesaMakeCurrent");
  OsmesaHandle (*get_current)() = library_.require<OsmesaHandle()>("OSMesaGetCurrentContext");
  void (*(*get_proc_address)(const char* name))() = library_.require<void (*(const char*))()>("OSMesaGetProcAddress");
};

OsmesaHandle create_context(const OsmesaLibrary& osmesa) {
  const std::array<int, 9> attributes{kFormat, kRgba, kProfile, kCoreProfile, kMajorVersion, 4, kMinorVersion, 5, 0};
  OsmesaHandle context = osmesa.create(attributes.data(), nullptr);
  if (context == nullptr) throw Error("OSMesaCreateContextAttribs gave no GL 4.5 core context: Mesa 17 or later is needed");
  return context;
}

class OsmesaContext final : public Context {
 public:
  explicit OsmesaContext(const ContextOptions& options) : context_(create_context(osmesa_)) {
    try {
      make_current();
      GlContextInfo known;
      known.kind = context_kind_name(ContextKind::osmesa);
      initialize(known, osmesa_.get_proc_address, options);
    } catch (...) {
      release();
      throw;
    }
  }
  ~OsmesaContext() override { release(); }

  void make_current() override {
    if (osmesa_.get_current() == context_) return;
    if (!osmesa_.make_current(context_, buffer_.data(), kUnsignedByte, kBufferWidth, kBufferWidth))
      throw Error("OSMesaMakeCurrent failed");
  }

 private:
  void release() {
    // the next context may get this one's address: it may not look current then
    if (osmesa_.get_current() == context_) osmesa_.make_current(nullptr, nullptr, kUnsignedByte, 0, 0);
    osmesa_.destroy(context_);
  }

  OsmesaLibrary osmesa_;
  OsmesaHandle context_;
  std::array<unsigned char, std::size_t{4} * kBufferWidth * kBufferWidth> buffer_{};
};

}  // namespace

std::unique_ptr<Context> detail::make_osmesa_context(const ContextOptions& options) {
  return std::make_unique<OsmesaContext>(options);
}

}  // namespace amrtex
