// Every registered encoding with every filter that it lists, and the checks that all of them
// must pass. Nothing here names an encoding or a parameter of one.
#pragma once

#include <array>

#include "bench/verify/encoding_cases.hpp"
#include "bench/verify/probing.hpp"
#include "renderers/context.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex::test {

/// Made once a process; never destroyed, since the drivers' libraries may be gone by then.
inline Context& context(ContextKind kind) {
  static Context* const egl = make_context(ContextKind::egl).release();
  if (kind == ContextKind::egl) return *egl;
  static Context* const osmesa = make_context(ContextKind::osmesa).release();
  return *osmesa;
}
inline constexpr std::array kContexts{ContextKind::egl, ContextKind::osmesa};

}  // namespace amrtex::test
