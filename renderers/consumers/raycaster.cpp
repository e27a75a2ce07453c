#include "renderers/consumers/raycaster.hpp"

#include <chrono>

#include "renderers/bindings/picture_units.hpp"

namespace amrtex {

Raycaster::Raycaster(Context& context, const DomainGeometry& geometry, const Structure& structure, const Scene& scene)
    : context_(&context),
      gpu_(&structure.gpu),
      scene_(scene),
      resources_(context, geometry, structure.field, scene),
      program_(make_program(false)),
      target_(context, scene.settings.width, scene.settings.height),
      timer_(context) {}

Program Raycaster::make_program(bool counting) const {
  ShaderKey vertex;
  vertex.entry = "fullscreen.vert";
  return {*context_, assemble_shader(vertex), assemble_shader(resources_.shader_key(raycast_entry(scene_), counting))};
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
  target.draw(counting);
  std::vector<PixelWork> pixels;
  for (const glm::uvec4& c : target.read_counters())  // c.w: 0 where the ray passes by, 1 without a sample, 2 + level
    pixels.push_back({c.w > 0, c.x, c.y, c.z, c.w > 1 ? static_cast<int>(c.w) - 2 : -1});
  context_->check("counting samples");
  return pixels;
}

}  // namespace amrtex
