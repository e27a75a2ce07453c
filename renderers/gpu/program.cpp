#include "renderers/gpu/program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/gtc/type_ptr.hpp>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

enum class Number { integer, single, twice };

struct TypeInfo {
  GLenum type;
  const char* name;
  Number number;
  int components;
};

constexpr std::array<TypeInfo, 13> kTypes{{{GL_BOOL, "bool", Number::integer, 1},
                                           {GL_INT, "int", Number::integer, 1},
                                           {GL_INT_VEC2, "ivec2", Number::integer, 2},
                                           {GL_INT_VEC3, "ivec3", Number::integer, 3},
                                           {GL_INT_VEC4, "ivec4", Number::integer, 4},
                                           {GL_FLOAT, "float", Number::single, 1},
                                           {GL_FLOAT_VEC2, "vec2", Number::single, 2},
                                           {GL_FLOAT_VEC3, "vec3", Number::single, 3},
                                           {GL_FLOAT_VEC4, "vec4", Number::single, 4},
                                           {GL_DOUBLE, "double", Number::twice, 1},
                                           {GL_DOUBLE_VEC2, "dvec2", Number::twice, 2},
                                           {GL_DOUBLE_VEC3, "dvec3", Number::twice, 3},
                                           {GL_DOUBLE_VEC4, "dvec4", Number::twice, 4}}};

const TypeInfo* find_type(GLenum type) {
  const auto info = std::find_if(kTypes.begin(), kTypes.end(), [&](const TypeInfo& t) { return t.type == type; });
  return info == kTypes.end() ? nullptr : &*info;
}

std::string type_name(GLenum type) {
  if (type == GL_UNSIGNED_INT) return "uint";
  const TypeInfo* info = find_type(type);
  return info ? info->name : fmt::format("type 0x{:04x}", type);
}

bool is_sampler(GLenum type) {
  constexpr std::array<GLenum, 16> samplers{GL_SAMPLER_1D,
                                            GL_SAMPLER_2D,
                                            GL_SAMPLER_3D,
                                            GL_SAMPLER_CUBE,
                                            GL_SAMPLER_BUFFER,
                                            GL_SAMPLER_2D_ARRAY,
                                            GL_INT_SAMPLER_1D,
                                            GL_INT_SAMPLER_2D,
                                            GL_INT_SAMPLER_3D,
                                            GL_INT_SAMPLER_BUFFER,
                                            GL_INT_SAMPLER_2D_ARRAY,
                                            GL_UNSIGNED_INT_SAMPLER_1D,
                                            GL_UNSIGNED_INT_SAMPLER_2D,
                                            GL_UNSIGNED_INT_SAMPLER_3D,
                                            GL_UNSIGNED_INT_SAMPLER_BUFFER,
                                            GL_UNSIGNED_INT_SAMPLER_2D_ARRAY};
  return std::find(samplers.begin(), samplers.end(), type) != samplers.end();
}

const std::string& entry_name(const AssembledShader& shader) { return shader.files.at(1); }

std::string_view stage_name(GLenum stage) {
  return stage == GL_VERTEX_SHADER ? "vertex" : stage == GL_FRAGMENT_SHADER ? "fragment" : "compute";
}

std::string shader_log(const GladGLContext& gl, GLuint id) {
  GLint length = 0;
  gl.GetShaderiv(id, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<std::size_t>(std::max(length, 1)), '\0');
  gl.GetShaderInfoLog(id, length, nullptr, log.data());
  return log.c_str();
}

std::string program_log(const GladGLContext& gl, GLuint id) {
  GLint length = 0;
  gl.GetProgramiv(id, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<std::size_t>(std::max(length, 1)), '\0');
  gl.GetProgramInfoLog(id, length, nullptr, log.data());
  return log.c_str();
}

GlShader compile(Context& context, GLenum stage, const AssembledShader& shader) {
  context.make_current();
  const GladGLContext& gl = context.gl();
  GlShader compiled(context, gl.CreateShader(stage));
  const GLchar* text = shader.text.data();
  const auto length = static_cast<GLint>(shader.text.size());
  gl.ShaderSource(compiled.id(), 1, &text, &length);
  gl.CompileShader(compiled.id());
  GLint ok = GL_FALSE;
  gl.GetShaderiv(compiled.id(), GL_COMPILE_STATUS, &ok);
  if (!ok)
    throw Error(fmt::format("{} shader {} does not compile:\n{}", stage_name(stage), entry_name(shader),
                            map_log(shader_log(gl, compiled.id()), shader.files)));
  return compiled;
}

