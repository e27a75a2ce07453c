// Where pictures are drawn: 32-bit floats, and the shader's own counters beside them; 8 bits as the control of an experiment.
#pragma once

#include <vector>

#include "renderers/gpu/gl_objects.hpp"
#include "renderers/gpu/program.hpp"
#include "renderers/scene/picture.hpp"

namespace amrtex {

enum class ColorFormat { rgba32f, rgba8 };

/// A framebuffer with RGBA32F (or RGBA8) at location 0 and, with counters, RGBA32UI at location 1.
class DrawTarget {
 public:
  /// Sizes in pixels; throws UnsupportedError beyond the context's largest viewport.
  DrawTarget(Context& context, int width, int height, bool counters = false, ColorFormat format = ColorFormat::rgba32f,
             bool stencil = false);

  /// Makes it the target of draws, its viewport the whole picture.
  void bind() const;
  void clear(const glm::vec4& color = glm::vec4(0)) const;
  /// Sets all of the stencil buffer to 0.
  void clear_stencil() const;
  /// Binds, uses the program and draws the one triangle of fullscreen.vert.
  void draw(const Program& program) const;

  /// The same picture by a compute shader of 8 x 8 invocations a group, which writes images 0 (colour) and 1 (counters).
  void dispatch(const Program& program) const;

  /// The first `channels` (1 or 4) of each pixel; waits for GL.
  Picture read_picture(int channels = 4) const;
  /// One uvec4 a pixel in the order of Picture; empty without counters.
  std::vector<glm::uvec4> read_counters() const;

  int width() const { return width_; }
  int height() const { return height_; }

 private:
  Context* context_;
  int width_;
  int height_;
  GlTexture color_;
  GlTexture counters_;
  GlTexture stencil_;
  GlFramebuffer framebuffer_;
  GlVertexArray no_vertices_;
};

}  // namespace amrtex
