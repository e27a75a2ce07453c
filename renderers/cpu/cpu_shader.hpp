// CpuField over a shader struct: the part that is the same for every encoding.
#pragma once

#include <fmt/format.h>

#include "renderers/cpu/cpu_field.hpp"
#include "renderers/cpu/cpu_inputs.hpp"
#include "shaders/portable_cpp.hpp"

namespace amrtex {

template <class Shader, class real>
class CpuShader final : public CpuField {
 public:
  void set(const ShaderKey& key, const UniformValues& uniforms, const std::vector<const HostTexture*>& textures) override {
    set_inputs(shader_.bindings, key, uniforms, textures);
  }

  ProbeResult sample(const Vec3i& finest_cell, const Vec3d& fraction, int field) const override {
    if (field < 0 || field >= text().AMRTEX_FIELDS)
      throw UsageError(fmt::format("no field number {}; the structure holds {}", field, text().AMRTEX_FIELDS));
    typename Shader::Position p;
    p.cell = finest_cell;
    p.fraction = glm::vec<3, real>(fraction);
    typename Shader::FieldSample s;
    const bool found = text().sample_value(p, field, s);
    return {found, static_cast<double>(s.value), s.level};
  }

  FieldRegion region_at(const Vec3i& finest_cell) const override {
    typename Shader::Position p;
    p.cell = finest_cell;
    p.fraction = glm::vec<3, real>(0);
    typename Shader::Region r;
    const bool found = text().locate(p, r);
    return {{r.lower, r.upper}, r.level, found};
  }

  std::array<double, 4> trace(double x, double y) const override {
    typename Shader::Ray ray;
    typename Shader::Accumulation a = text().empty_accumulation();
    const glm::vec<2, real> pixel(x, y);
    bool met = false;
    glm::vec<4, real> c;
    if (text().AMRTEX_TRIANGLES != 0) {  // as raycast_triangles.frag, else as raycast.frag
      c = text().march_to_triangle(pixel, a, met);
    } else {
      met = text().camera_ray(pixel, ray);
      c = met ? text().march_ray(ray, a) : text().missed_picture();
    }
    return {static_cast<double>(c.x), static_cast<double>(c.y), static_cast<double>(c.z), static_cast<double>(c.w)};
  }

  /// For what is no define, uniform or texture; before the first ray.
  Shader& shader() { return shader_; }

 private:
  // GLSL knows no const functions; none of its functions writes to a uniform
  Shader& text() const { return const_cast<Shader&>(shader_); }

  Shader shader_;
};

}  // namespace amrtex
