#pragma once

#include <memory>

#include "structures/common/encoding.hpp"

namespace amrtex {

/// Vollrath's adaptive page table (README.md).
std::unique_ptr<Encoding> make_page_table();

}  // namespace amrtex
