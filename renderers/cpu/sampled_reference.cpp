#include "renderers/cpu/sampled_reference.hpp"

#include "renderers/consumers/raycaster.hpp"

namespace amrtex {

Picture render_sampled(const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene, const FieldValues& values) {
  Scene all = scene;
  all.settings.skip = false;
  const auto sampler = make_sampler(field.encoding, values);
  return trace_on_cpu(*sampler, hierarchy, field, all);
}

}  // namespace amrtex
