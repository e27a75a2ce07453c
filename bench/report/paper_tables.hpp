// Tables that set a paper's numbers beside those of records, as the file tables.json of
// an experiment asks for (format: docs/experiments.md).
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "bench/report/table.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

/// A table for each entry of the file and each context of the records; without records
/// the file is only checked. Throws UsageError naming file, line and key, also where
/// records of different values match one row.
std::vector<Table> make_paper_tables(const std::filesystem::path& path, std::span<const Json> records);

}  // namespace amrtex