std::string resource_name(const GladGLContext& gl, GLuint program, GLenum interface, GLuint index) {
  const GLenum property = GL_NAME_LENGTH;
  GLint length = 0;
  gl.GetProgramResourceiv(program, interface, index, 1, &property, 1, nullptr, &length);
  std::string name(static_cast<std::size_t>(std::max(length, 1)), '\0');
  gl.GetProgramResourceName(program, interface, index, length, nullptr, name.data());
  return name.c_str();
}

GLuint resource_count(const GladGLContext& gl, GLuint program, GLenum interface) {
  GLint n = 0;
  gl.GetProgramInterfaceiv(program, interface, GL_ACTIVE_RESOURCES, &n);
  return static_cast<GLuint>(n);
}

}  // namespace

Program::Program(Context& context, const AssembledShader& vertex, const AssembledShader& fragment)
    : context_(&context),
      name_(fmt::format("{} + {}", entry_name(vertex), entry_name(fragment))),
      hash_(hash_text(vertex.hash + fragment.hash)) {
  const std::array<GlShader, 2> shaders{compile(context, GL_VERTEX_SHADER, vertex),
                                        compile(context, GL_FRAGMENT_SHADER, fragment)};
  link(shaders);
}

Program::Program(Context& context, const AssembledShader& compute)
    : context_(&context), name_(entry_name(compute)), hash_(hash_text(compute.hash)) {
  const std::array<GlShader, 1> shaders{compile(context, GL_COMPUTE_SHADER, compute)};
  link(shaders);
}

void Program::link(std::span<const GlShader> shaders) {
  const GladGLContext& gl = context_->gl();
  program_ = GlProgram(*context_, gl.CreateProgram());
  for (const GlShader& shader : shaders) gl.AttachShader(id(), shader.id());
  gl.LinkProgram(id());
  for (const GlShader& shader : shaders) gl.DetachShader(id(), shader.id());
  GLint ok = GL_FALSE;
  gl.GetProgramiv(id(), GL_LINK_STATUS, &ok);
  if (!ok) fail(fmt::format("does not link:\n{}", program_log(gl, id())));
  list_uniforms();
  list_blocks();
  context_->check(fmt::format("linking {}", name_));
}

void Program::list_uniforms() {
  const GladGLContext& gl = context_->gl();
  const std::array<GLenum, 3> properties{GL_LOCATION, GL_TYPE, GL_ARRAY_SIZE};
  const GLuint n = resource_count(gl, id(), GL_UNIFORM);
  GLuint unit = 0;
  for (GLuint i = 0; i < n; ++i) {
    std::array<GLint, 3> values{};
    gl.GetProgramResourceiv(id(), GL_UNIFORM, i, 3, properties.data(), 3, nullptr, values.data());
    const auto [location, type, count] = values;
    std::string name = resource_name(gl, id(), GL_UNIFORM, i);
    if (location < 0) continue;                // a member of a block
    const bool array = name.ends_with("[0]");  // listed by its first element
    if (array) name.resize(name.size() - 3);
    if (!is_sampler(static_cast<GLenum>(type))) {
      uniforms_[name] = {location, static_cast<GLenum>(type), count, array};
      continue;
    }
    for (int element = 0; element < count; ++element) {  // of an array, else one; their locations follow each other
      gl.ProgramUniform1i(id(), location + element, static_cast<GLint>(unit));
      samplers_[element_name(name, element)] = {unit++};
    }
  }
  if (std::cmp_greater(unit, context_->info().max_texture_units))
    throw UnsupportedError(
        fmt::format("program {}: {} textures, the context has {} units", name_, unit, context_->info().max_texture_units));
}

