#include "renderers/gpu/gpu_field.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

// some drivers count the bytes of one call in 32 bits; and what a call took may be given back before the next
constexpr std::int64_t kMaxBytesPerCall = std::int64_t{1} << 26;

struct GlFormat {
  TexelFormat host;
  GLenum internal, format, type;
  int bytes;
  bool integer;
};

constexpr std::array<GlFormat, 9> kFormats{{{TexelFormat::r8, GL_R8, GL_RED, GL_UNSIGNED_BYTE, 1, false},
                                            {TexelFormat::r16, GL_R16, GL_RED, GL_UNSIGNED_SHORT, 2, false},
                                            {TexelFormat::r16f, GL_R16F, GL_RED, GL_HALF_FLOAT, 2, false},
                                            {TexelFormat::r32f, GL_R32F, GL_RED, GL_FLOAT, 4, false},
                                            {TexelFormat::rg32f, GL_RG32F, GL_RG, GL_FLOAT, 8, false},
                                            {TexelFormat::rgba32f, GL_RGBA32F, GL_RGBA, GL_FLOAT, 16, false},
                                            {TexelFormat::r32ui, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, 4, true},
                                            {TexelFormat::rg32ui, GL_RG32UI, GL_RG_INTEGER, GL_UNSIGNED_INT, 8, true},
                                            {TexelFormat::rgba32ui, GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT, 16, true}}};

const GlFormat& gl_format(const HostTexture& host) {
  for (const GlFormat& f : kFormats)
    if (f.host == host.format) return f;
  throw Error(fmt::format("'{}': format {} exists on the CPU only", host.name, format_name(host.format)));
}

std::string size_text(const Vec3i& size) { return fmt::format("{} x {} x {}", size.x, size.y, size.z); }

void check_contents(const HostTexture& host) {
  if (host.size.x <= 0 || host.size.y <= 0 || host.size.z <= 0)
    throw Error(fmt::format("'{}' is empty: {} texels", host.name, size_text(host.size)));
  if (std::cmp_not_equal(host.data.size(), host.bytes()))
    throw Error(fmt::format("'{}': {} bytes of data, {} by its size and format", host.name, host.data.size(), host.bytes()));
  if (host.roles.total() != host.bytes())
    throw Error(fmt::format("'{}': its roles sum to {} bytes, it has {}", host.name, host.roles.total(), host.bytes()));
  if (host.hardware_linear && (host.kind == HostTexture::Kind::buffer || gl_format(host).integer))
    throw Error(fmt::format("'{}': integers and buffers have no hardware filter", host.name));
  if (!host.handles.empty() && host.kind == HostTexture::Kind::buffer)
    throw Error(fmt::format("'{}': buffers have no handles", host.name));
}

/// Asks whether a texture of that size and format would be taken, without making it.
bool texture_fits(const GladGLContext& gl, const HostTexture& host) {
  gl.TexStorage3D(GL_PROXY_TEXTURE_3D, 1, gl_format(host).internal, host.size.x, host.size.y, host.size.z);
  GLint width = 0;
  gl.GetTexLevelParameteriv(GL_PROXY_TEXTURE_3D, 0, GL_TEXTURE_WIDTH, &width);
  return width != 0;
}

void check_texture_limits(const HostTexture& host, Context& context) {
  const int limit = context.info().max_3d_texture_size;
  if (std::max({host.size.x, host.size.y, host.size.z}) > limit)
    throw UnsupportedError(
        fmt::format("'{}': {} texels, the context takes {} along an axis", host.name, size_text(host.size), limit));
  if (!texture_fits(context.gl(), host))
    throw UnsupportedError(fmt::format("'{}': the driver refuses {} texels of {} ({} bytes)", host.name, size_text(host.size),
                                       format_name(host.format), host.bytes()));
}

void check_buffer_limits(const HostTexture& host, Context& context) {
  const std::int64_t limit = context.info().max_buffer_bytes;
  if (host.bytes() > limit)
    throw UnsupportedError(fmt::format("'{}': {} bytes, the context takes {} a storage buffer", host.name, host.bytes(), limit));
}

void check_count(std::string_view what, std::int64_t count, int limit) {
  if (count > limit) throw UnsupportedError(fmt::format("{} {}, the context takes {}", count, what, limit));
}

bool has_handle(const HostTexture& host) { return !host.handles.empty(); }

