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

}  // namespace amrtex
