#pragma once

#include <memory>

#include "structures/common/encoding.hpp"

namespace amrtex {

/// The dense baseline: one 3D texture of a whole level (README.md).
std::unique_ptr<Encoding> make_uniform();

}  // namespace amrtex
