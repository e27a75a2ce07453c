// Compute shaders that tests write, over the text of an encoding.
#pragma once

#include <initializer_list>
#include <vector>

#include "renderers/bindings/shader_assembler.hpp"
#include "renderers/gpu/gpu_field.hpp"
#include "renderers/gpu/program.hpp"
#include "shaders/shader_library.hpp"

namespace amrtex::test {

/// An array that the shader reads.
struct ProbeInput {
  const char* block;
  const void* data;
  std::size_t bytes;

  template <class T>
  ProbeInput(const char* name, const std::vector<T>& values)
      : block(name), data(values.data()), bytes(values.size() * sizeof(T)) {}
};

inline GlBuffer probe_buffer(Context& gl, const void* data, std::size_t bytes) {
  GlBuffer buffer = make_buffer(gl);
  gl.gl().NamedBufferStorage(buffer.id(), static_cast<GLsizeiptr>(bytes), data, 0);
  return buffer;
}

/// What the shader `text` finds at each of `count` places. It has one invocation a place, in groups of 64, includes the contract,
/// declares `uniform int u_count`, reads the inputs and writes `results_block`.
template <class Result>
std::vector<Result> run_probe(Context& gl, const EncodedField& field, const UniformValues& uniforms, const char* text,
                              std::size_t count, std::initializer_list<ProbeInput> inputs) {
  ShaderFiles files{{"test_probe.comp", text}};
  for (const ShaderFile& f : shader_files()) files.emplace(f.path, f.text);
  ShaderKey key;
  key.entry = "test_probe.comp";
  key.use(field.shader).define("AMRTEX_RAY_DOUBLE", 0);
  Program program(gl, assemble_shader(key, files));
  std::vector<Result> results(count);
  const std::size_t bytes = count * sizeof(Result);
  const GlBuffer result_buffer = probe_buffer(gl, results.data(), bytes);
  const GpuField gpu(field, gl);
  program.use();
  for (const UniformValue& u : uniforms) program.set_optional(u);
  program.set("u_count", static_cast<int>(count));
  std::vector<GlBuffer> buffers;
  for (const ProbeInput& input : inputs) {
    buffers.push_back(probe_buffer(gl, input.data, input.bytes));
    program.bind_buffer(input.block, buffers.back().id());
  }
  program.bind_buffer("results_block", result_buffer.id());
  gpu.bind(program);
  gl.gl().DispatchCompute(static_cast<GLuint>((count + 63) / 64), 1, 1);
  gl.gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  gl.gl().GetNamedBufferSubData(result_buffer.id(), 0, static_cast<GLsizeiptr>(bytes), results.data());
  gl.check("probing");
  return results;
}

}  // namespace amrtex::test
