// The one type of JSON values: keys keep the order in which they were written.
#pragma once

#include <nlohmann/json.hpp>

namespace amrtex {

using Json = nlohmann::ordered_json;

}  // namespace amrtex
