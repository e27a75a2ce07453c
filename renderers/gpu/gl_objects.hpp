// Owners of GL names: move only, deleted in the context that made them.
#pragma once

#include <glad/gl.h>

#include <utility>

#include "renderers/context/context.hpp"

namespace amrtex {

/// Kind has `static void destroy(const GladGLContext&, GLuint)`. The context must outlive the object.
template <class Kind>
class GlObject {
 public:
  GlObject() = default;
  GlObject(Context& context, GLuint id) : context_(&context), id_(id) {}
  GlObject(GlObject&& other) noexcept : context_(other.context_), id_(std::exchange(other.id_, 0)) {}
  GlObject& operator=(GlObject&& other) noexcept {
    GlObject(std::move(other)).swap(*this);
    return *this;
  }
  GlObject(const GlObject&) = delete;
  GlObject& operator=(const GlObject&) = delete;
  ~GlObject() { destroy(); }

  GLuint id() const { return id_; }
  explicit operator bool() const { return id_ != 0; }

 private:
  void swap(GlObject& other) noexcept {
    std::swap(context_, other.context_);
    std::swap(id_, other.id_);
  }
  void destroy() noexcept {
    if (id_ == 0) return;
    try {
      // the same number may be another object of the context that is current now
      context_->make_current();
      Kind::destroy(context_->gl(), id_);
    } catch (...) {  // a context that cannot be made current took its objects along
    }
  }

  Context* context_ = nullptr;
  GLuint id_ = 0;
};

namespace gl_kind {
struct Texture {
  static void destroy(const GladGLContext& gl, GLuint id) { gl.DeleteTextures(1, &id); }
};
struct Buffer {
  static void destroy(const GladGLContext& gl, GLuint id) { gl.DeleteBuffers(1, &id); }
};
struct Framebuffer {
  static void destroy(const GladGLContext& gl, GLuint id) { gl.DeleteFramebuffers(1, &id); }
};
struct VertexArray {
  static void destroy(const GladGLContext& gl, GLuint id) { gl.DeleteVertexArrays(1, &id); }
};
struct Query {
  static void destroy(const GladGLContext& gl, GLuint id) { gl.DeleteQueries(1, &id); }
};
struct Shader {
  static void destroy(const GladGLContext& gl, GLuint id) { gl.DeleteShader(id); }
};
struct Program {
  static void destroy(const GladGLContext& gl, GLuint id) { gl.DeleteProgram(id); }
};
}  // namespace gl_kind

using GlTexture = GlObject<gl_kind::Texture>;
using GlBuffer = GlObject<gl_kind::Buffer>;
using GlFramebuffer = GlObject<gl_kind::Framebuffer>;
using GlVertexArray = GlObject<gl_kind::VertexArray>;
using GlQuery = GlObject<gl_kind::Query>;
using GlShader = GlObject<gl_kind::Shader>;
using GlProgram = GlObject<gl_kind::Program>;

inline GlTexture make_texture(Context& context, GLenum target) {
  context.make_current();
  GLuint id = 0;
  context.gl().CreateTextures(target, 1, &id);
  return {context, id};
}
inline GlBuffer make_buffer(Context& context) {
  context.make_current();
  GLuint id = 0;
  context.gl().CreateBuffers(1, &id);
  return {context, id};
}
inline GlFramebuffer make_framebuffer(Context& context) {
  context.make_current();
  GLuint id = 0;
  context.gl().CreateFramebuffers(1, &id);
  return {context, id};
}
inline GlVertexArray make_vertex_array(Context& context) {
  context.make_current();
  GLuint id = 0;
  context.gl().CreateVertexArrays(1, &id);
  return {context, id};
}
inline GlQuery make_query(Context& context, GLenum target) {
  context.make_current();
  GLuint id = 0;
  context.gl().CreateQueries(target, 1, &id);
  return {context, id};
}

}  // namespace amrtex
