#include "renderers/consumers/raycaster.hpp"

#include <tbb/parallel_for.h>

#include <chrono>

namespace amrtex {
namespace {

const char* entry_of(const Scene& scene) { return scene.settings.triangles.empty() ? "raycast.frag" : "raycast_triangles.frag"; }

}  // namespace

Raycaster::Raycaster(Context& context, const AmrHierarchy& hierarchy, const EncodedField& field, const GpuField& gpu,
                     const Scene& scene)
    : context_(&context),
      gpu_(&gpu),
      scene_(scene),
      resources_(context, hierarchy, field, scene),
      program_(make_program(false)),
      target_(context, scene.settings.width, scene.settings.height),
      timer_(context) {}

Program Raycaster::make_program(bool counting) const {
  ShaderKey vertex;
  vertex.entry = "fullscreen.vert";
  return {*context_, assemble_shader(vertex), assemble_shader(resources_.shader_key(entry_of(scene_), counting))};
}

FrameTime Raycaster::draw() {
  context_->make_current();
  resources_.bind(program_, *gpu_);
  context_->gl().Finish();
  const auto start = std::chrono::steady_clock::now();
  timer_.begin();
  target_.draw(program_);
  timer_.end();
  context_->gl().Finish();
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
  context_->check("drawing a frame");
  return {wall.count(), timer_.milliseconds()};
}

Picture Raycaster::read() const { return target_.read_picture(scene_.settings.picture_channels()); }

WorkCounts Raycaster::count() {
  Program counting = make_program(true);
  const DrawTarget target(*context_, scene_.settings.width, scene_.settings.height, true);
  resources_.bind(counting, *gpu_);
  target.clear();
  target.draw(counting);
  WorkCounts counts;
  for (const glm::uvec4& c : target.read_counters()) {
    counts.samples += c.x;
    counts.regions += c.y;
    counts.regions_skipped += c.z;
    counts.rays += c.w;
  }
  context_->check("counting samples");
  return counts;
}

Picture render_on_cpu(const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene, bool double_precision) {
  const auto cpu = make_cpu_field(field.encoding, double_precision ? Precision::double_precision : Precision::single_precision);
  return trace_on_cpu(*cpu, hierarchy, field, scene);
}

Picture trace_on_cpu(CpuField& cpu, const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene) {
  const SceneBindings bindings = bind_scene(hierarchy, field, scene);
  std::vector<const HostTexture*> textures;
  for (const HostTexture& t : field.textures) textures.push_back(&t);
  for (const HostTexture& t : bindings.buffers) textures.push_back(&t);
  cpu.set(scene_key(entry_of(scene), field, bindings, false), bindings.uniforms, textures);
  const RenderSettings& s = scene.settings;
  Picture picture(s.width, s.height, s.picture_channels());
  tbb::parallel_for(0, s.height, [&](int y) {
    for (int x = 0; x < s.width; ++x) {
      const auto value = cpu.trace(x + 0.5, s.height - y - 0.5);
      std::copy_n(value.begin(), picture.channels, picture.pixel(x, y));
    }
  });
  return picture;
}

}  // namespace amrtex
