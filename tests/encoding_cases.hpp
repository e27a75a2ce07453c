// Every registered encoding with every filter that it lists, and the checks that all of them
// must pass. Nothing here names an encoding or a parameter of one.
#pragma once

#include <array>
#include <cstdlib>
#include <string>
#include <vector>

#include "bench/verify/encoding_cases.hpp"
#include "bench/verify/probing.hpp"
#include "renderers/context/context.hpp"
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

inline ContextInfo handle_limits(ContextKind kind) { return verify::handle_limits(context(kind).info()); }

/// A word that the names of all cases must hold, of encoding, filter and parameters (environment AMRTEX_CASES): one encoding, or
/// a slice for another driver.
inline std::string case_slice() {
  const char* word = std::getenv("AMRTEX_CASES");
  return word == nullptr ? "" : word;
}

inline const std::vector<EncodingCase>& encoding_cases() {
  static const std::vector<EncodingCase> cases = [] {
    std::vector<EncodingCase> all = cases_named(verify::make_encoding_cases(handle_limits(ContextKind::egl)), case_slice());
    if (all.empty()) throw Error(fmt::format("AMRTEX_CASES={}: no case on this context", case_slice()));
    return all;
  }();
  return cases;
}

}  // namespace amrtex::test
