// A linked GL program whose uniforms, textures and buffers are set by name.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "renderers/gpu/gl_objects.hpp"
#include "renderers/bindings/shader_assembler.hpp"
#include "renderers/bindings/uniforms.hpp"

namespace amrtex {

/// Compiling or linking that fails throws Error with the driver's log, mapped back to
/// file names and lines. Names that the compiler removed are not active and not listed.
class Program {
 public:
  Program(Context& context, const AssembledShader& vertex, const AssembledShader& fragment);
  Program(Context& context, const AssembledShader& compute);

  /// Makes the context current and the program used.
  void use() const;
  GLuint id() const { return program_.id(); }
  Context& context() const { return *context_; }
  /// Of all stages' texts.
  const std::string& hash() const { return hash_; }
  /// Entry files of its stages, for messages.
  const std::string& name() const { return name_; }

  /// Throw Error where no such uniform is active, or where it has another type. An int
  /// may set int and bool uniforms; a span sets the first elements of an array, and those
  /// past its last active element are ignored: compilers cut arrays short.
  void set(std::string_view name, int value);
  void set(std::string_view name, unsigned value);
  void set(std::string_view name, float value);
  void set(std::string_view name, double value);
  void set(std::string_view name, const glm::vec2& value);
  void set(std::string_view name, const glm::vec3& value);
  void set(std::string_view name, const glm::vec4& value);
  void set(std::string_view name, const glm::ivec2& value);
  void set(std::string_view name, const glm::ivec3& value);
  void set(std::string_view name, const glm::ivec4& value);
  void set(std::string_view name, const glm::dvec2& value);
  void set(std::string_view name, const glm::dvec3& value);
  void set(std::string_view name, const glm::dvec4& value);
  void set(std::string_view name, std::span<const int> values);
  void set(std::string_view name, std::span<const float> values);
  void set(std::string_view name, std::span<const double> values);
  /// Numbers in whichever type the shader declares.
  void set(const UniformValue& value);

  /// As set, but false where no such uniform is active.
  template <class Value>
  bool set_optional(std::string_view name, const Value& value) {
    if (!has_uniform(name)) return false;
    set(name, value);
    return true;
  }
  bool set_optional(const UniformValue& value);

  bool has_uniform(std::string_view name) const { return uniforms_.contains(name); }
  /// Elements of an array of samplers have names of their own: `name`, `name[1]`, ...
  bool has_sampler(std::string_view name) const { return samplers_.contains(name); }
  bool has_block(std::string_view name) const { return blocks_.contains(name); }

  /// Binds to the unit or binding point of that name; false where it is not active.
  bool bind_texture(std::string_view sampler, GLuint texture);
  bool bind_buffer(std::string_view block, GLuint buffer);
  /// Samplers and storage blocks that nothing was bound to since the last forget_bindings().
  std::vector<std::string> unbound() const;
  /// Units and binding points are the context's: after another program's draw they hold
  /// that program's objects, so bindings count for one draw setup only.
  void forget_bindings();

 private:
  struct Uniform {
    GLint location;
    GLenum type;
    int count;  ///< active elements of an array, else 1
    bool array;
  };
  struct Slot {
    GLuint point;  ///< texture unit or binding point
    bool bound = false;
  };
  template <class T>
  using ByName = std::map<std::string, T, std::less<>>;

  void link(std::span<const GlShader> shaders);
  void list_uniforms();
  void list_blocks();
  const Uniform& uniform(std::string_view name) const;
  void set_ints(std::string_view name, GLenum type, std::span<const int> values);
  void set_floats(std::string_view name, GLenum type, std::span<const float> values);
  void set_doubles(std::string_view name, GLenum type, std::span<const double> values);
  /// How many elements to set from so many numbers; throws where they make no whole elements
  /// or are more than one and no array.
  GLsizei element_count(std::string_view name, const Uniform& u, std::size_t numbers) const;
  [[noreturn]] void fail(std::string_view problem) const;

  Context* context_;
  GlProgram program_;
  std::string name_;
  std::string hash_;
  ByName<Uniform> uniforms_;
  ByName<Slot> samplers_;
  ByName<Slot> blocks_;
};

}  // namespace amrtex
