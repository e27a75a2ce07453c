// Records share most of what they say: a data set, a view, a context. A page holds each part once.
#pragma once

#include <span>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// {"parts": […], "records": […]}: objects and arrays that occur several times stand in `parts`; where they stood is an object
/// with one key, kSharedPart, whose value is the number of the part. Parts may hold such objects, too.
Json share_parts(std::span<const Json* const> records);

/// No key of a record: a control character.
inline constexpr const char* kSharedPart = "\x01";

}  // namespace amrtex
