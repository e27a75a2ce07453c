// The one uploader: any EncodedField as textures and buffers of a context.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "renderers/gpu/gl_objects.hpp"
#include "renderers/gpu/program.hpp"
#include "renderers/gpu/resident_textures.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

/// The GL objects of one field. A texture is bound to the sampler of its name, or reached by its
/// handle; a buffer is bound to the storage block `<name>_block`.
class GpuField {
 public:
  /// Throws UnsupportedError with the numbers, before anything is allocated, where a
  /// limit of the context would be passed; Error where the host data contradicts itself.
  /// Called with a texture or buffer of the field, by its number, and the bytes of it from `first` to before `last` that the context holds now.
  using Uploaded = std::function<void(std::size_t texture, std::size_t first, std::size_t last)>;
  GpuField(const EncodedField& field, Context& context, const Uploaded& uploaded = {});

  /// Binds everything that the program uses and sets the field's uniforms. The consumer
  /// binds its own textures and buffers first, each time: throws Error naming what the
  /// program reads and nobody provided. Once a program, unless another one draws between.
  void bind(Program& program) const;
  /// Textures and buffers that the program does not use (its compiler may have removed them).
  std::vector<std::string> unused(const Program& program) const;

  /// What GL was asked to allocate; equal to EncodedField::memory().total().
  std::int64_t bytes() const { return bytes_; }
  /// The same as GL tells it, from sizes and component bits. Drivers may use wider formats.
  std::int64_t bytes_reported() const;

 private:
  struct Texture {
    std::string name;
    GlTexture object;
  };
  /// Handles by the buffer that receives them; two words an element.
  using Handles = std::map<std::string, std::vector<std::uint32_t>, std::less<>>;
  struct Buffer {
    std::string name;
    std::string block;
    GlBuffer object;
  };

  /// Bytes of one texture or buffer that the context holds now.
  using Taken = std::function<void(std::int64_t first, std::int64_t last)>;

  void upload_all(const EncodedField& field, const Uploaded& uploaded);
  void upload_handle(const EncodedField& field, const HostTexture& host, Handles& handles, const Taken& taken);
  GlTexture upload_texture(const HostTexture& host, const Taken& taken);
  void upload_buffer(const HostTexture& host, const std::byte* data, const Taken& taken);

  Context* context_;
  std::string encoding_;
  std::vector<std::pair<std::string, Vec3i>> integer_uniforms_;
  std::vector<Texture> textures_;
  std::vector<Buffer> buffers_;
  ResidentTextures resident_;
  std::int64_t bytes_ = 0;
};

}  // namespace amrtex
