// Pictures in tests: views, drawing, comparing; every case of every encoding.
#pragma once

#include "bench/verify/pictures.hpp"
#include "tests/encoding_cases.hpp"
#include "tests/test_tier.hpp"

namespace amrtex::test {

/// A case's place among all, for chosen().
inline std::size_t number_of(const EncodingCase& c) {
  const auto& cases = encoding_cases();
  const auto same = [&](const EncodingCase& other) { return other.name() == c.name(); };
  return static_cast<std::size_t>(std::find_if(cases.begin(), cases.end(), same) - cases.begin());
}

template <class F>
void for_each_case(F&& f) {
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    f(c);
  }
}

/// The last case of each group that `same` tells: the smallest structures.
template <class Same, class F>
void for_each_last(Same&& same, F&& f) {
  const auto& cases = encoding_cases();
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (i + 1 < cases.size() && same(cases[i], cases[i + 1])) continue;
    SCOPED_TRACE(cases[i].name());
    f(cases[i]);
  }
}

/// One case of each encoding and filter. Compiling shaders is what these tests take their time for.
template <class F>
void for_each_filter(F&& f) {
  for_each_last([](const EncodingCase& a, const EncodingCase& b) { return a.encoding == b.encoding && a.filter == b.filter; }, f);
}

/// One case of each encoding with one of its filters, in another test another one: for what knows no filter, drawn on GL. In the
/// full tier, and of a slice, as for_each_filter.
template <class F>
void for_each_chosen(F&& f) {
  for_each_filter([&](const EncodingCase& c) {
    const std::span<const Filter> filters = c.encoding->filters();
    const auto number = static_cast<std::size_t>(std::find(filters.begin(), filters.end(), c.filter) - filters.begin());
    if (!case_slice().empty() || chosen(turn_of_test(), number, filters.size())) f(c);
  });
}

/// One case of each encoding: for the dearest shaders, where the CPU builds of the same text are asked with every filter.
template <class F>
void for_each_encoding(F&& f) {
  for_each_last([](const EncodingCase& a, const EncodingCase& b) { return a.encoding == b.encoding; }, f);
}

}  // namespace amrtex::test
