// The page itself: a text of HTML that asks no network for anything.
#pragma once

#include <string>

#include "bench/report/page/page_data.hpp"

namespace amrtex {

/// Whether the page brings its scripts along, or takes them from scripts.js beside it, which a gallery's pages share.
enum class Scripts { inside, beside };

std::string page_html(const PageData& page, Scripts scripts);
/// What scripts.js holds.
std::string shared_scripts();
/// Are plots drawn by Vega, so that they answer to the pointer?
bool has_live_plots();

/// A table to be read without scripts.
std::string to_html(const Table& table);
/// JSON between <script> and </script>, whatever its texts say.
std::string script_json(const Json& json);
/// A text with its {{places}} filled; what is filled in is not looked at again.
std::string filled(std::string_view text, const std::map<std::string, std::string>& places);

}  // namespace amrtex
