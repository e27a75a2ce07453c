#include "bench/report/page/page_data.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "bench/records/record.hpp"
#include "bench/report/contexts.hpp"
#include "bench/report/page/page_plots.hpp"
#include "bench/report/page/shared_parts.hpp"
#include "bench/report/page/shown_pictures.hpp"
#include "bench/report/report.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

/// A scene of a part, and what it comes to.
struct PageScene {
  std::size_t part;
  ComparedScene scene;
  SceneFacts facts;
};

/// Columns that a table of all points shows before anybody chooses others.
constexpr const char* kShownMeasures[] = {"wall", "total", "psnr", "psnr_common", "build", "samples", "status"};
/// Ratios of one record to another, which a table over several contexts cannot have.
constexpr const char* kRatios[] = {"relative"};

template <std::size_t N>
bool is_one_of(const char* const (&list)[N], std::string_view key) {
  return std::any_of(std::begin(list), std::end(list), [&](const char* one) { return key == one; });
}

std::string dumped(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

// --- scenes ---

bool has_common(const Records& records) {
  return std::any_of(records.begin(), records.end(),
                     [](const Json* r) { return value_at(*r, "/error_common/rmse").is_number(); });
}

/// Errors against the common reference where there are any, else against the own.
std::vector<std::pair<ComparedScene, bool>> judged_scenes(const std::vector<Json>& records) {
  std::vector<std::pair<ComparedScene, bool>> result;
  std::vector<ComparedScene> own = compared_scenes(records, false);
  for (ComparedScene& scene : compared_scenes(records, true)) {
    if (has_common(scene.records)) {
      result.emplace_back(std::move(scene), true);
      continue;
    }
    const std::set<const Json*> members(scene.records.begin(), scene.records.end());
    for (ComparedScene& one : own)
      if (!one.records.empty() && members.contains(one.records.front())) result.emplace_back(std::move(one), false);
  }
  return result;
}

std::vector<PageScene> scenes_of(const std::vector<ReportPart>& parts) {
  std::vector<PageScene> scenes;
  for (std::size_t p = 0; p < parts.size(); ++p)
    for (auto& [scene, common] : judged_scenes(parts[p].records)) {
      SceneFacts facts = facts_of(scene, common);
      scenes.push_back({p, std::move(scene), std::move(facts)});
    }
  // the one that says most stands first
  std::stable_sort(scenes.begin(), scenes.end(), [](const PageScene& a, const PageScene& b) {
    return a.part != b.part ? a.part < b.part : a.scene.records.size() > b.scene.records.size();
  });
  return scenes;
}

Json plot_json(const Plot& plot, bool live) {
  const Json drawn = live ? to_vega_lite(plot) : Json(to_svg(plot));
  return {{"kind", plot.name}, {"title", plot.title}, {"note", plot.note}, {live ? "spec" : "svg", drawn}};
}

Json plots_json(const std::vector<Plot>& plots, bool live) {
  Json list = Json::array();
  for (const Plot& plot : plots) list.push_back(plot_json(plot, live));
  return list;
}

Json answers_json(const PageScene& s, const PointNumbers& numbers) {
  Json list = Json::array();
  for (const Answer& a : s.facts.answers)
    list.push_back({{"asked", a.asked},
                    {"point", a.record ? Json(numbers.at(s.scene.records[*a.record])) : Json()},
                    {"setting", a.setting},
                    {"cost", a.cost}});
  return list;
}

Json scene_json(const PageScene& s, const PointNumbers& numbers, bool live) {
  return {{"name", s.scene.name.empty() ? "all points" : s.scene.name},
          {"context", s.scene.context},
          {"experiment", text_at(*s.scene.records.front(), "/experiment")},
          {"points", s.scene.records.size()},
          {"error", what_error(s.scene.records, s.facts.common)},
          {"smallest", s.facts.smallest},
          {"fastest", s.facts.fastest},
          {"answers", answers_json(s, numbers)},
          {"plots", plots_json(scene_plots(s.scene, s.facts, numbers), live)}};
}

// --- the table of all points ---

/// Seven digits are more than a table shows.
Json cell_json(const Cell& cell) {
  const auto number = [](double x) -> Json {
    if (!std::isfinite(x)) return nullptr;
    return std::stod(fmt::format("{:.7g}", x));
  };
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  if (const auto* count = std::get_if<std::int64_t>(&cell)) return *count;
  if (const auto* value = std::get_if<double>(&cell)) return number(*value);
  if (const auto* spread = std::get_if<Spread>(&cell)) return Json::array({number(spread->median), number(spread->deviation)});
  return nullptr;
}

bool is_measure(const std::vector<std::string_view>& measures, const std::string& key) {
  return std::find(measures.begin(), measures.end(), key) != measures.end();
}

/// Keys behind the first measure, which is that of memory.
std::vector<std::string_view> measure_keys() {
  std::vector<std::string_view> keys = column_keys();
  keys.erase(keys.begin(), std::find(keys.begin(), keys.end(), "total"));
  std::erase_if(keys, [](std::string_view key) { return is_one_of(kRatios, key); });
  return keys;
}

bool says_something(const Table& table, std::size_t column) {
  return std::any_of(table.rows.begin(), table.rows.end(), [&](const auto& row) {
    const auto* text = std::get_if<std::string>(&row[column]);
    return text != nullptr ? !text->empty() : !std::holds_alternative<std::monostate>(row[column]);
  });
}

/// What no column of tables tells: which experiment and which renderer.
void add_origin(Table& table, const Records& records, const std::vector<std::string>& renderers) {
  std::set<std::string> experiments;
  for (const Json* record : records) experiments.insert(text_at(*record, "/experiment"));
  const auto add = [&](const char* key, const std::function<Cell(std::size_t)>& cell) {
    table.columns.insert(table.columns.begin(), {key, key, "", false});
    for (std::size_t row = 0; row < table.rows.size(); ++row) table.rows[row].insert(table.rows[row].begin(), cell(row));
  };
  if (std::set<std::string>(renderers.begin(), renderers.end()).size() > 1)
    add("renderer", [&](std::size_t row) { return Cell(renderers[row]); });
  if (experiments.size() > 1) add("experiment", [&](std::size_t row) { return Cell(text_at(*records[row], "/experiment")); });
}

Json point_table(const Records& records, const std::vector<std::string>& renderers) {
  const std::vector<std::string_view> measures = measure_keys();
  Table table = make_setting_table("", records, records, measures);
  add_origin(table, records, renderers);
  Json columns = Json::array(), rows = Json::array();
  std::vector<std::size_t> kept;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const Column& column = table.columns[c];
    if (!says_something(table, c)) continue;
    kept.push_back(c);
    const bool shown = !is_measure(measures, column.key) || is_one_of(kShownMeasures, column.key);
    columns.push_back({{"key", column.key}, {"label", column.label}, {"numeric", column.numeric}, {"shown", shown}});
  }
  for (const auto& row : table.rows) {
    Json cells = Json::array();
    for (const std::size_t c : kept) cells.push_back(cell_json(row[c]));
    rows.push_back(std::move(cells));
  }
  Json constants = Json::array();
  for (const auto& [name, value] : table.constants) constants.push_back({name, value});
  return {{"columns", columns}, {"rows", rows}, {"constants", constants}, {"notes", table.notes}};
}