/// Each element of a buffer of handles belongs to one texture.
void check_handles(const EncodedField& field) {
  std::map<std::string, std::vector<int>, std::less<>> uses;
  for (const HostTexture& host : field.textures) {
    if (!has_handle(host)) continue;
    const HostTexture* buffer = field.find(host.handles);
    if (buffer == nullptr || buffer->kind != HostTexture::Kind::buffer || buffer->format != TexelFormat::rg32ui)
      throw Error(fmt::format("'{}': there is no buffer '{}' of rg32ui for its handle", host.name, host.handles));
    std::vector<int>& count = uses[host.handles];
    count.resize(static_cast<std::size_t>(buffer->texels()));
    if (host.handle_index < 0 || host.handle_index >= buffer->texels() ||
        ++count[static_cast<std::size_t>(host.handle_index)] > 1)
      throw Error(fmt::format("'{}': element {} of '{}' is taken or not one of {}", host.name, host.handle_index, host.handles,
                              buffer->texels()));
  }
  for (const auto& [name, count] : uses)
    if (std::find(count.begin(), count.end(), 0) != count.end())
      throw Error(fmt::format("'{}': an element has no texture", name));
}

void check_field(const EncodedField& field, Context& context) {
  const auto is_buffer = [](const HostTexture& t) { return t.kind == HostTexture::Kind::buffer; };
  const auto buffers = std::count_if(field.textures.begin(), field.textures.end(), is_buffer);
  const auto handles = std::count_if(field.textures.begin(), field.textures.end(), has_handle);
  check_count("storage buffers", buffers, context.info().max_storage_bindings);
  check_count("textures", std::ssize(field.textures) - buffers - handles, context.info().max_texture_units);
  for (const HostTexture& host : field.textures) {
    check_contents(host);
    is_buffer(host) ? check_buffer_limits(host, context) : check_texture_limits(host, context);
  }
  check_handles(field);
}

/// Drivers that can be asked are: beyond what is free they would fail, or move textures to the host's memory without a word.
void check_memory(const EncodedField& field, Context& context) {
  const std::int64_t free = context.free_memory_bytes();
  const std::int64_t needed = field.memory().total();
  if (free > 0 && needed > free) throw BudgetError(fmt::format("{} bytes, the GPU has {} free", needed, free), needed);
}

void set_sampling(const GladGLContext& gl, GLuint id, bool linear) {
  const GLint filter = linear ? GL_LINEAR : GL_NEAREST;
  gl.TextureParameteri(id, GL_TEXTURE_MIN_FILTER, filter);
  gl.TextureParameteri(id, GL_TEXTURE_MAG_FILTER, filter);
  for (GLenum axis : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R}) gl.TextureParameteri(id, axis, GL_CLAMP_TO_EDGE);
}

template <class Taken>
void fill_texture(const GladGLContext& gl, GLuint id, const HostTexture& host, const Taken& taken) {
  const GlFormat& f = gl_format(host);
  const std::int64_t slice = std::int64_t{host.size.x} * host.size.y * f.bytes;
  const int slab = static_cast<int>(std::clamp<std::int64_t>(kMaxBytesPerCall / slice, 1, host.size.z));
  gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (int z = 0; z < host.size.z; z += slab) {
    const int layers = std::min(slab, host.size.z - z);
    gl.TextureSubImage3D(id, 0, 0, 0, z, host.size.x, host.size.y, layers, f.format, f.type, host.data.data() + slice * z);
    taken(slice * z, slice * (z + layers));
  }
}

std::int64_t reported_texture_bytes(const GladGLContext& gl, GLuint id) {
  const auto get = [&](GLenum parameter) {
    GLint value = 0;
    gl.GetTextureLevelParameteriv(id, 0, parameter, &value);
    return std::int64_t{value};
  };
  const std::int64_t bits =
      get(GL_TEXTURE_RED_SIZE) + get(GL_TEXTURE_GREEN_SIZE) + get(GL_TEXTURE_BLUE_SIZE) + get(GL_TEXTURE_ALPHA_SIZE);
  return get(GL_TEXTURE_WIDTH) * get(GL_TEXTURE_HEIGHT) * get(GL_TEXTURE_DEPTH) * bits / 8;
}

}  // namespace

GpuField::GpuField(const EncodedField& field, Context& context, const Uploaded& uploaded)
    : context_(&context), encoding_(field.encoding), integer_uniforms_(field.integer_uniforms) {
  context.make_current();
  try {
    check_field(field, context);
    check_memory(field, context);
    upload_all(field, uploaded);
  } catch (const UnsupportedError& e) {
    throw UnsupportedError(fmt::format("encoding {}: {}", encoding_, e.what()));
  } catch (const BudgetError& e) {
    throw BudgetError(fmt::format("encoding {}: {}", encoding_, e.what()), field.memory().total());
  } catch (const Error& e) {
    throw Error(fmt::format("encoding {}: {}", encoding_, e.what()));
  }
  if (bytes_ != field.memory().total())
    throw Error(
        fmt::format("encoding {}: {} bytes were allocated, its ledger has {}", encoding_, bytes_, field.memory().total()));
}

