// The GLSL half of the portable subset: one text, compiled for the context and,
// through portable_cpp.hpp, as C++ in float and double (README.md, "Portable subset").
#define AMRTEX_CPP 0
#define AMRTEX_BELOW_ONE 0.99999994  // the largest real below 1

#define real float
#define vec2r vec2
#define vec3r vec3
#define vec4r vec4
#if AMRTEX_RAY_DOUBLE
#define ray_real double
#define ray_vec3 dvec3
#else
#define ray_real float
#define ray_vec3 vec3
#endif

#define IN(T) in T
#define OUT(T) out T
#define INOUT(T) inout T
// The same operations in the same order everywhere, so that encodings, stages and the CPU have the same bits. llvmpipe contracts nothing,
// so there it is free; a GPU loses a fused multiply-add for each product that is added: some instructions a sample, which wait for
// the fetch anyway.
#define PRECISE precise
#define STRUCT struct

// declarations that C++ turns into members which are bound by name
#define UNIFORM(T, name) uniform T name;
#define VALUE_TEXTURE(name) uniform highp sampler3D name;
#define VALUE_TEXTURES(name, count, most) uniform highp sampler3D name[count];
#define INTEGER_TEXTURE(name) uniform highp usampler3D name;
#define UNIFORM_ARRAY(T, name, count, most) uniform T name[count];
#define BUFFER(T, name, block) \
  layout(std430) readonly restrict buffer block { T name[]; };
#define DEFINE_INT(name)

// A set of textures of values that handles reach (structures/common/texture_handles.hpp). `handles` is a storage buffer.
#define VALUE_TEXTURE_SET(name, handles, block) BUFFER(uvec2, handles, block)
#define SET_TEXEL(name, handle, texel) texelFetch(sampler3D(handle), texel, 0)
#define SET_FILTERED(name, handle, uvw) textureLod(sampler3D(handle), uvw, 0.0)
// One handle that is the same in all invocations that run together. Where a fetch may not see different handles
// (AMRTEX_HANDLE_TURNS > 1), each takes as many turns as its group has handles; else everyone's own comes at once.
#ifdef AMRTEX_HANDLE_TURNS
#if AMRTEX_HANDLE_TURNS > 1
#define SERVED_HANDLE(handle) uvec2(readFirstInvocationARB((handle).x), readFirstInvocationARB((handle).y))
#else
#define SERVED_HANDLE(handle) (handle)
#endif
#endif

#define as_real(bits) uintBitsToFloat(bits)
real no_value() { return uintBitsToFloat(0x7fc00000u); }
bool is_no_value(real v) { return (floatBitsToUint(v) & 0x7fffffffu) > 0x7f800000u; }
