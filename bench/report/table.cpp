#include "bench/report/table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr int kDigits = 4;

template <class... F>
struct Overloaded : F... {
  using F::operator()...;
};
template <class... F>
Overloaded(F...) -> Overloaded<F...>;

/// Shortest text that reads back as the same double.
std::string shortest(double value) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  return std::string(buffer, end);
}

/// 1.2e-07 -> $1.2\cdot10^{-7}$
std::string latex_number(double value) {
  const std::string text = format_number(value);
  const std::size_t e = text.find('e');
  if (e == std::string::npos) return text.front() == '-' ? fmt::format("${}$", text) : text;
  return fmt::format("${}\\cdot10^{{{}}}$", text.substr(0, e), std::stoi(text.substr(e + 1)));
}

std::string latex_cell(const Cell& cell) {
  return std::visit(
      Overloaded{[](std::monostate) { return std::string("--"); }, [](const std::string& text) { return escape_latex(text); },
                 [](std::int64_t n) { return fmt::format("{}", n); }, [](double x) { return latex_number(x); },
                 [](const Spread& s) { return fmt::format("{} $\\pm$ {}", latex_number(s.median), latex_number(s.deviation)); }},
      cell);
}

/// Cells and notes of a table that a terminal shows, too.
std::string on_one_line(std::string_view text) {
  std::string line(text);
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
  return line;
}

/// Of a letter in UTF-8, by its first byte.
std::size_t letter_bytes(char first) {
  const auto byte = static_cast<unsigned char>(first);
  return byte < 0x80 ? 1 : byte < 0xE0 ? 2 : byte < 0xF0 ? 3 : 4;
}

/// What means something else to LaTeX, or nothing to its standard fonts.
constexpr std::pair<std::string_view, std::string_view> kLatex[] = {
    {"&", "\\&"},
    {"%", "\\%"},
    {"$", "\\$"},
    {"#", "\\#"},
    {"_", "\\_"},
    {"{", "\\{"},
    {"}", "\\}"},
    {"~", "\\textasciitilde{}"},
    {"^", "\\textasciicircum{}"},
    {"\\", "\\textbackslash{}"},
    {"<", "\\textless{}"},
    {">", "\\textgreater{}"},
    {"|", "\\textbar{}"},
    {"\"", "''"},
    {"[", "{[}"},
    {"]", "{]}"},
    {"*", "{*}"},  // the last three mean something behind a row's end
    {"–", "--"},
    {"—", "---"},
    {"±", "$\\pm$"},
    {"×", "$\\times$"},
    {"·", "$\\cdot$"},
    {"≤", "$\\leq$"},
    {"≥", "$\\geq$"},
    {"²", "$^2$"},
    {"³", "$^3$"},
    {"→", "$\\to$"},
    {"−", "$-$"},
    {"…", "\\dots{}"},
    {"µ", "$\\mu$"},
    {"°", "$^\\circ$"}};

std::string latex_letter(std::string_view letter) {
  for (const auto& [plain, latex] : kLatex)
    if (letter == plain) return std::string(latex);
  if (letter.size() == 1) return std::string(letter);
  // accents of western Europe have their place in every font; others are named by their number
  std::uint32_t code = static_cast<unsigned char>(letter[0]) & (0xFFU >> (letter.size() + 1));
  for (const char c : letter.substr(1)) code = code << 6 | (static_cast<unsigned char>(c) & 0x3FU);
  const bool western = code >= 0xC0 && code <= 0xFF && code != 0xD0 && code != 0xD7 && code != 0xDE && code != 0xF0 &&
                       code != 0xF7 && code != 0xFE;
  return western ? std::string(letter) : fmt::format("{{[}}U+{:04X}{{]}}", code);
}

std::string escape_csv(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

bool has_spread(const Table& table, std::size_t column) {
  return std::any_of(table.rows.begin(), table.rows.end(),
                     [&](const auto& row) { return std::holds_alternative<Spread>(row[column]); });
}

std::string csv_header(const Table& table) {
  std::vector<std::string> names;
  for (const auto& [key, value] : table.constants) names.push_back(escape_csv(key));
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    names.push_back(escape_csv(table.columns[i].key));
    if (has_spread(table, i)) names.push_back(escape_csv(table.columns[i].key + "_mad"));
  }
  return fmt::format("{}\n", fmt::join(names, ","));
}

