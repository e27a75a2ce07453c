#include "structures/readers/wanted_fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <string_view>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

std::string nearest(const std::vector<std::string>& there, const std::string& field) {
  std::vector<std::string> shown(there.size());
  std::transform(there.begin(), there.end(), shown.begin(), [](const std::string& name) { return clipped(name); });
  return suggestion(field, std::vector<std::string_view>(shown.begin(), shown.end()));
}

}  // namespace

std::vector<std::size_t> FieldChoice::among(const std::filesystem::path& path, const std::vector<std::string>& there) const {
  const std::size_t unnamed = first_ ? std::min<std::size_t>(1, there.size()) : there.size();
  std::vector<std::size_t> indices(names_.empty() ? unnamed : names_.size());
  std::iota(indices.begin(), indices.end(), std::size_t{0});
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const auto found = std::find(there.begin(), there.end(), names_[i]);
    if (found == there.end())
      throw UsageError(fmt::format("{}: no field {}{}; its fields are {}", path.string(), quote(names_[i]),
                                   nearest(there, names_[i]), listed(there)));
    indices[i] = static_cast<std::size_t>(found - there.begin());
  }
  return indices;
}

}  // namespace amrtex
