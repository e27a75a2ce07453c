// What consumers draw: a built structure of a mesh on a context.
#pragma once

#include "renderers/gpu/gpu_field.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

/// One structure: what was asked for when it was built, its data, and their objects on a context. Consumers keep its address.
struct Structure {
  /// Uploads; throws as GpuField. `built_from`: the request that `built` answers. What draws reads the data alone; what builds
  /// the same once more, with one thing changed, reads the request.
  Structure(Context& context, EncodedField built, BuildRequest built_from = {})
      : request(std::move(built_from)), field(std::move(built)), gpu(field, context) {}

  BuildRequest request;
  EncodedField field;
  GpuField gpu;
};

}  // namespace amrtex
