#include "renderers/cpu/cpu_picture.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "renderers/bindings/picture_units.hpp"
#include "renderers/bindings/scene_bindings.hpp"

namespace amrtex {

Picture render_on_cpu(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, bool double_precision) {
  const auto cpu = make_cpu_field(field.encoding, double_precision ? Precision::double_precision : Precision::single_precision);
  return trace_on_cpu(*cpu, geometry, field, scene);
}

Picture trace_on_cpu(CpuField& cpu, const DomainGeometry& geometry, const EncodedField& field, const Scene& scene) {
  const SceneBindings bindings = bind_scene(geometry, field, scene);
  std::vector<const HostTexture*> textures;
  for (const HostTexture& t : field.textures) textures.push_back(&t);
  for (const HostTexture& t : bindings.buffers) textures.push_back(&t);
  cpu.set(scene_key(raycast_entry(scene), field, bindings, false), bindings.uniforms, textures);
  const RenderSettings& s = scene.settings;
  Picture picture(s.width, s.height, drawn_channels(bindings.picture, s.picture_channels()));
  tbb::parallel_for(0, s.height, [&](int y) {
    for (int x = 0; x < s.width; ++x) {
      const auto value = cpu.trace(x + 0.5, s.height - y - 0.5);
      std::copy_n(value.begin(), picture.channels, picture.pixel(x, y));
    }
  });
  return in_picture_units(std::move(picture), bindings.picture);
}

}  // namespace amrtex
