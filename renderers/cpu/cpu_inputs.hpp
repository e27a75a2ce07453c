// Defines, uniforms and host data of a shader's text that is compiled as C++.
#pragma once

#include <vector>

#include "renderers/bindings/shader_assembler.hpp"
#include "renderers/bindings/uniforms.hpp"
#include "shaders/portable_cpp.hpp"

namespace amrtex {

/// Sets what `bindings` name. The C++ holds every branch of every #if; what is needed is what the GLSL of `key` declares. Throws
/// Error naming a define, uniform, texture or buffer of it that is not given, and a uniform of which too many or too few numbers
/// are.
void set_inputs(portable::Bindings& bindings, const ShaderKey& key, const UniformValues& uniforms,
                const std::vector<const HostTexture*>& textures);

}  // namespace amrtex
