// What a program is told before it draws: defines, uniforms and buffers, the same for the GL context and the CPU build of its
// text.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "renderers/bindings/uniforms.hpp"
#include "structures/common/host_texture.hpp"

namespace amrtex {

/// What a shader's picture stands for: offset + scale * its value; of line integrals with an offset, scale * its value + offset *
/// length * (the sum of the two channels behind).
struct PictureUnits {
  double scale = 1;   ///< a power of two
  double offset = 0;  ///< of the field's values
  double length = 0;  ///< world length of a unit of ray length; 0 where no lengths are drawn
};

struct SceneBindings {
  std::vector<std::pair<std::string, int>> defines;
  UniformValues uniforms;
  std::vector<HostTexture> buffers;  ///< the transfer function's tables, where it has too many points; triangles
  PictureUnits picture;
  bool transfer_exact = true;   ///< evaluated from its points; else from a table of 4096 bins
  double triangle_seconds = 0;  ///< that finding where rays meet triangles took

  void define(std::string_view name, int value) { defines.emplace_back(name, value); }
  void set(std::string name, double value) { uniforms.push_back({std::move(name), std::vector<double>{value}}); }
  void set(std::string name, int value) { uniforms.push_back({std::move(name), std::vector<int>{value}}); }
  void set(std::string name, std::vector<double> values) { uniforms.push_back({std::move(name), std::move(values)}); }
  /// Of a ray: in double where rays are.
  void set_ray(std::string name, std::vector<double> values) { uniforms.push_back({std::move(name), std::move(values), true}); }
};

}  // namespace amrtex
