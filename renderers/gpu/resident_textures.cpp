#include "renderers/gpu/resident_textures.hpp"

#include <fmt/format.h>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// zink gives the handles of deleted textures free when it takes a submitted batch of work up again, oldest first. It
/// keeps fewer batches than this.
constexpr int kBatches = 32;

void submit_batches(Context& context) {
  const GladGLContext& gl = context.gl();
  const GlBuffer from = make_buffer(context);
  const GlBuffer to = make_buffer(context);
  for (const GlBuffer* b : {&from, &to}) gl.NamedBufferStorage(b->id(), 16, nullptr, 0);
  for (int i = 0; i < kBatches; ++i) {
    gl.CopyNamedBufferSubData(from.id(), to.id(), 0, 0, 16);
    gl.Finish();
  }
}

}  // namespace

ResidentTextures::ResidentTextures(Context& context, std::int64_t count) : context_(&context) {
  if (count > 0 && !context.info().bindless_texture)
    throw UnsupportedError("textures reached by handles need GL_ARB_bindless_texture, which " + context.info().renderer +
                           " lacks");
  context.reserve_handles(count);
  reserved_ = count;
}

ResidentTextures::ResidentTextures(ResidentTextures&& other) noexcept { *this = std::move(other); }

ResidentTextures& ResidentTextures::operator=(ResidentTextures&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(reserved_, other.reserved_);
  std::swap(textures_, other.textures_);
  std::swap(handles_, other.handles_);
  return *this;
}

ResidentTextures::~ResidentTextures() { release(); }

std::uint64_t ResidentTextures::add(GlTexture texture) {
  const GladGLContext& gl = context_->gl();
  context_->make_current();
  const GLuint64 handle = gl.GetTextureHandleARB(texture.id());
  if (handle == 0) {
    context_->check("asking for a texture's handle");
    throw Error("the driver gave no handle for a texture");
  }
  // where a limit is known handles are the driver's table entries; it would write past its table
  if (context_->info().has_handle_limit() && handle > static_cast<GLuint64>(context_->info().max_resident_handles))
    throw UnsupportedError(
        fmt::format("a texture has handle {}, the context takes {}", handle, context_->info().max_resident_handles));
  gl.MakeTextureHandleResidentARB(handle);
  handles_.push_back(handle);
  textures_.push_back(std::move(texture));
  return handle;
}

void ResidentTextures::release() noexcept {
  if (reserved_ == 0) return;
  try {
    const GladGLContext& gl = context_->gl();
    context_->make_current();
    for (const GLuint64 handle : handles_) gl.MakeTextureHandleNonResidentARB(handle);
    textures_.clear();
    gl.Finish();  // drivers keep the handles of deleted textures until their last draw is done
    if (context_->info().has_handle_limit()) submit_batches(*context_);
    context_->release_handles(reserved_);
  } catch (...) {  // a context that cannot be made current took its objects along
  }
}

}  // namespace amrtex
