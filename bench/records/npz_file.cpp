#include "bench/records/npz_file.hpp"

#include <fmt/format.h>
#include <zip.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "structures/mesh/error.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

constexpr std::int64_t kMostBytes = std::int64_t{1} << 32;  // of one array: what says more is no picture of ours
const std::vector<std::string> kTypes = {"<f2", "<f4", "<f8", "|u1"};

struct Discard {
  void operator()(zip_t* archive) const { ::zip_discard(archive); }
  void operator()(zip_file_t* file) const { ::zip_fclose(file); }
};
using Archive = std::unique_ptr<zip_t, Discard>;

/// A zip file in memory, while libzip writes it.
struct Buffer {
  zip_error_t error{};
  zip_source_t* source = nullptr;

  Buffer() {
    ::zip_error_init(&error);
    source = ::zip_source_buffer_create(nullptr, 0, 0, &error);
    if (source == nullptr) fail();
    ::zip_source_keep(source);  // beyond the archive's end
  }
  ~Buffer() {
    ::zip_source_free(source);
    ::zip_error_fini(&error);
  }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  [[noreturn]] void fail() { throw Error(fmt::format("a zip file in memory: {}", ::zip_error_strerror(&error))); }

  std::string bytes() {
    zip_stat_t stat;
    if (::zip_source_stat(source, &stat) != 0 || ::zip_source_open(source) != 0) fail();
    std::string text(stat.size, '\0');
    const zip_int64_t read = ::zip_source_read(source, text.data(), text.size());
    ::zip_source_close(source);
    if (read != static_cast<zip_int64_t>(text.size())) fail();
    return text;
  }
};

void add_file(zip_t* archive, const std::string& name, const std::string& text) {
  zip_source_t* const source = ::zip_source_buffer(archive, text.data(), text.size(), 0);
  const zip_int64_t index =
      source == nullptr ? -1 : ::zip_file_add(archive, name.c_str(), source, ZIP_FL_OVERWRITE | ZIP_FL_ENC_UTF_8);
  if (index < 0) {
    ::zip_source_free(source);
    throw Error(fmt::format("{} of a zip file: {}", name, ::zip_strerror(archive)));
  }
  ::zip_set_file_compression(archive, static_cast<zip_uint64_t>(index), ZIP_CM_DEFLATE, 6);
  constexpr zip_uint16_t kMidnight = 0, kFirstOf1980 = (1 << 5) | 1;  // no time of writing: equal arrays are equal files
  ::zip_file_set_dostime(archive, static_cast<zip_uint64_t>(index), kMidnight, kFirstOf1980, 0);
}

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  throw Error(fmt::format("{}: {}", path.string(), why));
}

std::string text_of(zip_t* archive, zip_uint64_t index, const std::filesystem::path& path) {
  zip_stat_t stat;
  if (::zip_stat_index(archive, index, 0, &stat) != 0) refuse(path, ::zip_strerror(archive));
  if (stat.size > static_cast<zip_uint64_t>(kMostBytes))
    refuse(path, fmt::format("an array of {} bytes; accepted: {}", stat.size, kMostBytes));
  const std::unique_ptr<zip_file_t, Discard> file(::zip_fopen_index(archive, index, 0));
  if (!file) refuse(path, ::zip_strerror(archive));
  std::string text(stat.size, '\0');
  if (::zip_fread(file.get(), text.data(), text.size()) != static_cast<zip_int64_t>(text.size())) refuse(path, "is damaged");
  char more = 0;  // libzip compares the checksum at the end of a file
  if (::zip_fread(file.get(), &more, 1) != 0) refuse(path, "is damaged");
  return text;
}

}  // namespace

void write_npz(const std::filesystem::path& path, const std::map<std::string, NpyArray>& arrays) {
  std::vector<std::string> texts;  // libzip reads them when the archive is closed
  for (const auto& [name, array] : arrays) texts.push_back(npy_text(array));
  Buffer buffer;
  Archive archive(::zip_open_from_source(buffer.source, ZIP_TRUNCATE, &buffer.error));
  if (!archive) buffer.fail();
  std::size_t next = 0;
  for (const auto& [name, array] : arrays) add_file(archive.get(), name + ".npy", texts[next++]);
  if (::zip_close(archive.get()) != 0) throw Error(fmt::format("{}: {}", path.string(), ::zip_strerror(archive.get())));
  static_cast<void>(archive.release());
  write_atomically(path, buffer.bytes());
}

std::map<std::string, NpyArray> read_npz(const std::filesystem::path& path) {
  int code = 0;
  const Archive archive(::zip_open(path.c_str(), ZIP_RDONLY, &code));
  if (!archive) {
    zip_error_t error;
    ::zip_error_init_with_code(&error, code);
    const std::string why = ::zip_error_strerror(&error);
    ::zip_error_fini(&error);
    refuse(path, why);
  }
  std::map<std::string, NpyArray> arrays;
  const zip_int64_t count = ::zip_get_num_entries(archive.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const auto index = static_cast<zip_uint64_t>(i);
    std::string name = ::zip_get_name(archive.get(), index, 0);
    const std::string in_file = fmt::format("{}, {}", path.string(), name);
    if (name.ends_with(".npy")) name.resize(name.size() - 4);
    arrays[name] = parse_npy(text_of(archive.get(), index, path), in_file, kTypes);
  }
  return arrays;
}

}  // namespace amrtex