/// Textures first: their handles stand in buffers.
void GpuField::upload_all(const EncodedField& field, const Uploaded& uploaded) {
  Handles handles;
  resident_ = ResidentTextures(*context_, std::count_if(field.textures.begin(), field.textures.end(), has_handle));
  for (const bool buffers : {false, true})
    for (std::size_t i = 0; i < field.textures.size(); ++i) {
      const HostTexture& host = field.textures[i];
      if ((host.kind == HostTexture::Kind::buffer) != buffers) continue;
      const Taken taken = [&](std::int64_t first, std::int64_t last) {
        if (uploaded) uploaded(i, static_cast<std::size_t>(first), static_cast<std::size_t>(last));
      };
      const auto words = handles.find(host.name);
      if (has_handle(host))
        upload_handle(field, host, handles, taken);
      else if (!buffers)
        textures_.push_back({host.name, upload_texture(host, taken)});
      else
        upload_buffer(host, words == handles.end() ? host.data.data() : reinterpret_cast<const std::byte*>(words->second.data()),
                      taken);
    }
}

void GpuField::upload_handle(const EncodedField& field, const HostTexture& host, Handles& handles, const Taken& taken) {
  const std::uint64_t handle = resident_.add(upload_texture(host, taken));
  std::vector<std::uint32_t>& words = handles[host.handles];
  words.resize(2 * static_cast<std::size_t>(field.find(host.handles)->texels()));
  words[2 * static_cast<std::size_t>(host.handle_index)] = static_cast<std::uint32_t>(handle);
  words[2 * static_cast<std::size_t>(host.handle_index) + 1] = static_cast<std::uint32_t>(handle >> 32);
}

GlTexture GpuField::upload_texture(const HostTexture& host, const Taken& taken) {
  const GladGLContext& gl = context_->gl();
  const GlFormat& f = gl_format(host);
  GlTexture texture = make_texture(*context_, GL_TEXTURE_3D);
  gl.TextureStorage3D(texture.id(), 1, f.internal, host.size.x, host.size.y, host.size.z);
  set_sampling(gl, texture.id(), host.hardware_linear);
  fill_texture(gl, texture.id(), host, taken);
  context_->check(fmt::format("uploading texture '{}' of {} texels", host.name, size_text(host.size)));
  bytes_ += std::int64_t{host.size.x} * host.size.y * host.size.z * f.bytes;
  return texture;
}

void GpuField::upload_buffer(const HostTexture& host, const std::byte* data, const Taken& taken) {
  const GladGLContext& gl = context_->gl();
  gl_format(host);  // refuses formats of the CPU
  GlBuffer buffer = make_buffer(*context_);
  const std::int64_t total = host.bytes();
  gl.NamedBufferStorage(buffer.id(), total, nullptr, GL_DYNAMIC_STORAGE_BIT);
  for (std::int64_t start = 0; start < total; start += kMaxBytesPerCall) {
    const std::int64_t bytes = std::min(kMaxBytesPerCall, total - start);
    gl.NamedBufferSubData(buffer.id(), start, bytes, data + start);
    taken(start, start + bytes);
  }
  context_->check(fmt::format("uploading buffer '{}' of {} bytes", host.name, total));
  bytes_ += total;
  buffers_.push_back({host.name, host.name + "_block", std::move(buffer)});
}

void GpuField::bind(Program& program) const {
  for (const Texture& t : textures_) program.bind_texture(t.name, t.object.id());
  for (const Buffer& b : buffers_) program.bind_buffer(b.block, b.object.id());
  for (const auto& [name, value] : integer_uniforms_) program.set_optional(name, value);
  const std::vector<std::string> missing = program.unbound();
  program.forget_bindings();
  if (!missing.empty())
    throw Error(fmt::format("encoding {}: program {} reads {}, which neither the field nor the consumer provides", encoding_,
                            program.name(), fmt::join(missing, ", ")));
}

std::vector<std::string> GpuField::unused(const Program& program) const {
  std::vector<std::string> names;
  for (const Texture& t : textures_)
    if (!program.has_sampler(t.name)) names.push_back(t.name);
  for (const Buffer& b : buffers_)
    if (!program.has_block(b.block)) names.push_back(b.name);
  return names;
}

std::int64_t GpuField::bytes_reported() const {
  context_->make_current();
  const GladGLContext& gl = context_->gl();
  std::int64_t sum = 0;
  for (const Texture& t : textures_) sum += reported_texture_bytes(gl, t.object.id());
  for (const GlTexture& t : resident_.textures()) sum += reported_texture_bytes(gl, t.id());
  for (const Buffer& b : buffers_) {
    GLint64 size = 0;
    gl.GetNamedBufferParameteri64v(b.object.id(), GL_BUFFER_SIZE, &size);
    sum += size;
  }
  return sum;
}

}  // namespace amrtex