// --- points ---

/// A word of a shell's command line.
std::string shell_word(const std::string& text) {
  constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+";
  if (!text.empty() && text.find_first_not_of(plain) == std::string::npos) return text;
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

/// Null where the record does not say what was asked for.
Json command_again(const Json& record, const std::filesystem::path& folder) {
  const std::string hash = text_at(record, "/configuration");
  if (hash.empty() || !value_at(record, "/asked").is_object()) return nullptr;
  return fmt::format("amrtex run --from-record {} {} --out out/again", shell_word(folder.string()), shell_word(hash));
}

// --- pictures ---

/// Points whose pictures are worth a look, scene by scene in turn: picked ones, then answers, the worst, then fronts.
std::vector<const Json*> pictured(const std::vector<PageScene>& scenes, const Records& points, const PageOptions& options) {
  std::vector<const Json*> order;
  std::set<const Json*> seen;
  const auto add = [&](const Json* record) {
    if (seen.insert(record).second) order.push_back(record);
  };
  for (const std::string& hash : options.picked)
    for (const Json* record : points)
      if (!hash.empty() && text_at(*record, "/configuration").starts_with(hash)) add(record);
  std::vector<Records> by_scene;
  for (const PageScene& s : scenes) {
    Records list;
    for (const Answer& a : s.facts.answers)
      if (a.record) list.push_back(s.scene.records[*a.record]);
    const Json* worst = nullptr;
    for (const Json* record : s.scene.records)
      if (const double db = decibels_of(*record, s.facts.common);
          std::isfinite(db) && (worst == nullptr || db < decibels_of(*worst, s.facts.common)))
        worst = record;
    if (worst != nullptr) list.push_back(worst);
    for (const auto* front : {&s.facts.time_front, &s.facts.byte_front})
      for (const std::size_t i : *front) list.push_back(s.scene.records[i]);
    by_scene.push_back(std::move(list));
  }
  for (std::size_t rank = 0, left = 1; left > 0; ++rank) {
    left = 0;
    for (const Records& list : by_scene) {
      if (rank < list.size()) add(list[rank]);
      left += rank + 1 < list.size() ? 1 : 0;
    }
  }
  return order;
}

/// Pictures as they are collected: each image once, whoever shows it.
class Album {
 public:
  Album(const std::vector<ReportPart>& parts, const PageOptions& options) : options_(options) {
    for (const ReportPart& part : parts) folders_.emplace_back(part.folder);
  }

  void add(const Json& record, std::size_t part, int point, PageData& page) {
    if (pictures_.size() >= kMostPictures || bytes_ >= kMostPictureBytes) return;
    try {
      std::optional<ShownPicture> shown = folders_[part].find(record, options_.most_pixels);
      if (!shown) return;
      Json json = {{"point", point}, {"width", shown->width}, {"height", shown->height}};
      json["image"] = place_of(picture_png(*shown));
      json["reference"] = shown->reference.empty() ? Json() : Json(place_of(reference_png(*shown)));
      json["difference"] = shown->difference.empty() ? Json() : Json(place_of(difference_png(*shown)));
      json["scale"] = shown->scale;
      json["largest"] = shown->largest;
      pictures_.push_back(std::move(json));
      page.pictured.push_back(&record);
    } catch (const Error& error) {
      page.warnings.emplace_back(error.what());
    }
  }

  void give(PageData& page) {
    if (!pictures_.empty()) page.cover = images_.at(pictures_[0]["image"].get<std::size_t>()).get<std::string>();
    page.json["pictures"] = std::move(pictures_);
    page.json["images"] = std::move(images_);
    page.json["difference_colors"] = difference_colors(33);
  }

 private:
  std::size_t place_of(const std::string& png) {
    const auto [found, added] = places_.try_emplace(png, images_.size());
    if (added) {
      images_.push_back(data_uri(png));
      bytes_ += images_.back().get_ref<const std::string&>().size();
    }
    return found->second;
  }

  const PageOptions& options_;
  std::vector<PictureFolder> folders_;
  std::map<std::string, std::size_t> places_;
  Json pictures_ = Json::array(), images_ = Json::array();
  std::size_t bytes_ = 0;
};

// --- the foot ---

/// Values at a pointer, each once, in their order.
std::vector<std::string> texts_at(const Records& records, const char* pointer) {
  std::set<std::string> texts;
  for (const Json* record : records)
    if (const Json& value = value_at(*record, pointer); !value.is_null())
      texts.insert(value.is_string() ? value.get<std::string>() : dumped(value));
  return {texts.begin(), texts.end()};
}

Json context_json(const std::string& name, const Records& records) {
  constexpr std::pair<const char*, const char*> rows[] = {{"renderer", "/context/renderer"},
                                                          {"device", "/context/device"},
                                                          {"GL version", "/context/gl_version"},
                                                          {"processor", "/context/cpu"},
                                                          {"cores", "/context/cores"},
                                                          {"driver variables", "/context/environment"},
                                                          {"build type", "/context/build_type"},
                                                          {"compiler", "/context/compiler"},
                                                          {"commit", "/context/commit"},
                                                          {"changed since the commit", "/context/dirty"},
                                                          {"missing extensions", "/context/extensions_missing"}};
  Json list = Json::array();
  for (const auto& [label, pointer] : rows) {
    const std::vector<std::string> texts = texts_at(records, pointer);
    if (!texts.empty()) list.push_back({label, fmt::format("{}", fmt::join(texts, ", "))});
  }
  if (const std::vector<std::string> dates = texts_at(records, "/context/date"); !dates.empty())
    list.push_back({"measured", dates.size() == 1 ? dates.front() : fmt::format("{} to {}", dates.front(), dates.back())});
  return {{"name", name}, {"points", records.size()}, {"rows", list}};
}

Json contexts_json(const Records& points, const std::vector<std::string>& renderers) {
  std::map<std::string, Records> by_context;
  for (std::size_t i = 0; i < points.size(); ++i) by_context[renderers[i]].push_back(points[i]);
  Json list = Json::array();
  for (const auto& [name, records] : by_context) list.push_back(context_json(name, records));
  return list;
}

/// How often each of these was said, the most frequent first.
Json counted(const std::map<std::vector<std::string>, std::int64_t>& counts) {
  std::vector<std::pair<std::vector<std::string>, std::int64_t>> list(counts.begin(), counts.end());
  std::stable_sort(list.begin(), list.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  Json json = Json::array();
  for (const auto& [texts, count] : list) {
    Json row = Json::array({count});
    for (const std::string& text : texts) row.push_back(text);
    json.push_back(std::move(row));
  }
  return json;
}

/// [points, encoding, status, reason].
Json not_measured(const Records& points) {
  std::map<std::vector<std::string>, std::int64_t> counts;
  for (const Json* r : points)
    if (text_at(*r, "/status") != "ok") ++counts[{text_at(*r, "/encoding"), text_at(*r, "/status"), text_at(*r, "/reason")}];
  return counted(counts);
}

/// [points, encoding, what, why].
Json left_out(const Records& points) {
  std::map<std::vector<std::string>, std::int64_t> counts;
  for (const Json* r : points)
    if (const Json& list = value_at(*r, "/left_out"); list.is_array())
      for (const Json& item : list) ++counts[{text_at(*r, "/encoding"), text_at(item, "/what"), text_at(item, "/why")}];
  return counted(counts);
}

/// [points, what].
Json warnings(const Records& points) {
  std::map<std::vector<std::string>, std::int64_t> counts;
  for (const Json* r : points) {
    if (const Json& list = value_at(*r, "/context/warnings"); list.is_array())
      for (const Json& text : list)
        if (text.is_string()) ++counts[{text.get<std::string>()}];
    if (value_at(*r, "/check").is_null() && value_at(*r, "/check_reason").is_string())
      ++counts[{"unchecked: " + text_at(*r, "/check_reason")}];
  }
  return counted(counts);
}

// --- the head ---

/// "1 point", "3 points".
std::string count_text(std::size_t count, const char* one, const char* many) {
  return fmt::format("{} {}", count, count == 1 ? one : many);
}

std::string question_of(const Records& points) {
  const std::size_t encodings = texts_at(points, "/encoding").size(), datasets = texts_at(points, "/dataset/name").size();
  return fmt::format("Of {} ({}, {}): which is the smallest, and which the fastest that is exact enough?",
                     count_text(points.size(), "point", "points"), count_text(encodings, "encoding", "encodings"),
                     count_text(datasets, "data set", "data sets"));
}

std::string subtitle_of(const Records& points, const std::vector<std::string>& renderers) {
  std::vector<std::string> parts = {count_text(points.size(), "point", "points")};
  for (const char* pointer : {"/dataset/name", "/encoding"}) {
    const std::vector<std::string> texts = texts_at(points, pointer);
    const bool few = texts.size() <= 3;
    if (!texts.empty())
      parts.push_back(
          few ? fmt::format("{}", fmt::join(texts, ", "))
              : fmt::format("{} {}", texts.size(), std::string_view(pointer) == "/encoding" ? "encodings" : "data sets"));
  }
  const std::set<std::string> all(renderers.begin(), renderers.end());
  parts.push_back(all.size() == 1 ? *all.begin() : fmt::format("{} contexts", all.size()));
  if (const std::vector<std::string> dates = texts_at(points, "/context/date"); !dates.empty())
    parts.push_back(dates.back().substr(0, 10));
  return fmt::format("{}", fmt::join(parts, " · "));
}

/// All points, in the order of tables within their part.
struct Points {
  Records records;
  std::vector<std::size_t> parts;
  std::vector<std::string> renderers;
  PointNumbers numbers;
};

Points points_of(const std::vector<ReportPart>& parts) {
  Points points;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    Records own;
    for (const Json& record : parts[p].records) own.push_back(&record);
    const ContextNames names(parts[p].records);
    for (const Json* record : in_table_order(own)) {
      points.numbers[record] = static_cast<int>(points.records.size());
      points.records.push_back(record);
      points.parts.push_back(p);
      points.renderers.push_back(names.of(*record));
    }
  }
  return points;
}

/// What each point is called, and the scene that it is of.
void add_labels(const std::vector<PageScene>& scenes, const Points& points, Json& json) {
  std::vector<std::string> labels(points.records.size());
  std::vector<std::size_t> places(points.records.size());
  for (std::size_t s = 0; s < scenes.size(); ++s)
    for (std::size_t i = 0; i < scenes[s].scene.records.size(); ++i) {
      const auto number = static_cast<std::size_t>(points.numbers.at(scenes[s].scene.records[i]));
      labels[number] = scenes[s].facts.settings[i];
      places[number] = s;
    }
  json["labels"] = labels;
  json["scene_of"] = places;
}

void add_sizes(const std::vector<ReportPart>& parts, const PointNumbers& numbers, bool live, PageData& page) {
  Json plots = Json::array();
  for (const ReportPart& part : parts) {
    MeshSizes sizes = mesh_sizes(part.records, numbers);
    for (const Plot& plot : sizes.plots) plots.push_back(plot_json(plot, live));
    if (sizes.exponents) page.tables.insert(page.tables.begin(), std::move(*sizes.exponents));
  }
  page.json["mesh_size"] = std::move(plots);
}

Json diagrams_json(const std::vector<ReportPart>& parts) {
  Json list = Json::array();
  for (const ReportPart& part : parts)
    for (const Diagram& diagram : part.diagrams)
      list.push_back({{"kind", diagram.name},
                      {"title", diagram.specification.value("title", "")},
                      {"note", ""},
                      {"spec", diagram.specification}});
  return list;
}

}  // namespace

