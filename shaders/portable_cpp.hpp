// The C++ half of the portable subset: the same shader text becomes the members of a
// struct template over `real`, its uniforms, textures and buffers bound by name.
#pragma once

#include <glm/glm.hpp>
#include <glm/integer.hpp>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "structures/common/host_texture.hpp"
#include "structures/mesh/error.hpp"

#define AMRTEX_CPP 1
#define AMRTEX_BELOW_ONE (real(1) - std::numeric_limits<real>::epsilon() / real(2))  // the largest real below 1
#define IN(T) const T&
#define OUT(T) T&
#define INOUT(T) T&
#define PRECISE
#define STRUCT struct
#define UNIFORM(T, name) \
  T name{};              \
  Bound bound_##name{bindings, #name, &(name)};
#define UNIFORM_ARRAY(T, name, count, most) \
  T name[most]{};                           \
  Bound bound_##name{bindings, #name, &(name)[0], most};
#define VALUE_TEXTURE(name)  \
  ValueTexture<real> name{}; \
  Bound bound_##name{bindings, #name, &(name)};
#define VALUE_TEXTURES(name, count, most) \
  ValueTexture<real> name[most]{};        \
  Bound bound_##name{bindings, #name, name};
#define INTEGER_TEXTURE(name) \
  IntegerTexture name{};      \
  Bound bound_##name{bindings, #name, &(name)};
#define BUFFER(T, name, block) \
  HostBuffer<T> name{};        \
  Bound bound_##name{bindings, #name, &(name)};
// handles are the textures' numbers; one turn serves each
#define VALUE_TEXTURE_SET(name, handles, block) \
  ValueTextureSet<real> name{};                 \
  HostHandles handles{};                        \
  Bound bound_##name{bindings, #name, &(name)};
#define SET_TEXEL(name, handle, texel) (name).fetch(handle, texel)
#define SERVED_HANDLE(handle) (handle)
#define DEFINE_INT(name) \
  int name{};            \
  Bound bound_##name{bindings, #name, &(name)};

namespace amrtex::portable {

using namespace glm;

class Bindable {
 public:
  virtual ~Bindable() = default;
  virtual void bind(const HostTexture& texture) = 0;
};

/// texelFetch on a host texture of values: the code (v - a) / b, or v itself.
template <class real>
class ValueTexture : public Bindable {
 public:
  void bind(const HostTexture& texture) override { texture_ = &texture; }
  vec<4, real> fetch(const ivec3& texel) const {
    if (texture_ == nullptr) throw Error("fetch from a texture of values that the field does not have");
    const HostTexture& t = *texture_;
    if (any(lessThan(texel, ivec3(0))) || any(greaterThanEqual(texel, t.size)))
      throw Error("texture " + t.name + ": fetch outside of it");  // never read as 0: it would look like data
    const auto i = Box{ivec3(0), t.size}.offset(texel);
    return {static_cast<real>(load_value(t.format, {}, t.data.data(), i)), real(0), real(0), real(1)};
  }

 private:
  const HostTexture* texture_ = nullptr;
};

class IntegerTexture : public Bindable {
 public:
  void bind(const HostTexture& texture) override { texture_ = &texture; }
  uvec4 fetch(const ivec3& texel) const {
    const HostTexture& t = *texture_;
    if (any(lessThan(texel, ivec3(0))) || any(greaterThanEqual(texel, t.size)))
      throw Error("texture " + t.name + ": fetch outside of it");
    const int components = texel_bytes(t.format) / 4;
    const auto* data = t.as<std::uint32_t>() + Box{ivec3(0), t.size}.offset(texel) * static_cast<std::size_t>(components);
    uvec4 v(0, 0, 0, 1);
    for (int c = 0; c < components; ++c) v[c] = data[c];
    return v;
  }

 private:
  const HostTexture* texture_ = nullptr;
};

/// The textures of one name in the order of their handles.
template <class real>
class ValueTextureSet : public Bindable {
 public:
  void bind(const HostTexture& texture) override {
    const auto i = static_cast<std::size_t>(texture.handle_index);
    if (textures_.size() <= i) textures_.resize(i + 1);
    textures_[i].bind(texture);
  }
  vec<4, real> fetch(const uvec2& handle, const ivec3& texel) const {
    if (handle.x >= textures_.size()) throw Error("fetch from a texture that the set does not have");
    return textures_[handle.x].fetch(texel);
  }

