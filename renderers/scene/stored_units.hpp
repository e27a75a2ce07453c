// Scenes in the units in which a field's values are stored: curves and isovalues, mapped in double.
#pragma once

#include <functional>

#include "renderers/scene/scene.hpp"
#include "structures/mesh/value_units.hpp"

namespace amrtex {

/// The curve over numbers in `units` in place of values: the same to the bit where they are plain. What no float holds is cut off
/// where floats end, with what the curve has there. Over the log10 of values with an offset it is a curve of lines, off by less
/// than 2^-20 of the numbers' range.
TransferFunction in_units(const TransferFunction& transfer_function, const ValueUnits& units);

/// The scene with its curves and isovalues over numbers in each field's own units: `units` of number 0 is the drawn field's,
/// further ones are those of `more_fields`. Colours of surfaces stay over values.
Scene in_units(const Scene& scene, const std::function<ValueUnits(int)>& units);

/// Throws UnsupportedError where the curve tells values apart over a logarithmic axis that no float holds in `units`, and such
/// values may be there: smallest magnitude `least`.
void require_log_axis(const TransferFunction& transfer_function, const ValueUnits& units, double least);

}  // namespace amrtex
