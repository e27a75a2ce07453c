#include "renderers/consumers/raycaster.hpp"

#include <fmt/format.h>

#include <chrono>

#include "renderers/bindings/picture_units.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

Program make_compute_program(Context& context, const SceneResources& resources, const Scene& scene, bool counting) {
  GLint most = 0;
  context.make_current();
  context.gl().GetIntegerv(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS, &most);
  if (resources.buffer_count() > most)
    throw UnsupportedError(fmt::format("dispatch compute: a compute shader of this context reads at most {} storage buffers, the scene has {}",
                                       most, resources.buffer_count()));
  ShaderKey key = resources.shader_key("raycast.comp", counting);
  if (scene.settings.triangles.empty()) key.define("AMRTEX_TRIANGLES", 0);
  return {context, assemble_shader(key)};
}

}  // namespace

Raycaster::Raycaster(Context& context, const DomainGeometry& geometry, const Structure& structure, const Scene& scene)
    : context_(&context),
      gpu_(&structure.gpu),
      scene_(scene),
      resources_(context, geometry, structure.field, scene),
      program_(make_program(false)),
      target_(context, scene.settings.width, scene.settings.height),
      timer_(context) {}

Program Raycaster::make_program(bool counting) const {
  if (scene_.settings.dispatch == Dispatch::compute) return make_compute_program(*context_, resources_, scene_, counting);
  ShaderKey vertex;
  vertex.entry = "fullscreen.vert";
  return {*context_, assemble_shader(vertex), assemble_shader(resources_.shader_key(raycast_entry(scene_), counting))};
}

void Raycaster::start_rays(const DrawTarget& target, const Program& program) const {
  scene_.settings.dispatch == Dispatch::compute ? target.dispatch(program) : target.draw(program);
}

FrameTime Raycaster::draw() {
  context_->make_current();
  resources_.bind(program_, *gpu_);
  context_->gl().Finish();
  const auto start = std::chrono::steady_clock::now();
  timer_.begin();
  start_rays(target_, program_);
  timer_.end();
  context_->gl().Finish();
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
  context_->check("drawing a frame");
  return {wall.count(), timer_.milliseconds()};
}

double Raycaster::gpu_ms_a_draw(int draws) {
  context_->make_current();
  resources_.bind(program_, *gpu_);
  context_->gl().Finish();
  timer_.begin();
  for (int i = 0; i < draws; ++i) start_rays(target_, program_);
  timer_.end();
  const double all = timer_.milliseconds();
  context_->check("timing frames");
  return all / draws;
}

Picture Raycaster::read() const {
  const PictureUnits& units = resources_.picture_units();
  return in_picture_units(target_.read_picture(drawn_channels(units, scene_.settings.picture_channels())), units);
}

WorkCounts Raycaster::count() {
  WorkCounts counts;
  for (const PixelWork& p : count_pixels()) {
    counts.samples += p.samples;
    counts.regions += p.regions;
    counts.regions_skipped += p.regions_skipped;
    counts.rays += p.met ? 1 : 0;
  }
  return counts;
}

std::vector<PixelWork> Raycaster::count_pixels() {
  Program counting = make_program(true);
  const DrawTarget target(*context_, scene_.settings.width, scene_.settings.height, true);
  resources_.bind(counting, *gpu_);
  target.clear();
  start_rays(target, counting);
  std::vector<PixelWork> pixels;
  for (const glm::uvec4& c : target.read_counters())  // c.w: 0 where the ray passes by, 1 without a sample, 2 + level
    pixels.push_back({c.w > 0, c.x, c.y, c.z, c.w > 1 ? static_cast<int>(c.w) - 2 : -1});
  context_->check("counting samples");
  return pixels;
}

}  // namespace amrtex