 private:
  std::vector<ValueTexture<real>> textures_;
};

struct HostHandles {
  uvec2 operator[](int i) const { return {static_cast<unsigned>(i), 0U}; }
};

template <class real>
vec<4, real> texelFetch(const ValueTexture<real>& texture, const ivec3& texel, int /*mip level*/) {
  return texture.fetch(texel);
}
inline uvec4 texelFetch(const IntegerTexture& texture, const ivec3& texel, int /*mip level*/) { return texture.fetch(texel); }

/// A buffer element as the shader's type: uint as is, floats widened to `real`.
template <class T>
struct BufferElement {
  static T read(const std::byte* data, std::size_t i) {
    T value;
    __builtin_memcpy(&value, data + i * sizeof(T), sizeof(T));
    return value;
  }
};
template <>
struct BufferElement<double> {
  static double read(const std::byte* data, std::size_t i) { return static_cast<double>(BufferElement<float>::read(data, i)); }
};
template <>
struct BufferElement<dvec2> {
  static dvec2 read(const std::byte* data, std::size_t i) { return dvec2(BufferElement<vec2>::read(data, i)); }
};
template <>
struct BufferElement<dvec4> {
  static dvec4 read(const std::byte* data, std::size_t i) { return dvec4(BufferElement<vec4>::read(data, i)); }
};

template <class T>
class HostBuffer : public Bindable {
 public:
  void bind(const HostTexture& buffer) override { buffer_ = &buffer; }
  T operator[](std::size_t i) const {
    if (i >= static_cast<std::size_t>(buffer_->texels())) throw Error("buffer " + buffer_->name + ": read outside of it");
    return BufferElement<T>::read(buffer_->data.data(), i);
  }
  T operator[](int i) const { return (*this)[static_cast<std::size_t>(static_cast<unsigned>(i))]; }
  T operator[](unsigned i) const { return (*this)[static_cast<std::size_t>(i)]; }

 private:
  const HostTexture* buffer_ = nullptr;
};

/// A member that holds numbers: scalar, vector or array.
template <class T>
struct Numbers {
  T* first = nullptr;
  int components = 1;  ///< of each element
  int most = 1;        ///< elements that have room
};

/// Name -> member, filled by the members' own initialisers.
struct Bindings {
  std::map<std::string, Numbers<int>> ints;
  std::map<std::string, Numbers<float>> floats;
  std::map<std::string, Numbers<double>> doubles;
  std::map<std::string, Bindable*> resources;
};

struct Bound {
  Bound(Bindings& b, const char* name, int* p, int most = 1) { b.ints[name] = {p, 1, most}; }
  Bound(Bindings& b, const char* name, ivec3* p, int most = 1) { b.ints[name] = {&p->x, 3, most}; }
  Bound(Bindings& b, const char* name, float* p, int most = 1) { b.floats[name] = {p, 1, most}; }
  Bound(Bindings& b, const char* name, vec2* p, int most = 1) { b.floats[name] = {&p->x, 2, most}; }
  Bound(Bindings& b, const char* name, vec3* p, int most = 1) { b.floats[name] = {&p->x, 3, most}; }
  Bound(Bindings& b, const char* name, double* p, int most = 1) { b.doubles[name] = {p, 1, most}; }
  Bound(Bindings& b, const char* name, dvec2* p, int most = 1) { b.doubles[name] = {&p->x, 2, most}; }
  Bound(Bindings& b, const char* name, dvec3* p, int most = 1) { b.doubles[name] = {&p->x, 3, most}; }
  Bound(Bindings& b, const char* name, Bindable* p) { b.resources[name] = p; }
  template <class T, std::size_t n>
  Bound(Bindings& b, const char* name, ValueTexture<T> (&textures)[n]) {
    for (std::size_t i = 0; i < n; ++i) b.resources[element_name(name, static_cast<int>(i))] = &textures[i];
  }
};

inline float bits_to_float(std::uint32_t bits) { return __builtin_bit_cast(float, bits); }

}  // namespace amrtex::portable