std::string csv_row(const Table& table, const std::vector<Cell>& row) {
  std::vector<std::string> cells;
  for (const auto& [key, value] : table.constants) cells.push_back(escape_csv(value));
  for (std::size_t i = 0; i < row.size(); ++i) {
    cells.push_back(escape_csv(exact_cell(row[i])));
    const Spread* spread = std::get_if<Spread>(&row[i]);
    if (has_spread(table, i)) cells.push_back(spread != nullptr ? shortest(spread->deviation) : "");
  }
  return fmt::format("{}\n", fmt::join(cells, ","));
}

}  // namespace

std::string format_number(double value) {
  if (!std::isfinite(value)) return fmt::format("{}", value);
  if (value == 0) return "0";
  const double magnitude = std::abs(value);
  if (magnitude < 1e-3 || magnitude >= 1e7) return fmt::format("{:.{}e}", value, kDigits - 2);
  if (magnitude >= 9999.5) return fmt::format("{:.0f}", value);
  return fmt::format("{:.{}g}", value, kDigits);
}

std::string format_cell(const Cell& cell) {
  return std::visit(
      Overloaded{[](std::monostate) { return std::string("–"); }, [](const std::string& text) { return text; },
                 [](std::int64_t n) { return fmt::format("{}", n); }, [](double x) { return format_number(x); },
                 [](const Spread& s) { return fmt::format("{} ± {}", format_number(s.median), format_number(s.deviation)); }},
      cell);
}

std::string exact_cell(const Cell& cell) {
  return std::visit(Overloaded{[](std::monostate) { return std::string(); }, [](const std::string& text) { return text; },
                               [](std::int64_t n) { return fmt::format("{}", n); }, [](double x) { return shortest(x); },
                               [](const Spread& s) { return shortest(s.median); }},
                    cell);
}

std::string escape_latex(std::string_view text) {
  const std::string line = printable(on_one_line(text));
  std::string escaped;
  for (std::size_t i = 0; i < line.size();) {
    const std::size_t bytes = letter_bytes(line[i]);
    escaped += latex_letter(std::string_view(line).substr(i, bytes));
    i += bytes;
  }
  return escaped;
}

std::string escape_markdown(std::string_view text) {
  std::string escaped;
  for (const char c : printable(on_one_line(text))) {
    // underscores inside words are literal in Markdown; these are not
    if (c == '|' || c == '\\' || c == '*' || c == '`' || c == '<' || c == '[') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string to_markdown(const Table& table) {
  std::string text = fmt::format("### {}\n\n", escape_markdown(table.title));
  for (const auto& [key, value] : table.constants)
    text += fmt::format("- {}: {}\n", escape_markdown(key), escape_markdown(value));
  for (const std::string& note : table.notes) text += fmt::format("- {}\n", escape_markdown(note));
  if (!table.constants.empty() || !table.notes.empty()) text += "\n";
  std::string rule = "|";
  text += "|";
  for (const Column& column : table.columns) {
    text += fmt::format(" {} |", escape_markdown(column.label));
    rule += column.numeric ? " ---: |" : " --- |";
  }
  text += "\n" + rule + "\n";
  for (const auto& row : table.rows) {
    text += "|";
    for (const Cell& cell : row) text += fmt::format(" {} |", escape_markdown(format_cell(cell)));
    text += "\n";
  }
  return text;
}

std::string to_csv(const Table& table) {
  std::string text = csv_header(table);
  for (const auto& row : table.rows) text += csv_row(table, row);
  return text;
}

std::string to_latex(const Table& table) {
  std::string caption = escape_latex(table.title) + ".";
  for (const auto& [key, value] : table.constants) caption += fmt::format(" {}: {}.", escape_latex(key), escape_latex(value));
  for (const std::string& note : table.notes) caption += fmt::format(" {}.", escape_latex(note));
  std::string alignment;
  std::vector<std::string> labels;
  for (const Column& column : table.columns) {
    alignment += column.numeric ? 'r' : 'l';
    labels.push_back(column.latex.empty() ? escape_latex(column.label) : column.latex);
  }
  std::string text = fmt::format("\\begin{{table}}\n\\centering\n\\caption{{{}}}\n\\resizebox{{\\linewidth}}{{!}}{{%\n", caption);
  text += fmt::format("\\begin{{tabular}}{{{}}}\n\\toprule\n{} \\\\\n\\midrule\n", alignment, fmt::join(labels, " & "));
  for (const auto& row : table.rows) {
    std::vector<std::string> cells;
    for (const Cell& cell : row) cells.push_back(latex_cell(cell));
    text += fmt::format("{} \\\\\n", fmt::join(cells, " & "));
  }
  return text + "\\bottomrule\n\\end{tabular}}\n\\end{table}\n";
}

}  // namespace amrtex
