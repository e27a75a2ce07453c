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

/// One case of each encoding.
template <class F>
void for_each_encoding(F&& f) {
  for_each_last([](const EncodingCase& a, const EncodingCase& b) { return a.encoding == b.encoding; }, f);
}

/// Pairs of an encoding and a filter that a test draws on GL: `count` of those that it is about, each of another encoding, in
/// another test others. All of them in the full tier and of a slice. A feature is one text, which its CPU build asks with every
/// case in no time, while GL compiles it for seconds. That GL agrees needs a pair or two a feature: conformance_test and
/// differential_test ask it for the part of the text that is each case's own.
class GlPairs {
 public:
  template <class Takes>
  GlPairs(std::size_t count, Takes&& takes) {
    for_each_filter([&](const EncodingCase& c) {
      if (takes(c)) all_.push_back(c);
    });
    std::vector<EncodingCase> left = all_;
    if (full_tier() || !case_slice().empty()) std::swap(pairs_, left);
    for (std::size_t turn = turn_of_test(); pairs_.size() < count && !left.empty(); turn /= 7) {
      pairs_.push_back(left[turn % left.size()]);
      std::erase_if(left, [&](const EncodingCase& c) { return c.encoding == pairs_.back().encoding; });
    }
  }
  explicit GlPairs(std::size_t count) : GlPairs(count, [](const EncodingCase&) { return true; }) {}

  bool has(const EncodingCase& c) const {
    return std::any_of(pairs_.begin(), pairs_.end(), [&](const EncodingCase& pair) { return pair.name() == c.name(); });
  }

  /// Calls f with each pair, and with its number where f takes one.
  template <class F>
  void for_each(F&& f) const {
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      SCOPED_TRACE(pairs_[i].name());
      if constexpr (std::is_invocable_v<F, const EncodingCase&, std::size_t>)
        f(pairs_[i], i);
      else
        f(pairs_[i]);
    }
  }
  /// Calls f(case, false) for all that the test is about, for its picture on the CPU, and f(case, true) for each pair.
  template <class F>
  void for_each_and_on_cpu(F&& f) const {
    for (const EncodingCase& c : all_) {
      SCOPED_TRACE(c.name());
      f(c, false);
      if (has(c)) f(c, true);
    }
  }

 private:
  std::vector<EncodingCase> all_, pairs_;
};

/// Can a consumer draw the structure box by box?
inline bool gives_boxes(const AmrHierarchy& h, const EncodingCase& c) {
  try {
    return !build(h, c, {.draw_boxes = true}).draw_tree.empty();
  } catch (const UnsupportedError&) {
    return false;
  }
}

/// Does f take values between those of cells?
inline bool interpolating(const EncodingCase& c) { return interpolates(c.filter); }

/// On GL, or by the CPU build of the same text in floats.
inline Picture draw_on(bool gl, const AmrHierarchy& h, const EncodedField& field, const Scene& scene) {
  return gl ? draw(context(ContextKind::egl), h, field, scene) : render_on_cpu(h, field, scene, false);
}

/// Of what is drawn with each of several settings, those of a pair's place among GlPairs: in turn, and all in the full tier.
inline bool in_turn(std::size_t setting, std::size_t pair, std::size_t settings) {
  return full_tier() || !case_slice().empty() || setting == pair % settings;
}

}  // namespace amrtex::test
