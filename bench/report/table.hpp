// Tables as text: Markdown to read, LaTeX (booktabs) for papers, CSV with every digit.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace amrtex {

/// A median and its spread, in the column's unit.
struct Spread {
  double median;
  double deviation;
};

/// monostate: there is no value.
using Cell = std::variant<std::monostate, std::string, std::int64_t, double, Spread>;

struct Column {
  std::string key;    ///< as in columns.json and CSV
  std::string label;  ///< with its unit in brackets: "total (MiB)"
  std::string latex;  ///< the same in LaTeX; empty = the label, escaped
  bool numeric = false;
};

struct Table {
  std::string title;
  std::vector<std::pair<std::string, std::string>> constants;  ///< said once above the table
  std::vector<std::string> notes;
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows;  ///< a cell a column
};

/// At least 3 significant digits, without a needless exponent: "0.01234", "123456", "1.20e-07".
std::string format_number(double value);
/// One cell to read; "–" where there is no value.
std::string format_cell(const Cell& cell);
/// All digits; empty where there is no value. A spread gives its median.
std::string exact_cell(const Cell& cell);
std::string escape_latex(std::string_view text);
std::string escape_markdown(std::string_view text);

std::string to_markdown(const Table& table);
/// Constants become columns, so that the file stands alone; a spread becomes two columns, the second "<key>_mad".
std::string to_csv(const Table& table);
/// A `table` environment; needs the packages booktabs and graphicx.
std::string to_latex(const Table& table);

}  // namespace amrtex
