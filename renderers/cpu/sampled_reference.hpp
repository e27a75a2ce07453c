// Pictures of values from elsewhere at an encoding's own sample places: what is left of a picture's error
// when its encoding, storage, arithmetic and driver do none, that of the step.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string_view>

#include "renderers/cpu/cpu_field.hpp"
#include "structures/mesh/domain_geometry.hpp"
#include "structures/mesh/finest_position.hpp"

namespace amrtex {

/// Value of field number `number` of a structure at a place; nullopt where there is none. Called from several threads.
using FieldValues = std::function<std::optional<double>(const FinestPosition& p, int number)>;

/// The march in double precision over the regions of one encoding. `values`, numbers in the fields' units, must outlive it.
/// Gradients of surfaces are differences of `values`, whatever the encoding stores.
std::unique_ptr<CpuField> make_sampler(std::string_view encoding, const FieldValues& values);

/// The scene drawn from `values` where `field` would be sampled, on all cores. No region is skipped, so
/// that no value range of the encoding counts; skipping changes no picture.
Picture render_sampled(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, const FieldValues& values);

}  // namespace amrtex
