#include "renderers/gpu/draw_target.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

GlTexture make_layer(Context& context, GLenum format, int width, int height) {
  GlTexture texture = make_texture(context, GL_TEXTURE_2D);
  context.gl().TextureStorage2D(texture.id(), 1, format, width, height);
  return texture;
}

std::size_t pixel_count(int width, int height) { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }

/// GL's first row is the lowest, a picture's the uppermost.
template <class T>
void flip_rows(std::vector<T>& values, int height) {
  const auto row = static_cast<std::ptrdiff_t>(values.size()) / height;
  for (int y = 0; y < height / 2; ++y)
    std::swap_ranges(values.begin() + y * row, values.begin() + (y + 1) * row, values.begin() + (height - 1 - y) * row);
}

}  // namespace

DrawTarget::DrawTarget(Context& context, int width, int height, bool counters, ColorFormat format, bool stencil)
    : context_(&context), width_(width), height_(height) {
  const GlContextInfo& info = context.info();
  if (width < 1 || height < 1 || width > info.max_viewport_width || height > info.max_viewport_height)
    throw UnsupportedError(fmt::format("a picture of {} x {} pixels; the context takes 1 x 1 to {} x {}", width, height,
                                       info.max_viewport_width, info.max_viewport_height));
  color_ = make_layer(context, format == ColorFormat::rgba32f ? GL_RGBA32F : GL_RGBA8, width, height);
  if (counters) counters_ = make_layer(context, GL_RGBA32UI, width, height);
  framebuffer_ = make_framebuffer(context);
  no_vertices_ = make_vertex_array(context);
  const GladGLContext& gl = context.gl();
  gl.NamedFramebufferTexture(framebuffer_.id(), GL_COLOR_ATTACHMENT0, color_.id(), 0);
  if (counters) gl.NamedFramebufferTexture(framebuffer_.id(), GL_COLOR_ATTACHMENT1, counters_.id(), 0);
  if (stencil) {
    stencil_ = make_layer(context, GL_DEPTH24_STENCIL8, width, height);
    gl.NamedFramebufferTexture(framebuffer_.id(), GL_DEPTH_STENCIL_ATTACHMENT, stencil_.id(), 0);
  }
  const std::array<GLenum, 2> buffers{GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  gl.NamedFramebufferDrawBuffers(framebuffer_.id(), counters ? 2 : 1, buffers.data());
  const GLenum status = gl.CheckNamedFramebufferStatus(framebuffer_.id(), GL_DRAW_FRAMEBUFFER);
  if (status != GL_FRAMEBUFFER_COMPLETE)
    throw Error(fmt::format("framebuffer of {} x {}: status 0x{:04x}", width, height, status));
  context.check("making a framebuffer");
}

void DrawTarget::bind() const {
  context_->make_current();
  context_->gl().BindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  context_->gl().Viewport(0, 0, width_, height_);
}

void DrawTarget::clear(const glm::vec4& color) const {
  context_->make_current();
  const std::array<GLuint, 4> zero{};
  context_->gl().ClearNamedFramebufferfv(framebuffer_.id(), GL_COLOR, 0, &color.x);
  if (counters_) context_->gl().ClearNamedFramebufferuiv(framebuffer_.id(), GL_COLOR, 1, zero.data());
}

void DrawTarget::clear_stencil() const {
  context_->make_current();
  const GLint zero = 0;
  context_->gl().ClearNamedFramebufferiv(framebuffer_.id(), GL_STENCIL, 0, &zero);
}

void DrawTarget::draw(const Program& program) const {
  bind();
  program.use();
  context_->gl().BindVertexArray(no_vertices_.id());
  context_->gl().DrawArrays(GL_TRIANGLES, 0, 3);
}

void DrawTarget::dispatch(const Program& program) const {
  constexpr int tile = 8;  // raycast.comp
  program.use();
  const GladGLContext& gl = context_->gl();
  gl.BindImageTexture(0, color_.id(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA32F);
  if (counters_) gl.BindImageTexture(1, counters_.id(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA32UI);
  gl.DispatchCompute(static_cast<GLuint>((width_ + tile - 1) / tile), static_cast<GLuint>((height_ + tile - 1) / tile), 1);
  gl.MemoryBarrier(GL_TEXTURE_UPDATE_BARRIER_BIT | GL_FRAMEBUFFER_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
}

Picture DrawTarget::read_picture(int channels) const {
  context_->make_current();
  const GladGLContext& gl = context_->gl();
  std::vector<float> values(pixel_count(width_, height_) * static_cast<std::size_t>(channels));
  gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl.GetTextureImage(color_.id(), 0, channels == 1 ? GL_RED : GL_RGBA, GL_FLOAT,
                     static_cast<GLsizei>(values.size() * sizeof(float)), values.data());
  context_->check("reading a picture");
  flip_rows(values, height_);
  Picture picture(width_, height_, channels);
  std::copy(values.begin(), values.end(), picture.values.begin());
  return picture;
}

std::vector<glm::uvec4> DrawTarget::read_counters() const {
  if (!counters_) return {};
  context_->make_current();
  std::vector<glm::uvec4> values(pixel_count(width_, height_));
  context_->gl().PixelStorei(GL_PACK_ALIGNMENT, 1);
  context_->gl().GetTextureImage(counters_.id(), 0, GL_RGBA_INTEGER, GL_UNSIGNED_INT,
                                 static_cast<GLsizei>(values.size() * sizeof(glm::uvec4)), values.data());
  context_->check("reading counters");
  flip_rows(values, height_);
  return values;
}

}  // namespace amrtex
