#include "structures/mesh/npz_file.hpp"

#include <fmt/format.h>
#include <zip.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "structures/mesh/error.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

constexpr zip_uint32_t kFast = 1;                 // a sweep waits for it
constexpr std::uint64_t kMostCompression = 1100;  // deflate packs at most 1032 bytes into one
constexpr std::size_t kNpyStartBytes = 10;        // magic, version, length of the header
const std::vector<std::string> kTypes = {"<f2", "<f4", "<f8", "<i4", "<i8", "|u1"};

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
  ::zip_set_file_compression(archive, static_cast<zip_uint64_t>(index), ZIP_CM_DEFLATE, kFast);
  constexpr zip_uint16_t kMidnight = 0, kFirstOf1980 = (1 << 5) | 1;  // no time of writing: equal arrays are equal files
  ::zip_file_set_dostime(archive, static_cast<zip_uint64_t>(index), kMidnight, kFirstOf1980, 0);
}

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  throw Error(fmt::format("{}: {}", path.string(), why));
}

std::string text_of(zip_t* archive, zip_uint64_t index, const std::filesystem::path& path) {
  zip_stat_t stat;
  if (::zip_stat_index(archive, index, 0, &stat) != 0) refuse(path, ::zip_strerror(archive));
  // what says more than its file can hold would be allocated first
  if (stat.size / kMostCompression > std::filesystem::file_size(path))
    refuse(path, fmt::format("says that it holds an array of {} bytes, more than its size can hold", stat.size));
  const std::unique_ptr<zip_file_t, Discard> file(::zip_fopen_index(archive, index, 0));
  if (!file) refuse(path, ::zip_strerror(archive));
  std::string text(stat.size, '\0');
  if (::zip_fread(file.get(), text.data(), text.size()) != static_cast<zip_int64_t>(text.size())) refuse(path, "is damaged");
  char more = 0;  // libzip compares the checksum at the end of a file
  if (::zip_fread(file.get(), &more, 1) != 0) refuse(path, "is damaged");
  return text;
}

Archive open_archive(const std::filesystem::path& path) {
  int code = 0;
  Archive archive(::zip_open(path.c_str(), ZIP_RDONLY, &code));
  if (archive) return archive;
  zip_error_t error;
  ::zip_error_init_with_code(&error, code);
  const std::string why = ::zip_error_strerror(&error);
  ::zip_error_fini(&error);
  refuse(path, why);
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

struct NpzFile::Data {
  std::filesystem::path path;
  Archive archive;

  std::string in_file(const std::string& name) const { return fmt::format("{}, {}.npy", path.string(), name); }
  zip_int64_t find(const std::string& name) const {
    const zip_int64_t index = ::zip_name_locate(archive.get(), (name + ".npy").c_str(), 0);
    return index >= 0 ? index : ::zip_name_locate(archive.get(), name.c_str(), 0);
  }
};

namespace {

/// One array of an archive, from its begin on.
class ArrayStream {
 public:
  ArrayStream(zip_t* archive, zip_int64_t index, const std::filesystem::path& path, const std::string& name)
      : path_(path), file_(index < 0 ? nullptr : ::zip_fopen_index(archive, static_cast<zip_uint64_t>(index), 0)) {
    if (!file_) refuse(path, fmt::format("{}: {}", name, ::zip_strerror(archive)));
    std::string head(kNpyStartBytes, '\0');
    head.resize(take(head.data(), head.size()));
    if (head.size() == kNpyStartBytes) {
      const std::size_t length = static_cast<unsigned char>(head[8]) + std::size_t{256} * static_cast<unsigned char>(head[9]);
      head.resize(kNpyStartBytes + length);
      head.resize(kNpyStartBytes + take(head.data() + kNpyStartBytes, length));
    }
    header_ = parse_npy_header(head, name, kTypes);
    zip_stat_t stat;
    if (::zip_stat_index(archive, static_cast<zip_uint64_t>(index), 0, &stat) != 0) refuse(path, ::zip_strerror(archive));
    // what says more than its file can hold would be allocated first
    if (stat.size / kMostCompression > std::filesystem::file_size(path))
      refuse(path, fmt::format("says that it holds an array of {} bytes, more than its size can hold", stat.size));
    require_npy_bytes(header_, stat.size - std::min<std::uint64_t>(stat.size, header_.bytes), name);
  }

  const NpyHeader& header() const { return header_; }
  void read(void* out, std::uint64_t bytes) {
    if (out != nullptr) {
      if (take(out, bytes) != bytes) refuse(path_, "is damaged");
      return;
    }
    std::vector<char> passed(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, std::uint64_t{1} << 18)));
    for (std::uint64_t left = bytes; left > 0;) {
      const std::uint64_t part = std::min<std::uint64_t>(left, passed.size());
      if (take(passed.data(), part) != part) refuse(path_, "is damaged");
      left -= part;
    }
  }
  /// libzip compares the checksum at the end of a file.
  void finish() {
    char more = 0;
    if (::zip_fread(file_.get(), &more, 1) != 0) refuse(path_, "is damaged");
  }

 private:
  std::uint64_t take(void* out, std::uint64_t bytes) {
    std::uint64_t done = 0;
    while (done < bytes) {
      const zip_int64_t got = ::zip_fread(file_.get(), static_cast<char*>(out) + done, bytes - done);
      if (got < 0) refuse(path_, "is damaged");
      if (got == 0) break;
      done += static_cast<std::uint64_t>(got);
    }
    return done;
  }

  std::filesystem::path path_;
  std::unique_ptr<zip_file_t, Discard> file_;
  NpyHeader header_;
};

}  // namespace

NpzFile::NpzFile(const std::filesystem::path& path) : data_(new Data{path, open_archive(path)}) {}
NpzFile::~NpzFile() = default;
NpzFile::NpzFile(NpzFile&&) noexcept = default;
NpzFile& NpzFile::operator=(NpzFile&&) noexcept = default;

bool NpzFile::has(const std::string& name) const { return data_->find(name) >= 0; }

NpyHeader NpzFile::header(const std::string& name) const {
  return ArrayStream(data_->archive.get(), data_->find(name), data_->path, data_->in_file(name)).header();
}

NpyArray NpzFile::read(const std::string& name) const {
  ArrayStream stream(data_->archive.get(), data_->find(name), data_->path, data_->in_file(name));
  NpyArray array{stream.header().type, stream.header().shape,
                 std::string(static_cast<std::size_t>(stream.header().value_bytes), '\0')};
  stream.read(array.bytes.data(), array.bytes.size());
  stream.finish();
  return array;
}

void NpzFile::stream(const std::string& name, const std::function<void(const NextBytes&)>& values) const {
  ArrayStream stream(data_->archive.get(), data_->find(name), data_->path, data_->in_file(name));
  values([&](void* out, std::uint64_t bytes) { stream.read(out, bytes); });
  stream.finish();
}

std::map<std::string, NpyArray> read_npz(const std::filesystem::path& path) {
  const Archive archive = open_archive(path);
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