PageData page_data(const std::vector<ReportPart>& parts, const PageOptions& options) {
  PageData page;
  const Points points = points_of(parts);
  if (points.records.empty())
    throw Error(fmt::format("{}: no records; accepted: a folder that `amrtex run` wrote", options.title));
  const std::vector<PageScene> scenes = scenes_of(parts);
  page.json = {{"schema", "amrtex-page/1"},
               {"title", options.title},
               {"subtitle", subtitle_of(points.records, points.renderers)},
               {"question", options.question.empty() ? question_of(points.records) : options.question},
               {"conclusion", options.conclusion}};
  page.json["table"] = point_table(points.records, points.renderers);
  page.json["shared"] = share_parts(points.records);
  Json commands = Json::array(), scene_list = Json::array();
  for (std::size_t i = 0; i < points.records.size(); ++i)
    commands.push_back(command_again(*points.records[i], parts[points.parts[i]].folder));
  page.json["commands"] = std::move(commands);
  for (const PageScene& s : scenes) scene_list.push_back(scene_json(s, points.numbers, options.live_plots));
  page.json["scenes"] = std::move(scene_list);
  add_labels(scenes, points, page.json);
  for (const ReportPart& part : parts) page.tables.insert(page.tables.end(), part.tables.begin(), part.tables.end());
  add_sizes(parts, points.numbers, options.live_plots, page);
  page.json["diagrams"] = diagrams_json(parts);
  Album album(parts, options);
  for (const Json* record : pictured(scenes, points.records, options)) {
    const int number = points.numbers.at(record);
    album.add(*record, points.parts[static_cast<std::size_t>(number)], number, page);
  }
  album.give(page);
  page.json["contexts"] = contexts_json(points.records, points.renderers);
  page.json["not_measured"] = not_measured(points.records);
  page.json["left_out"] = left_out(points.records);
  page.json["warnings"] = warnings(points.records);
  return page;
}

std::vector<Plot> report_plots(const std::vector<Json>& records) {
  std::vector<Plot> plots;
  std::set<std::string> names;
  for (const auto& [scene, common] : judged_scenes(records))
    for (Plot& plot : scene_plots(scene, facts_of(scene, common), {})) {
      plot.title = fmt::format("{}: {}", plot.title, scene.name);
      plot.name = diagram_name(plot.name, scene.name, names);
      plots.push_back(std::move(plot));
    }
  for (Plot& plot : mesh_sizes(records, {}).plots) plots.push_back(std::move(plot));
  return plots;
}

}  // namespace amrtex
