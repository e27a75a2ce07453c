#include "bench/cli/context_arguments.hpp"

#include <fmt/format.h>

#include "structures/mesh/error.hpp"

namespace amrtex {

ContextChoice ContextArguments::choice(const std::string& fallback) const {
  const ContextChoice asked = parse_context(context.empty() ? (device >= 0 ? "egl_device" : fallback) : context);
  if (device < 0) return asked;
  if (asked.kind != ContextKind::egl_device)
    throw UsageError(fmt::format("--device {}: not with --context {}; accepted: --context egl_device", device, asked.name()));
  if (asked.device && *asked.device != device)
    throw UsageError(fmt::format("--device {}: --context {} names another; accepted: one of the two", device, asked.name()));
  return {asked.kind, device};
}

}  // namespace amrtex
