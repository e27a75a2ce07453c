#include "renderers/consumers/scene_resources.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

GlBuffer upload(Context& context, const HostTexture& host) {
  if (host.bytes() > context.info().max_buffer_bytes)
    throw UnsupportedError(fmt::format("{}: {} bytes; a storage buffer of this context holds at most {}", host.name, host.bytes(),
                                       context.info().max_buffer_bytes));
  GlBuffer buffer = make_buffer(context);
  context.gl().NamedBufferStorage(buffer.id(), static_cast<GLsizeiptr>(host.data.size()), host.data.data(), 0);
  context.check("uploading " + host.name);
  return buffer;
}

}  // namespace

SceneResources::SceneResources(Context& context, const DomainGeometry& geometry, const EncodedField& field, const Scene& scene,
                               LeapMap leaps)
    : field_(&field), bindings_(bind_scene(geometry, field, scene, leaps)) {
  for (const HostTexture& b : bindings_.buffers) buffers_.push_back(upload(context, b));
}

void SceneResources::bind(Program& program, const GpuField& gpu) const {
  program.use();
  for (const UniformValue& u : bindings_.uniforms) program.set_optional(u);
  for (std::size_t i = 0; i < buffers_.size(); ++i) program.bind_buffer(bindings_.buffers[i].name + "_block", buffers_[i].id());
  gpu.bind(program);
}

int SceneResources::buffer_count() const {
  const auto is_buffer = [](const HostTexture& t) { return t.kind == HostTexture::Kind::buffer; };
  return static_cast<int>(std::count_if(field_->textures.begin(), field_->textures.end(), is_buffer) + std::ssize(buffers_));
}

std::int64_t SceneResources::bytes_of(std::string_view buffer) const {
  const auto it =
      std::find_if(bindings_.buffers.begin(), bindings_.buffers.end(), [&](const HostTexture& b) { return b.name == buffer; });
  return it == bindings_.buffers.end() ? 0 : it->bytes();
}

}  // namespace amrtex
