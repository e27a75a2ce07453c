// What a scene adds to a structure's part of a program: defines, uniforms, tables on the GPU.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/gpu/gl_objects.hpp"
#include "renderers/gpu/gpu_field.hpp"
#include "renderers/gpu/program.hpp"

namespace amrtex {

class SceneResources {
 public:
  /// `field` must outlive the object.
  SceneResources(Context& context, const DomainGeometry& geometry, const EncodedField& field, const Scene& scene,
                 LeapMap leaps = LeapMap::where_something_is_hidden);

  ShaderKey shader_key(const std::string& entry, bool counting) const { return scene_key(entry, *field_, bindings_, counting); }
  /// Uses the program, sets what the scene tells it and binds the field.
  void bind(Program& program, const GpuField& gpu) const;
  /// Storage buffers of field and scene.
  int buffer_count() const;
  /// Of a buffer that the scene adds; 0 where it does not.
  std::int64_t bytes_of(std::string_view buffer) const;
  const PictureUnits& picture_units() const { return bindings_.picture; }
  bool transfer_exact() const { return bindings_.transfer_exact; }
  double triangle_seconds() const { return bindings_.triangle_seconds; }

 private:
  const EncodedField* field_;
  SceneBindings bindings_;
  std::vector<GlBuffer> buffers_;
};

}  // namespace amrtex
