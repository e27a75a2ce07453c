#pragma once

#include <memory>

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Kähler and Abel's kD-tree over the subgrids, with their bricks in one pool (README.md).
std::unique_ptr<Encoding> make_kd_tree();

}  // namespace amrtex
