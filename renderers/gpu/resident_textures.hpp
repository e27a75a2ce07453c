// Textures that shaders reach by handles (ARB_bindless_texture).
#pragma once

#include <cstdint>
#include <vector>

#include "renderers/gpu/gl_objects.hpp"

namespace amrtex {

/// Filled textures with their handles, resident as long as this object lives.
class ResidentTextures {
 public:
  ResidentTextures() = default;
  /// Room for `count` handles. Throws UnsupportedError naming the extension, or the numbers where the context's other
  /// fields leave no room: a driver may crash at the first handle too many.
  ResidentTextures(Context& context, std::int64_t count);
  ResidentTextures(ResidentTextures&& other) noexcept;
  ResidentTextures& operator=(ResidentTextures&& other) noexcept;
  ~ResidentTextures();

  /// Takes a texture whose sampling does not change any more and returns its handle. Throws Error.
  std::uint64_t add(GlTexture texture);
  const std::vector<GlTexture>& textures() const { return textures_; }

 private:
  void release() noexcept;

  Context* context_ = nullptr;
  std::int64_t reserved_ = 0;
  std::vector<GlTexture> textures_;
  std::vector<GLuint64> handles_;
};

}  // namespace amrtex
