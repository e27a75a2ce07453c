// Files may claim sizes that no memory holds: found out before anything is allocated.
#pragma once

#include <cstdint>
#include <filesystem>

#include "structures/mesh/checked.hpp"

namespace amrtex {

/// Throws BudgetError where the values of so many cells and fields, of so many bytes each, take more than this machine has.
void require_memory(const std::filesystem::path& path, CheckedSize cells, std::size_t fields,
                    std::size_t bytes_each = sizeof(double));

}  // namespace amrtex
