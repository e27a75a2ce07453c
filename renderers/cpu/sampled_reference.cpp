#include "renderers/cpu/sampled_reference.hpp"

#include "renderers/cpu/cpu_picture.hpp"

namespace amrtex {

Picture render_sampled(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, const FieldValues& values) {
  Scene all = scene;
  all.settings.skip = false;
  const auto sampler = make_sampler(field.encoding, values);
  return trace_on_cpu(*sampler, geometry, field, all);
}

}  // namespace amrtex
