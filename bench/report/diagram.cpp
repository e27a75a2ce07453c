#include "bench/report/diagram.hpp"

#include <fmt/format.h>

namespace amrtex {
namespace {

/// Letters, digits and single underscores.
std::string slug(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    if (plain)
      name += c;
    else if (!name.empty() && name.back() != '_')
      name += '_';
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name;
}

}  // namespace

std::string diagram_name(const std::string& kind, const std::string& what, std::set<std::string>& used) {
  const std::string wanted = kind + "_" + slug(what);
  std::string name = wanted;
  for (int i = 2; !used.insert(name).second; ++i) name = fmt::format("{}_{}", wanted, i);
  return name;
}

}  // namespace amrtex
