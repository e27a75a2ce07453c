#include "bench/report/page/gallery.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>
#include <regex>
#include <set>

#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/report/page/page.hpp"
#include "bench/report/page/page_assets.hpp"
#include "bench/report/page/shown_pictures.hpp"
#include "bench/report/repetitions.hpp"
#include "bench/report/report_files.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// A site is to stay below 25 MB, pictures are most of it.
constexpr int kGalleryPixels = 192;
constexpr std::size_t kMostProse = 1200;  // letters

bool holds_records(const fs::path& folder) {
  std::error_code absent;
  return fs::exists(folder / "records.jsonl", absent) || fs::exists(folder / "records.jsonl.gz", absent) ||
         separate_record(folder);
}

/// Links, emphasis and code as plain text on one line.
std::string plain_text(std::string text) {
  text = std::regex_replace(text, std::regex("!?\\[([^\\]]*)\\]\\([^)]*\\)"), "$1");
  text = std::regex_replace(text, std::regex("[*`]|\\s+"), " ");
  text = std::regex_replace(text, std::regex(" +([,.:;])"), "$1");
  text = std::regex_replace(text, std::regex(" +"), " ");
  const std::size_t first = text.find_first_not_of(' ');
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(' ') + 1 - first);
}

/// The paragraph behind a word in bold.
std::string paragraph(const std::string& text, const std::string& word) {
  const std::string front = "**" + word + ".**";
  const std::size_t at = text.find(front);
  if (at == std::string::npos) return "";
  const std::size_t begin = at + front.size(), end = text.find("\n\n", begin);
  std::string part = plain_text(text.substr(begin, end == std::string::npos ? end : end - begin));
  if (part.size() <= kMostProse) return part;
  const std::size_t stop = part.rfind(". ", kMostProse);
  return part.substr(0, stop == std::string::npos ? kMostProse : stop + 1);
}

/// One experiment of the gallery.
struct Entry {
  std::string name, file, cover;
  bool plot_cover = false;
  Prose prose;
  std::size_t points = 0, pictures = 0;
};

/// The first plot, where there is no picture.
void take_plot(Entry& entry, const std::vector<ReportPart>& parts) {
  for (const ReportPart& part : parts)
    for (const Plot& plot : report_plots(part.records)) {
      std::string uri = data_uri(to_svg(plot));
      entry.cover = uri.replace(0, uri.find(';'), "data:image/svg+xml");
      entry.plot_cover = true;
      return;
    }
}

std::string entry_html(const Entry& e) {
  const std::string inner = e.cover.empty() ? "" : fmt::format("<img src=\"{}\" alt=\"\">", e.cover);
  const std::string kind = e.cover.empty() ? " none" : e.plot_cover ? " plot-cover" : "";
  const std::string count = e.points == 0 ? "no records" : fmt::format("{} points, {} pictures", e.points, e.pictures);
  const std::string text =
      fmt::format("<div class=\"cover{}\">{}</div><div class=\"text\"><h2>{}</h2><p>{}</p><p class=\"count\">{}</p></div>", kind,
                  inner, escape_markup(e.name), escape_markup(e.prose.question), count);
  if (e.file.empty()) return fmt::format("<div class=\"entry\">{}</div>\n", text);
  return fmt::format("<a class=\"entry\" href=\"{}\">{}</a>\n", escape_markup(e.file), text);
}

std::string index_html(const std::vector<Entry>& entries) {
  std::string list;
  std::size_t points = 0, pages = 0;
  for (const Entry& e : entries) {
    list += entry_html(e);
    points += e.points;
    pages += e.file.empty() ? 0 : 1;
  }
  const PageAssets assets = page_assets();
  return filled(
      assets.index,
      {{"title", "amrtex: encodings of AMR data, measured"},
       {"subtitle", fmt::format("{} experiments, {} points: memory, frame time and image error in one row", pages, points)},
       {"style", std::string(assets.style)},
       {"entries", list},
       {"version", std::string(assets.version)}});
}

