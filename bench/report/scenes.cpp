#include "bench/report/scenes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "bench/numbers/pareto.hpp"
#include "bench/records/record.hpp"
#include "bench/report/contexts.hpp"

namespace amrtex {
namespace {

/// The `render` part of a record without the settings that work is traded for error by.
Json scene_part(Json render) {
  if (!render.is_object()) return render;
  for (const char* key :
       {"consumer", "sampling", "step", "integrator", "tolerance", "dispatch", "skip", "leap", "prune", "needs", "early_end", "slice_target",
        "iso_tolerance", "shadow_step", "level_of_detail", "max_level", "view_name", "transfer_function_name"})
    render.erase(key);
  return render;
}

std::string scene_name(const Json& record) {
  std::vector<std::string> parts;
  for (const char* pointer : {"/dataset/name", "/render/view_name", "/render/transfer_function_name", "/render/mode"})
    if (const std::string text = text_at(record, pointer); !text.empty()) parts.push_back(text);
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace

std::vector<ComparedScene> compared_scenes(std::span<const Json> records, bool common) {
  std::map<std::string, std::size_t> places;
  std::vector<ComparedScene> scenes;
  const ContextNames contexts(records);
  for (const Json& record : records) {
    const Json key = Json::array({contexts.of(record), value_at(record, "/dataset/hash"), value_at(record, "/dataset/exact_hash"),
                                  value_at(record, "/dataset/field"), scene_part(value_at(record, "/render")),
                                  common ? Json() : value_at(record, "/filter")});
    const std::string text = key.dump(-1, ' ', false, Json::error_handler_t::replace);
    const auto [place, added] = places.try_emplace(text, scenes.size());
    if (added)
      scenes.push_back({contexts.of(record), scene_name(record) + (common ? "" : ", " + text_at(record, "/filter")), {}});
    scenes[place->second].records.push_back(&record);
  }
  std::stable_sort(scenes.begin(), scenes.end(), [](const ComparedScene& a, const ComparedScene& b) { return a.name < b.name; });
  return scenes;
}

double number_at(const Json& record, const std::string& pointer) {
  const Json& value = value_at(record, pointer);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string text_at(const Json& record, const std::string& pointer) {
  const Json& value = value_at(record, pointer);
  return value.is_string() ? value.get<std::string>() : "";
}

double time_of(const Json& record) { return number_at(record, "/frame/wall_ms/median"); }

double share_of_peak(const Json& record, const std::string& error) {
  if (number_at(record, error + "/rmse") == 0) return 0;
  return relative_rmse(number_at(record, error + "/psnr_db"));
}

std::string what_error(std::span<const Json* const> records, bool common) {
  if (!common) return "error: against the reference of the row's own filter; page sizes define different fields";
  std::set<std::string> filters;
  for (const Json* record : records)
    if (const std::string filter = text_at(*record, "/error_common/filter"); !filter.empty()) filters.insert(filter);
  return fmt::format("error: against the reference of {}, the same for every filter (error_common)", fmt::join(filters, " and "));
}

}  // namespace amrtex
