#include "renderers/consumers/probe.hpp"

#include <cmath>

#include "renderers/bindings/scene_bindings.hpp"

namespace amrtex {
namespace {

template <class T>
GlBuffer upload(Context& context, const std::vector<T>& values) {
  GlBuffer buffer = make_buffer(context);
  context.gl().NamedBufferStorage(buffer.id(), static_cast<GLsizeiptr>(values.size() * sizeof(T)), values.data(), 0);
  return buffer;
}

}  // namespace

FinestPosition position_on_gl(const FinestPosition& p) {
  return {p.cell, Vec3d(glm::min(Vec3f(p.fraction), Vec3f(std::nextafter(1.0F, 0.0F))))};
}

std::vector<ProbeResult> probe_on_gl(Context& context, const DomainGeometry& geometry, const Structure& structure,
                                     std::span<const FinestPosition> points, int number) {
  const EncodedField& field = structure.field;
  const ValueUnits units = field.scale_of(number).units;  // refuses a number that the shader could not index
  if (points.empty()) return {};
  std::vector<glm::ivec4> cells;
  std::vector<glm::vec4> fractions;
  for (const FinestPosition& p : points) {
    cells.emplace_back(p.cell, 0);
    fractions.emplace_back(Vec3f(p.fraction), 0.0F);
  }
  Program program(context, assemble_shader(probe_key(field, number)));
  const GlBuffer cell_buffer = upload(context, cells);
  const GlBuffer fraction_buffer = upload(context, fractions);
  std::vector<glm::vec4> values(points.size());
  const GlBuffer value_buffer = upload(context, values);
  program.use();
  for (const UniformValue& u : field_uniforms(geometry, field)) program.set_optional(u);
  program.set("u_probe_count", static_cast<int>(points.size()));
  program.bind_buffer("probe_cells_block", cell_buffer.id());
  program.bind_buffer("probe_fractions_block", fraction_buffer.id());
  program.bind_buffer("probe_values_block", value_buffer.id());
  structure.gpu.bind(program);
  context.gl().DispatchCompute(static_cast<GLuint>((points.size() + 63) / 64), 1, 1);
  context.gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  context.gl().GetNamedBufferSubData(value_buffer.id(), 0, static_cast<GLsizeiptr>(values.size() * sizeof(glm::vec4)),
                                     values.data());
  context.check("probing the field");
  std::vector<ProbeResult> results;
  for (const glm::vec4& v : values) results.push_back({v.y > 0.5F, units.value(static_cast<double>(v.x)), static_cast<int>(v.z)});
  return results;
}

std::vector<ProbeResult> probe_on_cpu(const DomainGeometry& geometry, const EncodedField& field, Precision precision,
                                      std::span<const FinestPosition> points, int number) {
  const auto cpu = make_cpu_field(field.encoding, precision);
  std::vector<const HostTexture*> textures;
  for (const HostTexture& t : field.textures) textures.push_back(&t);
  const ValueUnits units = field.scale_of(number).units;  // refuses a number that the text could not index
  cpu->set(probe_key(field, number), field_uniforms(geometry, field), textures);
  std::vector<ProbeResult> results;
  for (const FinestPosition& p : points) {
    results.push_back(cpu->sample(p.cell, p.fraction, number));
    results.back().value = units.value(results.back().value);
  }
  return results;
}

}  // namespace amrtex