/// A name of a file in a link: letters, digits, underscores.
std::string file_name(const std::string& name) {
  std::set<std::string> used;
  return diagram_name("", name, used).substr(1) + ".html";
}

Entry write_entry(const fs::path& experiment, const std::vector<fs::path>& folders, const fs::path& site, Gallery& gallery) {
  Entry entry{experiment.filename().string(), "", "", false, read_prose(experiment / "README.md"), 0, 0};
  std::vector<ReportPart> parts;
  for (const fs::path& folder : folders) {
    ReportPart part = read_part(folder, gallery.warnings);
    if (!part.records.empty()) parts.push_back(std::move(part));
  }
  if (parts.empty()) {
    gallery.without.push_back(entry.name);
    return entry;
  }
  PageOptions options{entry.name, entry.prose.question, entry.prose.conclusion, {}, kGalleryPixels, has_live_plots()};
  const PageData page = page_data(parts, options);
  gallery.warnings.insert(gallery.warnings.end(), page.warnings.begin(), page.warnings.end());
  entry.file = file_name(entry.name);
  entry.points = page.json["labels"].size();
  entry.pictures = page.pictured.size();
  entry.cover = page.cover;
  if (entry.cover.empty()) take_plot(entry, parts);
  write_atomically(site / entry.file, page_html(page, Scripts::beside));
  ++gallery.pages;
  return entry;
}

}  // namespace

Prose read_prose(const fs::path& readme) {
  std::ifstream file(readme);
  if (!file) return {};
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return {paragraph(text, "Question"), paragraph(text, "Conclusion")};
}

Prose prose_of_results(const fs::path& folder) {
  const fs::path experiment = experiment_of_results(folder);
  return experiment.empty() ? Prose{} : read_prose(experiment / "README.md");
}

ReportPart read_part(const fs::path& folder, std::vector<std::string>& warnings) {
  RecordLines lines = load_record_lines(folder);
  warnings.insert(warnings.end(), lines.warnings.begin(), lines.warnings.end());
  ReportPart part{folder, one_a_point(lines.records), {}, {}};
  FolderTables tables = asked_tables(folder, part.records);
  part.tables = std::move(tables.asked);
  part.diagrams = std::move(tables.scatter);
  return part;
}

std::vector<fs::path> record_folders(const fs::path& experiment) {
  std::vector<fs::path> folders;
  if (holds_records(experiment)) folders.push_back(experiment);
  std::error_code failure;
  for (auto entry = fs::recursive_directory_iterator(experiment, fs::directory_options::skip_permission_denied, failure);
       !failure && entry != fs::recursive_directory_iterator(); entry.increment(failure)) {
    if (!entry->is_directory(failure) || entry->path().filename() == "records") continue;
    if (holds_records(entry->path())) folders.push_back(entry->path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

Gallery write_gallery(const fs::path& experiments, const fs::path& site) {
  Gallery gallery;
  std::error_code failure;
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(experiments, failure))
    if (entry.is_directory()) folders.push_back(entry.path());
  if (failure) throw Error(fmt::format("{}: {}; accepted: a folder of experiments", experiments.string(), reason_of(failure)));
  std::sort(folders.begin(), folders.end());
  std::map<fs::path, std::vector<fs::path>> records;
  for (const fs::path& folder : folders) records[folder] = record_folders(folder);
  if (std::all_of(records.begin(), records.end(), [](const auto& one) { return one.second.empty(); }))
    throw Error(
        fmt::format("{}: no folder in it holds records; accepted: a folder of experiments with results", experiments.string()));
  make_folder(site);
  std::vector<Entry> entries;
  for (const fs::path& folder : folders) entries.push_back(write_entry(folder, records[folder], site, gallery));
  write_atomically(site / "scripts.js", shared_scripts());
  write_atomically(site / "index.html", index_html(entries));
  return gallery;
}

}  // namespace amrtex
