// The raycaster: one full-screen pass through the contract.
#pragma once

#include "renderers/consumers/consumer.hpp"
#include "renderers/context/gpu_timer.hpp"
#include "renderers/cpu/cpu_field.hpp"
#include "renderers/gpu/draw_target.hpp"

namespace amrtex {

class Raycaster final : public Consumer {
 public:
  /// The field, its GPU copy and the context must outlive this object.
  Raycaster(Context& context, const AmrHierarchy& hierarchy, const EncodedField& field, const GpuField& gpu, const Scene& scene);

  FrameTime draw() override;
  /// The last picture drawn: 4 channels for dvr, else 1.
  Picture read() const override;
  WorkCounts count() override;
  const std::string& shader_hash() const override { return program_.hash(); }
  const Program& program() const { return program_; }
  bool transfer_exact() const override { return resources_.transfer_exact(); }
  double triangle_seconds() const override { return resources_.triangle_seconds(); }

 private:
  Program make_program(bool counting) const;

  Context* context_;
  const GpuField* gpu_;
  Scene scene_;
  SceneResources resources_;
  Program program_;
  DrawTarget target_;
  GpuTimer timer_;
};

/// The same text on the CPU, all cores.
Picture render_on_cpu(const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene, bool double_precision);
/// The same with a CPU build of one's own.
Picture trace_on_cpu(CpuField& cpu, const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene);

}  // namespace amrtex
