// with_bindless COMMAND...: runs a command where Mesa's zink gives EGL contexts that take handles of textures. Where it
// does not, prints why and ends with 77, which CTest counts as skipped; with AMRTEX_REQUIRE_BINDLESS set, with 1.
#include <fmt/format.h>
#include <stdlib.h>  // setenv
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "renderers/context/context_probe.hpp"
#include "structures/common/texture_handles.hpp"

namespace {

constexpr int kSkipped = 77;

/// Why not; empty where it does. In a child process: without a Vulkan driver starting may hang for minutes.
std::string missing_handles() {
  const amrtex::ContextProbe probe = amrtex::probe_context(amrtex::ContextKind::egl, std::chrono::seconds(60));
  return probe.ok ? amrtex::supports_handles(probe.info).reason : probe.reason;
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) {
    fmt::print(stderr, "usage: with_bindless COMMAND...\n");
    return 2;
  }
  setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
  setenv("MESA_LOADER_DRIVER_OVERRIDE", "zink", 1);
  if (const std::string reason = missing_handles(); !reason.empty()) {
    const bool required = std::getenv("AMRTEX_REQUIRE_BINDLESS") != nullptr;
    fmt::print(stderr, "{}: {}\n", required ? "AMRTEX_REQUIRE_BINDLESS is set" : "skipped", reason);
    return required ? 1 : kSkipped;
  }
  execv(arguments[1], arguments + 1);
  fmt::print(stderr, "with_bindless: {}: {}\n", arguments[1], std::strerror(errno));
  return 2;
}
