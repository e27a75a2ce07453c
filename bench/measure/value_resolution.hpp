// Curves and isovalues that tell values apart which a structure stores as one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

/// Bounds of what the rounding of stored values does, where it does much.
struct ValueResolution {
  std::optional<double> extinction;  ///< largest error of an extinction, in parts of the curve's largest
  std::optional<double> isovalue;    ///< largest shift of an isovalue, field units
  std::vector<std::string> warnings() const;
  Json json() const;
  bool fine() const { return !extinction && !isovalue; }
};

/// Of the drawn field. An extinction is told where it is off by more than an eighth of the largest, an isovalue where it is by
/// more than an eighth of its distance to another one or to the ends of the field's range.
ValueResolution value_resolution(const EncodedField& field, const Scene& scene);

}  // namespace amrtex
