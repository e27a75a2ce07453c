#pragma once

#include <memory>

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Vollrath's octree texture with its LOD texture (README.md).
std::unique_ptr<Encoding> make_octree();

}  // namespace amrtex
