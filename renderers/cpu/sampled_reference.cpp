#include "renderers/cpu/sampled_reference.hpp"

#include "renderers/cpu/cpu_picture.hpp"

namespace amrtex {

Picture render_sampled(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, const FieldValues& values) {
  Scene all = scene;
  all.settings.skip = false;
  const FieldValues numbers = [&](const FinestPosition& p, int number) -> std::optional<double> {
    const std::optional<double> value = values(p, number);
    return value ? std::optional(field.scale_of(number).units.number(*value)) : std::nullopt;
  };
  const auto sampler = make_sampler(field.encoding, numbers);
  return trace_on_cpu(*sampler, geometry, field, all);
}

}  // namespace amrtex
