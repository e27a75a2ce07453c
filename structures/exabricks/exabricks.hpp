#pragma once

#include <memory>

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Bricks of leaf cells and active brick regions (Wald et al. 2020).
std::unique_ptr<Encoding> make_exabricks();

}  // namespace amrtex
