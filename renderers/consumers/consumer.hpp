// What draws a built field: one interface for the raycaster and for those that draw box by box.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "renderers/gpu/gpu_field.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/scene_bindings.hpp"

namespace amrtex {

/// What the shader itself counted, and how often the consumer drew.
struct WorkCounts {
  std::int64_t rays = 0;  ///< that met the drawn box of the domain; of consumers that draw box by box, that have a sample
  std::int64_t samples = 0;
  std::int64_t regions = 0;          ///< visits of rays; of slices, pixels on a slice
  std::int64_t regions_skipped = 0;  ///< of these; an invisible box is not drawn at all and not counted
  std::int64_t passes = 1;           ///< draws a frame, each blended over those before
};

struct FrameTime {
  double wall_ms = 0;  ///< from before the host's own work for the frame until glFinish
  double gpu_ms = 0;   ///< GL_TIME_ELAPSED
};

class Consumer {
 public:
  virtual ~Consumer() = default;

  virtual FrameTime draw() = 0;
  /// The last picture drawn: 4 channels for colour, else 1.
  virtual Picture read() const = 0;
  /// Draws once more with the counting variant of the shader.
  virtual WorkCounts count() = 0;
  virtual const std::string& shader_hash() const = 0;
  /// Is the transfer function evaluated from its points, and not from a table?
  virtual bool transfer_exact() const = 0;
  /// That finding where rays meet the scene's triangles took, before the first draw; 0 where it has none.
  virtual double triangle_seconds() const { return 0; }
};

/// The scene's consumer. Throws UnsupportedError naming consumer and reason where it cannot draw the scene or the field. The
/// field, its GPU copy and the context must outlive it.
std::unique_ptr<Consumer> make_consumer(Context& context, const AmrHierarchy& hierarchy, const EncodedField& field,
                                        const GpuField& gpu, const Scene& scene);

/// Entry file with the defines of field and scene.
ShaderKey scene_key(const std::string& entry, const EncodedField& field, const SceneBindings& bindings, bool counting);

/// What the scene adds to the field's part of a program: defines, uniforms, tables on the GPU.
class SceneResources {
 public:
  SceneResources(Context& context, const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene);

  ShaderKey shader_key(const std::string& entry, bool counting) const { return scene_key(entry, *field_, bindings_, counting); }
  /// Uses the program, sets what the scene tells it and binds the field.
  void bind(Program& program, const GpuField& gpu) const;
  /// Storage buffers of field and scene.
  int buffer_count() const;
  bool transfer_exact() const { return bindings_.transfer_exact; }
  double triangle_seconds() const { return bindings_.triangle_seconds; }

 private:
  const EncodedField* field_;
  SceneBindings bindings_;
  std::vector<GlBuffer> buffers_;
};

}  // namespace amrtex
