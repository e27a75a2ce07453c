// The texts that pages are made of; the build takes them from this folder and from npm packages.
#pragma once

#include <string_view>

namespace amrtex {

struct PageAssets {
  std::string_view page, index;  ///< templates: {{name}} is a place
  std::string_view style;
  std::string_view scripts;   ///< ours, one behind the other
  std::string_view plots;     ///< Vega, Vega-Lite, Vega-Embed; empty: not there when this was built
  std::string_view licences;  ///< of these
  std::string_view version;   ///< of amrtex
};

PageAssets page_assets();

}  // namespace amrtex
