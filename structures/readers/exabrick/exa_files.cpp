#include "structures/readers/exabrick/exa_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <limits>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "the files are little endian and read as they are");

constexpr std::uint64_t kMostCells = std::numeric_limits<std::int32_t>::max();  // a brick's ids are 32-bit

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(fmt::format("{}: {}", file.string(), what));
}

/// Number of elements of `bytes` each; the file must hold whole ones.
std::uint64_t count_elements(const fs::path& file, std::uint64_t bytes, std::string_view what) {
  const std::uint64_t size = regular_file_size(file);
  if (size == 0) refuse(file, "is empty");
  if (size % bytes != 0) refuse(file, fmt::format("{} bytes are no whole number of {} of {} bytes", size, what, bytes));
  return size / bytes;
}

template <class T>
std::vector<T> load_elements(const fs::path& file, std::uint64_t count) {
  require_memory(file, CheckedSize::of(count * sizeof(T) / sizeof(double)), 1);
  std::vector<T> elements(static_cast<std::size_t>(count));
  std::ifstream in(file, std::ios::binary);
  in.read(reinterpret_cast<char*>(elements.data()), static_cast<std::streamsize>(count * sizeof(T)));
  if (!in) refuse(file, fmt::format("its {} bytes cannot be read", count * sizeof(T)));
  return elements;
}

ExaCells load_cells(const fs::path& file, std::uint64_t scalars) {
  const std::uint64_t count = count_elements(file, sizeof(ExaCell), "cells");
  if (count != scalars) refuse(file, fmt::format("{} cells, but its scalars are {} values", count, scalars));
  return {load_elements<ExaCell>(file, count), {}};
}

/// Reads bricks one after the other. Each is checked against what is left of the file before it is used.
class BrickScanner {
 public:
  BrickScanner(const fs::path& file, std::uint64_t scalars)
      : file_(file), words_(load_elements<std::int32_t>(file, count_elements(file, 4, "numbers"))), scalars_(scalars) {}

  ExaCells scan() {
    while (at_ < words_.size()) scan_brick();
    if (found_.cells.size() != scalars_)
      refuse(file_, fmt::format("its bricks hold {} cells, but its scalars are {} values", found_.cells.size(), scalars_));
    return std::move(found_);
  }

 private:
  [[noreturn]] void refuse_brick(const std::string& what) const { refuse(file_, fmt::format("brick {}: {}", bricks_, what)); }

  void scan_brick() {
    if (words_.size() - at_ < 7) refuse_brick(fmt::format("its head needs 28 bytes, {} are left", 4 * (words_.size() - at_)));
    const std::int32_t* head = &words_[at_];
    const Vec3i size(head[0], head[1], head[2]);
    const int level = head[6];
    at_ += 7;
    if (glm::any(glm::lessThan(size, Vec3i(1))))
      refuse_brick(fmt::format("its size is {} x {} x {} cells", size.x, size.y, size.z));
    if (level < 0 || level > kMostExaLevel) refuse_brick(fmt::format("its level is {}; accepted: 0 to {}", level, kMostExaLevel));
    const CheckedSize cells = CheckedSize(size.x) * CheckedSize(size.y) * CheckedSize(size.z);
    if (static_cast<std::uint64_t>(cells.or_most()) > words_.size() - at_)
      refuse_brick(
          fmt::format("its {} x {} x {} cells need as many numbers, {} are left", size.x, size.y, size.z, words_.size() - at_));
    const std::int64_t width = std::int64_t{1} << level;
    const auto corner = [&](int axis, int step) {
      const std::int64_t at = head[3 + axis] + step * width;
      if (at > std::numeric_limits<std::int32_t>::max()) refuse_brick("it reaches beyond 31 bits of index");
      return static_cast<std::int32_t>(at);
    };
    for_each_cell({Vec3i(0), size}, [&](const Vec3i& c) { add({corner(0, c.x), corner(1, c.y), corner(2, c.z), level}); });
    ++bricks_;
  }

  void add(const ExaCell& cell) {
    const std::int32_t id = words_[at_++];
    if (id < 0 || static_cast<std::uint64_t>(id) >= scalars_)
      refuse_brick(fmt::format("a cell's number is {}; its scalars are {} values", id, scalars_));
    found_.cells.push_back(cell);
    found_.scalar.push_back(static_cast<std::uint32_t>(id));
  }

  fs::path file_;
  std::vector<std::int32_t> words_;
  std::uint64_t scalars_;
  std::size_t at_ = 0;
  std::size_t bricks_ = 0;
  ExaCells found_;
};

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

ExaCells load_exa_cells(const ExaFiles& files, std::uint64_t scalars) {
  if (scalars > kMostCells) refuse(files.geometry, fmt::format("{} cells; at most {} are read", scalars, kMostCells));
  return files.bricks ? BrickScanner(files.geometry, scalars).scan() : load_cells(files.geometry, scalars);
}

std::uint64_t count_exa_scalars(const fs::path& scalars) { return count_elements(scalars, sizeof(float), "values"); }

std::vector<float> load_exa_scalars(const fs::path& scalars) { return load_elements<float>(scalars, count_exa_scalars(scalars)); }

}  // namespace amrtex
