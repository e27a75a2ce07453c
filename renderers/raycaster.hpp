// The raycaster: one full-screen pass through the contract.
#pragma once

#include <cstdint>

#include "renderers/cpu_field.hpp"
#include "renderers/draw_target.hpp"
#include "renderers/gpu_field.hpp"
#include "renderers/gpu_timer.hpp"
#include "renderers/scene_bindings.hpp"

namespace amrtex {

/// What the shader itself counted.
struct WorkCounts {
  std::int64_t rays = 0;  ///< that met the mesh's domain
  std::int64_t samples = 0;
  std::int64_t regions = 0;
  std::int64_t regions_skipped = 0;
};

struct FrameTime {
  double wall_ms = 0;  ///< around draw and glFinish
  double gpu_ms = 0;   ///< GL_TIME_ELAPSED
};

class Raycaster {
 public:
  /// The field, its GPU copy and the context must outlive this object.
  Raycaster(Context& context, const AmrHierarchy& hierarchy, const EncodedField& field, const GpuField& gpu, const Scene& scene);

  FrameTime draw();
  /// The last picture drawn: 4 channels for dvr, else 1.
  Picture read() const;
  /// Draws once more with the counting variant of the shader.
  WorkCounts count();
  const std::string& shader_hash() const { return program_.hash(); }
  const Program& program() const { return program_; }
  bool transfer_exact() const { return bindings_.transfer_exact; }

 private:
  Program make_program(bool counting) const;
  void bind(Program& program) const;

  Context* context_;
  const EncodedField* field_;
  const GpuField* gpu_;
  Scene scene_;
  SceneBindings bindings_;
  std::vector<GlBuffer> buffers_;
  Program program_;
  DrawTarget target_;
  GpuTimer timer_;
};

/// The same text on the CPU, all cores.
Picture render_on_cpu(const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene, bool double_precision);
/// The same with a CPU build of one's own.
Picture trace_on_cpu(CpuField& cpu, const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene);

}  // namespace amrtex
