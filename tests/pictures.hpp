// Pictures in tests: views, drawing, comparing; every case of every encoding.
#pragma once

#include "bench/verify/pictures.hpp"
#include "tests/encoding_cases.hpp"

namespace amrtex::test {

template <class F>
void for_each_case(F&& f) {
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    f(c);
  }
}

/// One case of each encoding and filter, its last: the smallest structures. Compiling shaders is what
/// these tests take their time for.
template <class F>
void for_each_filter(F&& f) {
  const auto& cases = encoding_cases();
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (i + 1 < cases.size() && cases[i + 1].encoding == cases[i].encoding && cases[i + 1].filter == cases[i].filter) continue;
    SCOPED_TRACE(cases[i].name());
    f(cases[i]);
  }
}

}  // namespace amrtex::test
