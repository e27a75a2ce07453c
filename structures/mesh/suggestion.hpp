// What somebody who wrote an unknown name probably meant.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace amrtex {

/// "; did you mean 'x'?", or nothing when no accepted name is near.
std::string suggestion(std::string_view name, std::span<const std::string_view> accepted);

}  // namespace amrtex
