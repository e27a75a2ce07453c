// Bricks found by a hash: the worked example of CONTRIBUTING.md.
#pragma once

#include <memory>

#include "structures/common/encoding.hpp"

namespace amrtex {

std::unique_ptr<Encoding> make_example_encoding();

}  // namespace amrtex
