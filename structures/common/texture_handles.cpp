#include "structures/common/texture_handles.hpp"

#include <fmt/format.h>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Invocations that run together: GL_ARB_shader_ballot allows no more.
constexpr int kLargestGroup = 64;

}  // namespace

Support supports_handles(const ContextInfo& context) {
  const char* missing = nullptr;
  if (!context.bindless_texture)
    missing = "GL_ARB_bindless_texture";
  else if (!context.handles_may_differ && !context.shader_ballot)
    missing = "GL_ARB_shader_ballot";
  if (missing == nullptr) return {};
  const std::string where = context.renderer.empty() ? "the context" : context.renderer;
  return {false, fmt::format("needs {}, which {} lacks", missing, where)};
}

void require_handles(const Encoding& encoding, std::string_view parameter, std::int64_t textures, const BuildRequest& request) {
  if (const Support support = supports_handles(request.context); !support.ok)
    throw UnsupportedError(fmt::format("encoding {}: {} {}", encoding.name(), parameter, support.reason));
  const int fields = request.field_count();
  const std::int64_t handles = textures * fields;
  if (handles > request.context.max_resident_handles)
    throw UnsupportedError(fmt::format("encoding {}: {}: {} textures x {} field{} need {} handles, the context takes {}",
                                       encoding.name(), parameter, textures, fields, fields == 1 ? "" : "s", handles,
                                       request.context.max_resident_handles));
}

void add_handle_access(const ContextInfo& context, EncodedField& field) {
  field.shader.extensions.emplace_back("GL_ARB_bindless_texture");
  if (!context.handles_may_differ) field.shader.extensions.emplace_back("GL_ARB_shader_ballot");
  field.shader.defines.emplace_back("AMRTEX_HANDLE_TURNS", context.handles_may_differ ? 1 : kLargestGroup);
  field.statistics["handle_loop"] = !context.handles_may_differ;
}

}  // namespace amrtex
