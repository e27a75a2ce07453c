// Uniform values by name: what a consumer tells a shader, on the GL context and on the CPU.
#pragma once

#include <string>
#include <variant>
#include <vector>

namespace amrtex {

/// Numbers of one uniform: its components, or the elements of an array of scalars.
/// Reals are handed over in double; the target rounds them to its own precision.
struct UniformValue {
  std::string name;
  std::variant<std::vector<int>, std::vector<double>> numbers;
  bool ray_precision = false;  ///< a ray_real or ray_vec3: double in the shader when AMRTEX_RAY_DOUBLE is 1
};
using UniformValues = std::vector<UniformValue>;

}  // namespace amrtex
