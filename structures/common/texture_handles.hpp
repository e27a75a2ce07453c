// Textures that the shader reaches by 64-bit handles (ARB_bindless_texture) instead of binding each to a sampler.
//
// An encoding lists them in EncodedField::textures like all others, with one name for the set, the name of a buffer for
// their handles (HostTexture::handles) and their element in it. The uploader writes the handles; in shaders see
// VALUE_TEXTURE_SET in shaders/portable_glsl.h.
#pragma once

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Does the context take handles in shaders? The reason names the extension that is missing.
Support supports_handles(const ContextInfo& context);

/// To be asked before anything is allocated: `textures` textures a field for all fields of the request. Throws
/// UnsupportedError naming the parameter and the extension that the context lacks, or both numbers where it takes
/// fewer handles.
void require_handles(const Encoding& encoding, std::string_view parameter, std::int64_t textures, const BuildRequest& request);

/// What shaders with handles need of the context: extensions, and the define AMRTEX_HANDLE_TURNS. The statistics tell
/// whether invocations are served in turn (`handle_loop`).
void add_handle_access(const ContextInfo& context, EncodedField& field);

}  // namespace amrtex
