// Tables from records alone: one for each experiment and context, since the times of
// different contexts do not belong side by side.
#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bench/report/table.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

struct ReportOptions {
  /// Experiment name -> column keys in their order. Experiments that are not named get
  /// every measured column, and of the settings those that vary.
  std::map<std::string, std::vector<std::string>> columns;
};

/// Rows: by data set, encoding (registry order), build parameters, filter, storage,
/// filtering, then settings; numbers by value. Records that are not `ok` keep their row.
/// Rows whose picture was not checked are marked in a column `check`, whatever columns were chosen.
/// `relative` is the wall time divided by that of the first `uniform` record of the same
/// data set and render settings: of the same filter where there is one, else, for
/// linear filters, of another linear one. Throws UsageError for an unknown column.
std::vector<Table> make_tables(std::span<const Json> records, const ReportOptions& options = {});

/// A row for each of `rows` in their order (null: a row without values): the settings that differ among `all`, then the columns
/// `measures`. What is the same in all stands above the table. Throws UsageError for an unknown column.
Table make_setting_table(std::string title, std::span<const Json* const> rows, std::span<const Json* const> all,
                         std::span<const std::string_view> measures);

/// By data set, encoding, build parameters and so on: the order that rows have in tables.
std::vector<const Json*> in_table_order(std::span<const Json* const> records);

/// Why pictures of these records were not checked, and how many; null pointers are rows without a record. Nothing where all were.
std::vector<std::string> unchecked_notes(std::span<const Json* const> records);

/// Keys of all columns with a fixed name.
std::vector<std::string_view> column_keys();
/// A JSON list of column keys. Throws UsageError naming file, line and the known keys.
std::vector<std::string> read_columns(const std::filesystem::path& path);

}  // namespace amrtex
