// What consumers draw: a built structure of a mesh on a context.
#pragma once

#include "renderers/gpu/gpu_field.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

/// What becomes of the host's arrays: they stay, or are given back piece by piece as the context takes them, so that memory never has
/// to hold them twice. What is told of them, their bytes among it, stays.
enum class HostArrays { keep, give_back };

/// One structure: what was asked for when it was built, its data, and their objects on a context. Consumers keep its address.
struct Structure {
  /// Uploads; throws as GpuField. `built_from`: the request that `built` answers. What draws reads the data alone; what builds
  /// the same once more, with one thing changed, reads the request.
  Structure(Context& context, EncodedField built, BuildRequest built_from = {}, HostArrays arrays = HostArrays::keep)
      : request(std::move(built_from)), field(std::move(built)), gpu(field, context, [this, arrays](std::size_t i, std::size_t first, std::size_t last) {
          if (arrays == HostArrays::give_back) give_back(field.textures[i], first, last);
        }) {}

  BuildRequest request;
  EncodedField field;
  GpuField gpu;
};

}  // namespace amrtex
