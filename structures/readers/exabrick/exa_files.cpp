#include "structures/readers/exabrick/exa_files.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(fmt::format("{}: {}", file.string(), what));
}

fs::path with_ending(fs::path file, const char* ending) { return file.replace_extension(ending); }

bool is_file(const fs::path& file) {
  std::error_code ignored;
  return fs::is_regular_file(file, ignored);
}

/// Files `stem.<field>.scalars`, in the order of their names.
std::vector<ExaField> several_fields(const fs::path& geometry) {
  const std::string prefix = geometry.stem().string() + ".";
  const std::string ending = ".scalars";
  std::vector<ExaField> fields;
  std::error_code ignored;
  const fs::path folder = geometry.has_parent_path() ? geometry.parent_path() : fs::path(".");
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.size() > prefix.size() + ending.size() && name.starts_with(prefix) && name.ends_with(ending))
      fields.push_back({name.substr(prefix.size(), name.size() - prefix.size() - ending.size()), entry.path()});
  }
  std::sort(fields.begin(), fields.end(), [](const ExaField& a, const ExaField& b) { return a.name < b.name; });
  return fields;
}

/// `name.cells` or `name.bricks`, and the scalars of that name.
ExaFiles files_beside(const fs::path& geometry, bool bricks) {
  ExaFiles files{geometry, bricks, {}, {}};
  const fs::path one = with_ending(geometry, ".scalars");
  if (is_file(one))
    files.fields.push_back({geometry.stem().string(), one});
  else
    files.fields = several_fields(geometry);
  if (files.fields.empty())
    refuse(geometry, fmt::format("its values are missing: no file {} beside it", one.filename().string()));
  return files;
}

/// A line of a `.exa` file: words, without what stands behind '#'.
std::vector<std::string> words_of(std::string line) {
  line = line.substr(0, line.find('#'));
  std::vector<std::string> words;
  for (std::size_t at = 0; at < line.size();) {
    const std::size_t begin = std::min(line.find_first_not_of(" \t\r", at), line.size());
    const std::size_t end = std::min(line.find_first_of(" \t\r", begin), line.size());
    if (end > begin) words.push_back(line.substr(begin, end - begin));
    at = end;
  }
  return words;
}

/// Takes the lines of a `.exa` file.
class ExaDescription {
 public:
  explicit ExaDescription(const fs::path& file) : file_(file), in_(file.string(), load_text(file)) {}

  ExaFiles read() {
    while (in_.remaining() > 0) take(words_of(in_.line("a line")));
    if (files_.geometry.empty()) refuse(file_, "names no `bricks` and no `cells`");
    if (files_.fields.empty()) refuse(file_, "names no `scalar`");
    if (from_.size() != to_.size()) refuse(file_, "`remap_from` and `remap_to` go together");
    if (!from_.empty()) files_.remap = remap();
    return std::move(files_);
  }

 private:
  void take(const std::vector<std::string>& words) {
    if (words.empty()) return;
    const std::string& key = words[0];
    const auto need = [&](std::size_t count) {
      if (words.size() != count + 1) in_.fail(fmt::format("{} takes {} words, {} given", quote(key), count, words.size() - 1));
    };
    if (key == "scalar") {
      need(2);
      files_.fields.push_back({words[1], beside(words[2])});
    } else if (key == "vector") {
      need(4);
      for (std::size_t axis = 0; axis < 3; ++axis)
        files_.fields.push_back({fmt::format("{}_{}", words[1], "xyz"[axis]), beside(words[2 + axis])});
    } else if (key == "bricks" || key == "cells") {
      need(1);
      files_.geometry = beside(words[1]);
      files_.bricks = key == "bricks";
    } else if (key == "remap_from" || key == "remap_to") {
      need(6);
      (key == "remap_from" ? from_ : to_) = numbers(words);
    } else if (key != "value_range" && key != "triangles") {
      in_.fail(
          fmt::format("{} is no key; accepted are scalar, vector, bricks, cells, remap_from, remap_to, value_range and triangles",
                      quote(key)));
    }
  }

  fs::path beside(const std::string& name) const { return file_.parent_path() / name; }

  std::vector<double> numbers(const std::vector<std::string>& words) const {
    std::vector<double> values;
    for (std::size_t i = 1; i < words.size(); ++i) {
      double value = 0;
      const auto [end, failure] = std::from_chars(words[i].data(), words[i].data() + words[i].size(), value);
      if (failure != std::errc() || end != words[i].data() + words[i].size())
        in_.fail(fmt::format("{} takes numbers; found {}", quote(words[0]), quote(words[i])));
      values.push_back(value);
    }
    return values;
  }

  ExaRemap remap() const {
    const ExaRemap map{
        {from_[0], from_[1], from_[2]}, {from_[3], from_[4], from_[5]}, {to_[0], to_[1], to_[2]}, {to_[3], to_[4], to_[5]}};
    for (int axis = 0; axis < 3; ++axis)
      if (!(map.from_upper[axis] > map.from_lower[axis]) || !(map.to_upper[axis] > map.to_lower[axis]))
        refuse(file_, "the boxes of `remap_from` and `remap_to` need upper corners above their lower ones");
    return map;
  }

  fs::path file_;
  TextScanner in_;
  ExaFiles files_;
  std::vector<double> from_, to_;
};

/// The one data set of a folder.
fs::path file_in(const fs::path& folder) {
  for (const char* ending : {".exa", ".cells", ".bricks"}) {
    std::vector<std::string> names;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder, ignored))
      if (entry.path().extension() == ending) names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    if (names.size() == 1) return folder / names[0];
    if (names.size() > 1)
      throw UsageError(fmt::format("{}: holds several data sets; name one of {}", folder.string(), listed(names)));
  }
  refuse(folder, "holds no file .exa, .cells or .bricks");
}

}  // namespace

ExaFiles find_exa_files(const fs::path& path) {
  std::error_code ignored;
  const fs::path file = fs::is_directory(path, ignored) ? file_in(path) : path;
  const std::string ending = file.extension().string();
  if (ending == ".exa") return ExaDescription(file).read();
  if (ending == ".bricks") return files_beside(file, true);
  if (ending != ".scalars") return files_beside(file, false);
  for (const bool bricks : {false, true}) {
    const fs::path geometry = with_ending(file, bricks ? ".bricks" : ".cells");
    if (is_file(geometry)) return {geometry, bricks, {{file.stem().string(), file}}, {}};
  }
  refuse(file, fmt::format("its cells are missing: no file {} beside it", with_ending(file, ".cells").filename().string()));
}

std::uint64_t count_exa_elements(const fs::path& file, std::uint64_t bytes, std::string_view what) {
  const std::uint64_t size = regular_file_size(file);
  if (size == 0) refuse(file, "is empty");
  if (size % bytes != 0) refuse(file, fmt::format("{} bytes are no whole number of {} of {} bytes", size, what, bytes));
  return size / bytes;
}

std::uint64_t count_exa_scalars(const fs::path& scalars) { return count_exa_elements(scalars, sizeof(float), "values"); }

}  // namespace amrtex
