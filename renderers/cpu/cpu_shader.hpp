// CpuField over a shader struct: the part that is the same for every encoding.
#pragma once

#include <fmt/format.h>

#include <set>

#include "renderers/cpu/cpu_field.hpp"
#include "shaders/portable_cpp.hpp"

namespace amrtex {

template <class Shader, class real>
class CpuShader final : public CpuField {
 public:
  void set(const std::vector<std::pair<std::string, int>>& defines, const UniformValues& uniforms,
           const std::vector<const HostTexture*>& textures) override {
    for (const auto& [name, member] : shader_.bindings.ints)
      if (name.starts_with("AMRTEX_")) *member = 0;  // as no part of the text that the scene leaves out
    for (const auto& [name, value] : defines)
      if (auto it = shader_.bindings.ints.find(name); it != shader_.bindings.ints.end()) *it->second = value;
    for (const UniformValue& u : uniforms) set_uniform(u);
    for (const HostTexture* t : textures)
      if (auto it = shader_.bindings.resources.find(t->name); it != shader_.bindings.resources.end()) it->second->bind(*t);
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

  void set_uniform(const UniformValue& u) {
    if (const auto* ints = std::get_if<std::vector<int>>(&u.numbers)) {
      if (auto it = shader_.bindings.ints.find(u.name); it != shader_.bindings.ints.end())
        std::copy(ints->begin(), ints->end(), it->second);
      return;
    }
    const auto& reals = std::get<std::vector<double>>(u.numbers);
    if (auto it = shader_.bindings.doubles.find(u.name); it != shader_.bindings.doubles.end())
      std::copy(reals.begin(), reals.end(), it->second);
    if (auto it = shader_.bindings.floats.find(u.name); it != shader_.bindings.floats.end())
      std::transform(reals.begin(), reals.end(), it->second, [](double v) { return static_cast<float>(v); });
  }

  Shader shader_;
};

}  // namespace amrtex
