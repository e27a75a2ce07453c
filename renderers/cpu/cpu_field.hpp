// An encoding's own GLSL, compiled as C++, over its host data.
#pragma once

#include <array>
#include <memory>

#include "renderers/bindings/shader_assembler.hpp"
#include "renderers/bindings/uniforms.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

struct ProbeResult {
  bool found = false;  ///< is there a value?
  double value = 0;    ///< in field units; of CpuField::sample a number in the units that shaders compute in
  int level = -1;
};

/// Part of the domain in which one locate() of the encoding stays valid.
struct FieldRegion {
  Box cells;  ///< finest cells
  int level = 0;
  bool holds_mesh = false;  ///< else the march steps over it
};

/// The shader text of one encoding in one precision. Thread-safe once set up.
class CpuField {
 public:
  virtual ~CpuField() = default;
  /// Binds defines, uniforms and host data by name. `key`: that of the GLSL shader whose work is to be done. Throws Error naming
  /// what that shader's text declares and nobody provides. The textures' data must outlive this object.
  virtual void set(const ShaderKey& key, const UniformValues& uniforms, const std::vector<const HostTexture*>& textures) = 0;
  /// Field number `field`; throws UsageError where there are not so many.
  virtual ProbeResult sample(const Vec3i& finest_cell, const Vec3d& fraction, int field = 0) const = 0;
  /// What locate() answers at the lower corner of a cell of the finest level.
  virtual FieldRegion region_at(const Vec3i& finest_cell) const = 0;
  /// Ray of the pixel whose centre is (x, y) from the lower left, in pixels.
  virtual std::array<double, 4> trace(double x, double y) const = 0;
};

enum class Precision { single_precision, double_precision };

/// Throws when the encoding has no CPU build (cannot happen for a registered one).
std::unique_ptr<CpuField> make_cpu_field(std::string_view encoding, Precision precision);

}  // namespace amrtex
