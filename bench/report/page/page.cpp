#include "bench/report/page/page.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "bench/report/page/page_assets.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

std::string plain(const std::string& text) { return escape_markup(printable(text)); }

std::string head_of(const Table& table) {
  std::string row;
  for (const Column& c : table.columns)
    row += fmt::format("<th scope=\"col\"{}>{}</th>", c.numeric ? " class=\"number\"" : "", plain(c.label));
  return row;
}

std::string row_of(const Table& table, const std::vector<Cell>& cells) {
  std::string row;
  for (std::size_t c = 0; c < cells.size(); ++c)
    row += fmt::format("<td{}>{}</td>", table.columns[c].numeric ? " class=\"number\"" : "", plain(format_cell(cells[c])));
  return row;
}

/// Nothing may be asked for: no script, style, picture or connection but what is here.
std::string policy(Scripts scripts) {
  return fmt::format("default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {}",
                     scripts == Scripts::inside ? "'unsafe-inline'" : "'self' file:");
}

std::string own_scripts() { return fmt::format("(() => {{\n'use strict';\n{}}})();\n", page_assets().scripts); }

std::string licences() {
  const PageAssets assets = page_assets();
  if (assets.plots.empty())
    return "<p>The plots are still pictures: this amrtex was built without the npm packages vega, vega-lite and vega-embed, "
           "which "
           "<code>scripts/setup.sh</code> installs.</p>";
  return fmt::format(
      "<p>Plots are drawn by Vega, Vega-Lite and Vega-Embed (BSD 3-Clause), which hold parts of D3 (ISC), TopoJSON (ISC), "
      "fast-json-patch (MIT), json-stringify-pretty-compact (MIT) and semver (ISC).</p>\n<details "
      "class=\"licences\"><summary>Licences</summary><pre>{}</pre></details>",
      escape_markup(assets.licences));
}

std::string scripts_text(Scripts scripts) {
  if (scripts == Scripts::beside) return "<script src=\"scripts.js\"></script>";
  return fmt::format("<script>\n{}</script>", shared_scripts());
}

}  // namespace

bool has_live_plots() { return !page_assets().plots.empty(); }

std::string shared_scripts() { return fmt::format("{}\n{}", page_assets().plots, own_scripts()); }

std::string script_json(const Json& json) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<')
      safe += "\\u003c";  // neither </script> nor <!--
    else
      safe += c;
  }
  return safe;
}

std::string filled(std::string_view text, const std::map<std::string, std::string>& places) {
  std::string result;
  while (true) {
    const std::size_t open = text.find("{{");
    const std::size_t close = open == std::string_view::npos ? open : text.find("}}", open);
    if (close == std::string_view::npos) return result.append(text);
    result.append(text.substr(0, open));
    const auto place = places.find(std::string(text.substr(open + 2, close - open - 2)));
    result += place == places.end() ? "" : place->second;
    text.remove_prefix(close + 2);
  }
}

std::string to_html(const Table& table) {
  std::string text = fmt::format("<div class=\"given\">\n<h3>{}</h3>\n", plain(table.title));
  std::string notes;
  for (const auto& [key, value] : table.constants) notes += fmt::format("<li>{}: {}</li>", plain(key), plain(value));
  for (const std::string& note : table.notes) notes += fmt::format("<li>{}</li>", plain(note));
  if (!notes.empty()) text += fmt::format("<ul>{}</ul>\n", notes);
  text += fmt::format("<div class=\"scroll\"><table>\n<thead><tr>{}</tr></thead>\n<tbody>\n", head_of(table));
  for (const auto& row : table.rows) text += fmt::format("<tr>{}</tr>\n", row_of(table, row));
  return text + "</tbody></table></div>\n</div>\n";
}

std::string page_html(const PageData& page, Scripts scripts) {
  const PageAssets assets = page_assets();
  std::string tables;
  for (const Table& table : page.tables) tables += to_html(table);
  const bool paper = std::any_of(page.tables.begin(), page.tables.end(), [](const Table& table) {
    return std::any_of(table.columns.begin(), table.columns.end(), [](const Column& c) { return c.key.ends_with("_paper"); });
  });
  const auto text = [&](const char* key) { return plain(page.json.at(key).get<std::string>()); };
  return filled(assets.page, {{"policy", policy(scripts)},
                              {"title", text("title")},
                              {"subtitle", text("subtitle")},
                              {"question", text("question")},
                              {"conclusion", text("conclusion")},
                              {"home", scripts == Scripts::beside ? "<a href=\"index.html\">amrtex</a>" : "amrtex"},
                              {"style", std::string(assets.style)},
                              {"tables", tables},
                              {"tables_title", paper ? "The paper's numbers beside ours" : "Tables"},
                              {"tables_nav", paper ? "Paper" : "Tables"},
                              {"tables_hidden", page.tables.empty() ? "hidden" : ""},
                              {"version", std::string(assets.version)},
                              {"licences", licences()},
                              {"data", script_json(page.json)},
                              {"scripts", scripts_text(scripts)}});
}

}  // namespace amrtex
