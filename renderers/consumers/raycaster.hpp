// The raycaster: one full-screen pass through the contract.
#pragma once

#include "renderers/consumers/consumer.hpp"
#include "renderers/consumers/scene_resources.hpp"
#include "renderers/gpu/draw_target.hpp"
#include "renderers/gpu/gpu_timer.hpp"
#include "renderers/gpu/structure.hpp"

namespace amrtex {

class Raycaster final : public Consumer {
 public:
  /// The structure and the context must outlive this object.
  Raycaster(Context& context, const DomainGeometry& geometry, const Structure& structure, const Scene& scene);

  FrameTime draw() override;
  double gpu_ms_a_draw(int draws) override;
  /// The last picture drawn: 4 channels for dvr, else 1.
  Picture read() const override;
  WorkCounts count() override;
  std::vector<PixelWork> count_pixels() override;
  const std::string& shader_hash() const override { return program_.hash(); }
  const Program& program() const { return program_; }
  bool transfer_exact() const override { return resources_.transfer_exact(); }
  double triangle_seconds() const override { return resources_.triangle_seconds(); }
  std::int64_t leap_bytes() const override { return resources_.bytes_of("leap_distances"); }

 private:
  Program make_program(bool counting) const;
  void start_rays(const DrawTarget& target, const Program& program) const;

  Context* context_;
  const GpuField* gpu_;
  Scene scene_;
  SceneResources resources_;
  Program program_;
  DrawTarget target_;
  GpuTimer timer_;
};

}  // namespace amrtex