void Program::list_blocks() {
  const GladGLContext& gl = context_->gl();
  const GLuint n = resource_count(gl, id(), GL_SHADER_STORAGE_BLOCK);
  for (GLuint i = 0; i < n; ++i) {
    gl.ShaderStorageBlockBinding(id(), i, i);
    blocks_[resource_name(gl, id(), GL_SHADER_STORAGE_BLOCK, i)] = {i};
  }
}

void Program::use() const {
  context_->make_current();
  context_->gl().UseProgram(id());
}

void Program::fail(std::string_view problem) const { throw Error(fmt::format("program {}: {}", name_, problem)); }

const Program::Uniform& Program::uniform(std::string_view name) const {
  const auto found = uniforms_.find(name);
  if (found == uniforms_.end()) fail(fmt::format("no uniform '{}' is active", name));
  context_->make_current();
  return found->second;
}

void Program::set_ints(std::string_view name, GLenum type, std::span<const int> values) {
  const Uniform& u = uniform(name);
  const bool boolean = u.type == GL_BOOL && type == GL_INT;
  if (u.type != type && !boolean) fail(fmt::format("uniform '{}' is {}, not {}", name, type_name(u.type), type_name(type)));
  const GLsizei n = element_count(name, u, values.size());
  const GladGLContext& gl = context_->gl();
  switch (type) {
    case GL_INT:
      return gl.ProgramUniform1iv(id(), u.location, n, values.data());
    case GL_INT_VEC2:
      return gl.ProgramUniform2iv(id(), u.location, n, values.data());
    case GL_INT_VEC3:
      return gl.ProgramUniform3iv(id(), u.location, n, values.data());
    default:
      return gl.ProgramUniform4iv(id(), u.location, n, values.data());
  }
}

void Program::set_floats(std::string_view name, GLenum type, std::span<const float> values) {
  const Uniform& u = uniform(name);
  if (u.type != type) fail(fmt::format("uniform '{}' is {}, not {}", name, type_name(u.type), type_name(type)));
  const GLsizei n = element_count(name, u, values.size());
  const GladGLContext& gl = context_->gl();
  switch (type) {
    case GL_FLOAT:
      return gl.ProgramUniform1fv(id(), u.location, n, values.data());
    case GL_FLOAT_VEC2:
      return gl.ProgramUniform2fv(id(), u.location, n, values.data());
    case GL_FLOAT_VEC3:
      return gl.ProgramUniform3fv(id(), u.location, n, values.data());
    default:
      return gl.ProgramUniform4fv(id(), u.location, n, values.data());
  }
}

void Program::set_doubles(std::string_view name, GLenum type, std::span<const double> values) {
  const Uniform& u = uniform(name);
  if (u.type != type) fail(fmt::format("uniform '{}' is {}, not {}", name, type_name(u.type), type_name(type)));
  const GLsizei n = element_count(name, u, values.size());
  const GladGLContext& gl = context_->gl();
  switch (type) {
    case GL_DOUBLE:
      return gl.ProgramUniform1dv(id(), u.location, n, values.data());
    case GL_DOUBLE_VEC2:
      return gl.ProgramUniform2dv(id(), u.location, n, values.data());
    case GL_DOUBLE_VEC3:
      return gl.ProgramUniform3dv(id(), u.location, n, values.data());
    default:
      return gl.ProgramUniform4dv(id(), u.location, n, values.data());
  }
}

GLsizei Program::element_count(std::string_view name, const Uniform& u, std::size_t numbers) const {
  const auto components = static_cast<std::size_t>(find_type(u.type)->components);
  const std::size_t elements = numbers / components;
  if (numbers == 0 || numbers % components != 0 || (elements > 1 && !u.array))
    fail(fmt::format("uniform '{}' is {}{}, {} numbers given", name, type_name(u.type), u.array ? "[]" : "", numbers));
  return static_cast<GLsizei>(std::min(elements, static_cast<std::size_t>(u.count)));
}

