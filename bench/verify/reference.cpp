// The double reference itself, which no other suite can judge: stiff media in closed form, and what it says of its own error.
#include <array>

#include "bench/verify/stiff_media.hpp"
#include "bench/verify/verify.hpp"

namespace amrtex::verify {
namespace {

constexpr std::array<FilterDefinition, 3> kLinear{{{Filter::linear_lod}, {Filter::linear_page, 4}, {Filter::basis}}};

void closed_forms(VerifyContext& v) {
  const AmrHierarchy h = column();
  for (const FilterDefinition& d : kLinear) {
    const HierarchyReference reference(h, 0, d);
    for (const Medium& m : stiff_media())
      v.once(fmt::format("6 the reference, {}, {}: closed form, and the error that it states", m.name, filter_name(d.filter)), [&] {
        const ReferencePicture drawn = reference.draw(one_ray(m.tf));
        const double found = off(drawn, m);
        return holds(found <= *drawn.error + 4e-15 && *drawn.error <= ReferenceTolerance{}.value,
                     fmt::format("<= its own {} <= {}", format_number(*drawn.error), format_number(ReferenceTolerance{}.value)),
                     format_number(found));
      });
  }
}

void fixed_steps(VerifyContext& v) {
  const AmrHierarchy h = column();
  const HierarchyReference reference(h, 0, {Filter::linear_lod});
  v.once("6 control: the rule of fixed steps, 1/16 of a cell: off in stiff media",
         [&] { return above(over_stiff_media(reference, 1.0 / 16).first, 1e-3); });
  v.once("6 the reference: evaluations of the field in stiff media, against the fixed step of 1/16", [&] {
    const auto taken = static_cast<double>(over_stiff_media(reference, {}).second);
    return at_most(taken / static_cast<double>(over_stiff_media(reference, 1.0 / 16).second), 8);
  });
}

}  // namespace

void reference_suite(VerifyContext& v) {
  closed_forms(v);
  fixed_steps(v);
}

}  // namespace amrtex::verify