void Program::set(std::string_view name, int value) { set_ints(name, GL_INT, {&value, 1}); }
void Program::set(std::string_view name, float value) { set_floats(name, GL_FLOAT, {&value, 1}); }
void Program::set(std::string_view name, double value) { set_doubles(name, GL_DOUBLE, {&value, 1}); }
void Program::set(std::string_view name, const glm::ivec2& value) { set_ints(name, GL_INT_VEC2, {glm::value_ptr(value), 2}); }
void Program::set(std::string_view name, const glm::ivec3& value) { set_ints(name, GL_INT_VEC3, {glm::value_ptr(value), 3}); }
void Program::set(std::string_view name, const glm::ivec4& value) { set_ints(name, GL_INT_VEC4, {glm::value_ptr(value), 4}); }
void Program::set(std::string_view name, const glm::vec2& value) { set_floats(name, GL_FLOAT_VEC2, {glm::value_ptr(value), 2}); }
void Program::set(std::string_view name, const glm::vec3& value) { set_floats(name, GL_FLOAT_VEC3, {glm::value_ptr(value), 3}); }
void Program::set(std::string_view name, const glm::vec4& value) { set_floats(name, GL_FLOAT_VEC4, {glm::value_ptr(value), 4}); }
void Program::set(std::string_view name, const glm::dvec2& value) {
  set_doubles(name, GL_DOUBLE_VEC2, {glm::value_ptr(value), 2});
}
void Program::set(std::string_view name, const glm::dvec3& value) {
  set_doubles(name, GL_DOUBLE_VEC3, {glm::value_ptr(value), 3});
}
void Program::set(std::string_view name, const glm::dvec4& value) {
  set_doubles(name, GL_DOUBLE_VEC4, {glm::value_ptr(value), 4});
}
void Program::set(std::string_view name, std::span<const int> values) { set_ints(name, GL_INT, values); }
void Program::set(std::string_view name, std::span<const float> values) { set_floats(name, GL_FLOAT, values); }
void Program::set(std::string_view name, std::span<const double> values) { set_doubles(name, GL_DOUBLE, values); }

void Program::set(std::string_view name, unsigned value) {
  const Uniform& u = uniform(name);
  if (u.type != GL_UNSIGNED_INT) fail(fmt::format("uniform '{}' is {}, not uint", name, type_name(u.type)));
  context_->gl().ProgramUniform1ui(id(), u.location, value);
}

void Program::set(const UniformValue& value) {
  const Uniform& u = uniform(value.name);
  const TypeInfo* info = find_type(u.type);
  const auto* ints = std::get_if<std::vector<int>>(&value.numbers);
  if (!info || (info->number == Number::integer) != (ints != nullptr))
    fail(fmt::format("uniform '{}' is {}, {} given", value.name, type_name(u.type), ints ? "integers" : "reals"));
  if (ints) return set_ints(value.name, u.type == GL_BOOL ? GL_INT : u.type, *ints);
  const auto& reals = std::get<std::vector<double>>(value.numbers);
  if (info->number == Number::twice) return set_doubles(value.name, u.type, reals);
  std::vector<float> rounded(reals.size());
  std::transform(reals.begin(), reals.end(), rounded.begin(), [](double v) { return static_cast<float>(v); });
  set_floats(value.name, u.type, rounded);
}

bool Program::set_optional(const UniformValue& value) {
  if (!has_uniform(value.name)) return false;
  set(value);
  return true;
}

bool Program::bind_texture(std::string_view sampler, GLuint texture) {
  const auto slot = samplers_.find(sampler);
  if (slot == samplers_.end()) return false;
  context_->make_current();
  context_->gl().BindTextureUnit(slot->second.point, texture);
  slot->second.bound = true;
  return true;
}

bool Program::bind_buffer(std::string_view block, GLuint buffer) {
  const auto slot = blocks_.find(block);
  if (slot == blocks_.end()) return false;
  context_->make_current();
  context_->gl().BindBufferBase(GL_SHADER_STORAGE_BUFFER, slot->second.point, buffer);
  slot->second.bound = true;
  return true;
}

std::vector<std::string> Program::unbound() const {
  std::vector<std::string> names;
  for (const auto& [name, slot] : samplers_)
    if (!slot.bound) names.push_back(name);
  for (const auto& [name, slot] : blocks_)
    if (!slot.bound) names.push_back(name);
  return names;
}

void Program::forget_bindings() {
  for (auto& [name, slot] : samplers_) slot.bound = false;
  for (auto& [name, slot] : blocks_) slot.bound = false;
}

}  // namespace amrtex
