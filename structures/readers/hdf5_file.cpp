#include "structures/readers/hdf5_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hdf5.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <mutex>
#include <optional>
#include <type_traits>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/data_file.hpp"
#include "structures/readers/hdf5_formats.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxNumberBytes = 16;
constexpr std::size_t kMaxRecordBytes = std::size_t{1} << 16;    // of a compound or a text
constexpr hssize_t kMaxAttributeValues = hssize_t{1} << 16;      // HDF5's own limit is 64 KiB, dense storage aside
constexpr std::uint64_t kDeflateRatio = 1032;                    // RFC 1951: no stream expands further
constexpr std::uint64_t kSmallBytes = std::uint64_t{1} << 20;    // of allocations that nobody need justify
constexpr std::size_t kChunkCacheBytes = std::size_t{64} << 20;  // a chunk that does not fit is unpacked at each read
constexpr std::size_t kTextBytes = 512;                          // of a name or value of FLASH, which have 80 and more
constexpr std::size_t kPieceValues = std::size_t{1} << 17;       // read at a time and thread

/// The library takes one call at a time in a process, and would print what fails: while this lives, neither happens.
class LibraryCall {
 public:
  LibraryCall() : lock_(mutex()) {
    static const herr_t plugins_off = H5PLset_loading_state(0);
    if (plugins_off < 0) throw Error("the HDF5 library does not let its plugins be switched off");
    H5Eget_auto2(H5E_DEFAULT, &print_, &printed_to_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~LibraryCall() { H5Eset_auto2(H5E_DEFAULT, print_, printed_to_); }
  LibraryCall(const LibraryCall&) = delete;
  LibraryCall& operator=(const LibraryCall&) = delete;

 private:
  static std::recursive_mutex& mutex() {
    static std::recursive_mutex one;
    return one;
  }
  std::lock_guard<std::recursive_mutex> lock_;
  H5E_auto2_t print_ = nullptr;
  void* printed_to_ = nullptr;
};

/// An identifier of the library that is given back.
class Handle {
 public:
  Handle() = default;
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() { reset(); }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    reset();
    id_ = std::exchange(other.id_, -1);
    close_ = other.close_;
    return *this;
  }
  hid_t get() const { return id_; }
  explicit operator bool() const { return id_ >= 0; }

 private:
  void reset() {
    if (id_ < 0) return;
    const LibraryCall call;
    close_(id_);
    id_ = -1;
  }
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

/// What the library says of its last failure: the innermost of its messages, which is the most precise one.
std::string library_reason() {
  std::string reason;
  const H5E_walk2_t first = [](unsigned, const H5E_error2_t* entry, void* out) -> herr_t {
    auto& text = *static_cast<std::string*>(out);
    if (text.empty() && entry->desc != nullptr) text = entry->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, first, &reason);
  return reason.empty() ? "no reason given" : clipped(reason, 120);
}

template <class T>
hid_t native() {
  if constexpr (std::is_same_v<T, double>)
    return H5T_NATIVE_DOUBLE;
  else
    return H5T_NATIVE_INT64;
}

/// Classes of file types that may become a T.
template <class T>
bool becomes(H5T_class_t type) {
  return type == H5T_INTEGER || (std::is_same_v<T, double> && type == H5T_FLOAT);
}

/// Do the parts of a type lie in it? The library writes outside of its buffers where a damaged file says otherwise.
bool is_sound(hid_t type, int depth = 0) {
  const std::size_t size = H5Tget_size(type);
  const H5T_class_t kind = H5Tget_class(type);
  if (kind == H5T_INTEGER || kind == H5T_FLOAT) {
    const int offset = H5Tget_offset(type);
    const std::size_t bits = H5Tget_precision(type);
    if (offset < 0 || bits == 0 || bits > 8 * size || static_cast<std::size_t>(offset) > 8 * size - bits) return false;
    if (kind == H5T_INTEGER) return true;
    std::array<std::size_t, 5> field{};  // sign; exponent: first bit and bits; mantissa: the same
    if (H5Tget_fields(type, &field[0], &field[1], &field[2], &field[3], &field[4]) < 0) return false;
    return field[0] < bits && field[1] < bits && field[2] <= bits - field[1] && field[3] < bits && field[4] <= bits - field[3];
  }
  if (kind != H5T_COMPOUND) return kind == H5T_STRING;
  constexpr int kMostNested = 4;
  const int members = H5Tget_nmembers(type);
  if (members < 1 || depth > kMostNested) return false;
  for (int i = 0; i < members; ++i) {
    const Handle member(H5Tget_member_type(type, static_cast<unsigned>(i)), H5Tclose);
    const std::size_t at = H5Tget_member_offset(type, static_cast<unsigned>(i));
    const std::size_t bytes = member ? H5Tget_size(member.get()) : 0;
    if (bytes == 0 || bytes > size || at > size - bytes || !is_sound(member.get(), depth + 1)) return false;
  }
  return true;
}

std::string without_filling(const char* text, std::size_t most) {
  std::string s(text, ::strnlen(text, most));
  const auto last = s.find_last_not_of(' ');
  return last == std::string::npos ? "" : s.substr(0, last + 1);
}

}  // namespace

std::string text(const Hdf5Shape& shape) { return fmt::format("({})", fmt::join(shape, ", ")); }

// ---- the file ----

struct Hdf5File::State {
  explicit State(const fs::path& p) : path(p), file_bytes(regular_file_size(p)), direct(p) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  fs::path path;
  std::uint64_t file_bytes;
  DataFile direct;  ///< beside the library
  Handle file;
  Handle links;               ///< how links are followed: none into other files
  Handle data;                ///< the same for data sets, with the size of the cache
  bool met_external = false;  ///< by the last call

  [[noreturn]] void fail(std::string_view object, std::string_view what) const {
    throw Error(fmt::format("{}: {}: {}", path.string(), clipped(object), what));
  }
  /// After a call of the library that failed.
  [[noreturn]] void fail_call(std::string_view object, std::string_view what) const {
    if (met_external) fail(object, "a link to another file; such links are not followed");
    fail(object, fmt::format("{}: {}", what, library_reason()));
  }
  void start() {
    met_external = false;
    H5Eclear2(H5E_DEFAULT);
  }

  void open();
  bool exists(const std::string& object);
  struct DataSet;
  DataSet open_set(const std::string& name);
  void check_storage(const DataSet& set, const std::string& name);
  void check_chunks(const DataSet& set, const std::string& name, hid_t creation);

  struct Attribute;
  Attribute open_attribute(const std::string& object, const std::string& name);
  Handle record_type(hid_t type, const std::vector<std::string>& names, hid_t member, const std::string& where, bool reals) const;
  template <class T>
  std::vector<T> attribute(const std::string& object, const std::string& name, std::vector<std::string> names);
  template <class T>
  Hdf5Array<T> read_all(const std::string& name);
  template <class T>
  Handle named_type(const DataSet& set, const std::string& name) const;
  template <class T>
  std::vector<std::pair<std::string, T>> read_named(const std::string& name);
};

/// A data set that passed the checks of its storage.
struct Hdf5File::State::DataSet {
  Handle set;
  Handle type;
  H5T_class_t type_class = H5T_NO_CLASS;
  std::size_t type_bytes = 0;
  Hdf5Shape shape;
  std::uint64_t count = 1;
  bool contiguous = false;
};

struct Hdf5File::State::Attribute {
  Handle attribute;
  Handle type;
  std::string where;
  std::size_t count = 0;
};

void Hdf5File::State::open() {
  const H5L_elink_traverse_t refuse = [](const char*, const char*, const char*, const char*, unsigned*, hid_t,
                                         void* met) -> herr_t {
    *static_cast<bool*>(met) = true;
    return -1;
  };
  links = Handle(H5Pcreate(H5P_LINK_ACCESS), H5Pclose);
  data = Handle(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  bool fine = links && data && access;
  for (const hid_t list : {links.get(), data.get()}) fine = fine && H5Pset_elink_cb(list, refuse, &met_external) >= 0;
  fine = fine && H5Pset_chunk_cache(data.get(), 12421, kChunkCacheBytes, 1.0) >= 0;
#if H5_VERSION_GE(1, 10, 7)
  fine = fine && H5Pset_file_locking(access.get(), 0, 1) >= 0;  // what is archived lies on file systems without locks
#endif
  if (!fine) throw Error(fmt::format("{}: the HDF5 library cannot be set up: {}", path.string(), library_reason()));
  start();
  file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose);
  if (!file) throw Error(fmt::format("{}: cannot be opened as HDF5: {}", path.string(), library_reason()));
}

bool Hdf5File::State::exists(const std::string& object) {
  start();
  for (std::size_t end = 0; end != std::string::npos;) {
    end = object.find('/', end + 1);
    const std::string part = object.substr(0, end);
    const htri_t linked = H5Lexists(file.get(), part.c_str(), links.get());
    const htri_t there = linked > 0 ? H5Oexists_by_name(file.get(), part.c_str(), links.get()) : linked;
    if (there < 0 || met_external) fail_call(part, "cannot be looked up");
    if (there == 0) return false;
  }
  return true;
}

/// Chunks are unpacked whole, so that their size counts, too. Filters other than these may make any size of nothing.
void Hdf5File::State::check_chunks(const DataSet& set, const std::string& name, hid_t creation) {
  const int filters = H5Pget_nfilters(creation);
  for (int i = 0; i < filters; ++i) {
    std::array<char, 64> title{};
    std::size_t values = 0;
    unsigned flags = 0;
    unsigned config = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values, nullptr, title.size() - 1, title.data(), &config);
    if (filter < 0) fail_call(name, "its filters cannot be read");
    const bool read = filter == H5Z_FILTER_DEFLATE || filter == H5Z_FILTER_SHUFFLE || filter == H5Z_FILTER_FLETCHER32;
    if (!read || H5Zfilter_avail(filter) <= 0)
      fail(name, fmt::format("packed by the filter {} {}; deflate, shuffle and Fletcher-32 are read, and no plugins are loaded",
                             filter, quote(title.data())));
  }
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  const int rank = H5Pget_chunk(creation, H5S_MAX_RANK, chunk.data());
  if (rank < 0) fail_call(name, "its chunks cannot be read");
  CheckedSize chunk_bytes = static_cast<std::int64_t>(set.type_bytes);
  for (int i = 0; i < rank; ++i) chunk_bytes *= CheckedSize::of(chunk[static_cast<std::size_t>(i)]);
  const std::uint64_t stored = H5Dget_storage_size(set.set.get());
  const CheckedSize most =
      CheckedSize::of(stored) * CheckedSize::of(filters > 0 ? kDeflateRatio : 1) + CheckedSize::of(kSmallBytes);
  const CheckedSize all = CheckedSize::of(set.count) * static_cast<std::int64_t>(set.type_bytes);
  if (chunk_bytes.or_most() > most.or_most() || all.or_most() > most.or_most())
    fail(name, fmt::format("its extents {} in chunks of {} bytes are more than the {} bytes that are stored can hold",
                           amrtex::text(set.shape), chunk_bytes.or_most(), stored));
}

void Hdf5File::State::check_storage(const DataSet& set, const std::string& name) {
  const Handle creation(H5Dget_create_plist(set.set.get()), H5Pclose);
  if (!creation) fail_call(name, "its properties cannot be read");
  const H5D_layout_t layout = H5Pget_layout(creation.get());
  if (layout == H5D_VIRTUAL) fail(name, "a virtual data set, whose values lie in other files; such are not read");
  if (H5Pget_external_count(creation.get()) != 0) fail(name, "its values lie in other files, which are not read");
  if (set.count == 0) return;
  const std::uint64_t stored = H5Dget_storage_size(set.set.get());
  if (stored == 0) fail(name, fmt::format("its {} values were never written", set.count));
  if (layout == H5D_CHUNKED) {
    check_chunks(set, name, creation.get());
    return;
  }
  const CheckedSize needed = CheckedSize::of(set.count) * static_cast<std::int64_t>(set.type_bytes);
  if (stored > file_bytes || needed.or_most() > static_cast<std::int64_t>(stored))
    fail(name, fmt::format("its extents {} take {} bytes, but {} are stored, in a file of {}", amrtex::text(set.shape),
                           needed.or_most(), stored, file_bytes));
}

Hdf5File::State::DataSet Hdf5File::State::open_set(const std::string& name) {
  start();
  DataSet d;
  d.set = Handle(H5Dopen2(file.get(), name.c_str(), data.get()), H5Dclose);
  if (!d.set) fail_call(name, "cannot be opened as a data set");
  d.type = Handle(H5Dget_type(d.set.get()), H5Tclose);
  if (!d.type) fail_call(name, "its type cannot be read");
  d.type_class = H5Tget_class(d.type.get());
  d.type_bytes = H5Tget_size(d.type.get());
  if (d.type_bytes == 0 || d.type_bytes > kMaxRecordBytes) fail(name, fmt::format("values of {} bytes", d.type_bytes));
  if (!is_sound(d.type.get())) fail(name, "its type is not one of numbers and texts, or damaged");
  const Handle creation(H5Dget_create_plist(d.set.get()), H5Pclose);
  // asked before the extents, for which the library would open what a virtual data set is made of
  if (creation && H5Pget_layout(creation.get()) == H5D_VIRTUAL) check_storage(d, name);
  const Handle space(H5Dget_space(d.set.get()), H5Sclose);
  std::array<hsize_t, H5S_MAX_RANK> extents{};
  const int rank = space ? H5Sget_simple_extent_dims(space.get(), extents.data(), nullptr) : -1;
  if (rank < 0) fail_call(name, "its extents cannot be read");
  d.shape.assign(extents.begin(), extents.begin() + rank);
  CheckedSize count = 1;
  for (const std::uint64_t extent : d.shape) count *= CheckedSize::of(extent);
  if (H5Sget_simple_extent_type(space.get()) == H5S_NULL) count = 0;
  if (!count.fits()) fail(name, fmt::format("its extents {} are more than 63 bits", amrtex::text(d.shape)));
  d.count = static_cast<std::uint64_t>(count.or_most());
  d.contiguous = creation && H5Pget_layout(creation.get()) == H5D_CONTIGUOUS;
  check_storage(d, name);
  return d;
}

Hdf5File::State::Attribute Hdf5File::State::open_attribute(const std::string& object, const std::string& name) {
  start();
  Attribute a;
  a.where = fmt::format("{}, attribute {}", object, name);
  a.attribute = Handle(H5Aopen_by_name(file.get(), object.c_str(), name.c_str(), H5P_DEFAULT, links.get()), H5Aclose);
  if (!a.attribute) fail_call(a.where, "cannot be opened");
  a.type = Handle(H5Aget_type(a.attribute.get()), H5Tclose);
  const Handle space(H5Aget_space(a.attribute.get()), H5Sclose);
  const hssize_t count = space ? H5Sget_simple_extent_npoints(space.get()) : -1;
  if (!a.type || count < 0) fail_call(a.where, "its type cannot be read");
  if (count > kMaxAttributeValues) fail(a.where, fmt::format("{} values", count));
  if (H5Tget_size(a.type.get()) > kMaxRecordBytes) fail(a.where, fmt::format("values of {} bytes", H5Tget_size(a.type.get())));
  if (!is_sound(a.type.get())) fail(a.where, "its type is not one of numbers and texts, or damaged");
  a.count = static_cast<std::size_t>(count);
  return a;
}

/// A compound in memory of these members, each of them as `member`.
Handle Hdf5File::State::record_type(hid_t type, const std::vector<std::string>& names, hid_t member, const std::string& where,
                                    bool reals) const {
  const std::size_t each = H5Tget_size(member);
  Handle record(H5Tcreate(H5T_COMPOUND, std::max<std::size_t>(1, names.size() * each)), H5Tclose);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const int index = H5Tget_member_index(type, names[i].c_str());
    if (index < 0) fail(where, fmt::format("no member {}", quote(names[i])));
    const H5T_class_t kind = H5Tget_member_class(type, static_cast<unsigned>(index));
    if (!(reals ? becomes<double>(kind) : becomes<std::int64_t>(kind)))
      fail(where, fmt::format("its member {} is of another type than {}", quote(names[i]), reals ? "reals" : "whole numbers"));
    if (!record || H5Tinsert(record.get(), names[i].c_str(), i * each, member) < 0) fail_call(where, "cannot be laid out");
  }
  return record;
}

template <class T>
std::vector<T> Hdf5File::State::attribute(const std::string& object, const std::string& name, std::vector<std::string> names) {
  const Attribute a = open_attribute(object, name);
  constexpr bool kReals = std::is_same_v<T, double>;
  const H5T_class_t kind = H5Tget_class(a.type.get());
  if (kind == H5T_COMPOUND) {
    const int members = names.empty() ? H5Tget_nmembers(a.type.get()) : 0;
    for (int i = 0; i < members; ++i) {
      char* member = H5Tget_member_name(a.type.get(), static_cast<unsigned>(i));
      if (member != nullptr) names.emplace_back(member);
      H5free_memory(member);
    }
    const Handle record = record_type(a.type.get(), names, native<T>(), a.where, kReals);
    std::vector<T> values(a.count * names.size());
    if (!values.empty() && H5Aread(a.attribute.get(), record.get(), values.data()) < 0) fail_call(a.where, "cannot be read");
    return values;
  }
  if (!becomes<T>(kind) || H5Tget_size(a.type.get()) > kMaxNumberBytes)
    fail(a.where, fmt::format("of another type than {}", kReals ? "reals" : "whole numbers"));
  std::vector<T> values(a.count);
  if (!values.empty() && H5Aread(a.attribute.get(), native<T>(), values.data()) < 0) fail_call(a.where, "cannot be read");
  return values;
}

template <class T>
Hdf5Array<T> Hdf5File::State::read_all(const std::string& name) {
  DataSet d = open_set(name);
  if (!becomes<T>(d.type_class) || d.type_bytes > kMaxNumberBytes)
    fail(name, fmt::format("of another type than {}", std::is_same_v<T, double> ? "reals" : "whole numbers"));
  require_memory(path, CheckedSize::of(d.count), 1);
  Hdf5Array<T> array{std::move(d.shape), std::vector<T>(d.count)};
  if (d.count > 0 && H5Dread(d.set.get(), native<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, array.values.data()) < 0)
    fail_call(name, "cannot be read");
  return array;
}

/// A compound {name, value} in memory. Texts have at most kTextBytes in these lists; longer ones, which no name is, are cut.
template <class T>
Handle Hdf5File::State::named_type(const DataSet& set, const std::string& name) const {
  constexpr bool kTexts = std::is_same_v<T, std::string>;
  Handle record(H5Tcreate(H5T_COMPOUND, kTextBytes + (kTexts ? kTextBytes : sizeof(double))), H5Tclose);
  for (const bool is_name : {true, false}) {
    const char* member = is_name ? "name" : "value";
    const int index = H5Tget_member_index(set.type.get(), member);
    if (index < 0) fail(name, fmt::format("no member '{}'", member));
    const H5T_class_t kind = H5Tget_member_class(set.type.get(), static_cast<unsigned>(index));
    const Handle type(H5Tget_member_type(set.type.get(), static_cast<unsigned>(index)), H5Tclose);
    const Handle text_type(H5Tcopy(H5T_C_S1), H5Tclose);
    hid_t wanted = text_type.get();
    bool right = kind == H5T_STRING && H5Tis_variable_str(type.get()) == 0 && H5Tset_size(wanted, kTextBytes) >= 0 &&
                 H5Tset_cset(wanted, H5Tget_cset(type.get())) >= 0;  // the library does not convert between character sets
    if constexpr (!kTexts)
      if (!is_name) {
        wanted = native<T>();
        right = becomes<T>(kind);
      }
    if (!right) fail(name, fmt::format("its member '{}' is of another type", member));
    if (!record || H5Tinsert(record.get(), member, is_name ? 0 : kTextBytes, wanted) < 0) fail_call(name, "cannot be laid out");
  }
  return record;
}

template <class T>
std::vector<std::pair<std::string, T>> Hdf5File::State::read_named(const std::string& name) {
  const DataSet d = open_set(name);
  if (d.type_class != H5T_COMPOUND) fail(name, "of another type than pairs of name and value");
  if (d.count > kSmallBytes / 16) fail(name, fmt::format("{} pairs of name and value", d.count));
  const Handle record = named_type<T>(d, name);
  const std::size_t each = H5Tget_size(record.get());
  std::vector<char> read(static_cast<std::size_t>(d.count) * each);
  if (d.count > 0 && H5Dread(d.set.get(), record.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, read.data()) < 0)
    fail_call(name, "cannot be read");
  std::vector<std::pair<std::string, T>> pairs(static_cast<std::size_t>(d.count));
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const char* at = read.data() + i * each;
    pairs[i].first = without_filling(at, kTextBytes);
    if constexpr (std::is_same_v<T, std::string>)
      pairs[i].second = without_filling(at + kTextBytes, kTextBytes);
    else
      std::memcpy(&pairs[i].second, at + kTextBytes, sizeof(T));
  }
  return pairs;
}

bool Hdf5File::has_signature(const fs::path& path) { return has_hdf5_signature(path); }

Hdf5File::Hdf5File(const fs::path& path) : state_(std::make_shared<State>(path)) {
  const LibraryCall call;
  state_->open();
}

const fs::path& Hdf5File::path() const { return state_->path; }
void Hdf5File::fail(std::string_view object, std::string_view what) const { state_->fail(object, what); }

bool Hdf5File::has(const std::string& object) const {
  const LibraryCall call;
  return state_->exists(object);
}

bool Hdf5File::has_attribute(const std::string& object, const std::string& attribute) const {
  const LibraryCall call;
  state_->start();
  const htri_t there = H5Aexists_by_name(state_->file.get(), object.c_str(), attribute.c_str(), state_->links.get());
  if (there < 0) state_->fail_call(object, fmt::format("attribute {} cannot be looked up", attribute));
  return there > 0;
}

std::vector<std::string> Hdf5File::members(const std::string& group) const {
  const LibraryCall call;
  state_->start();
  const Handle opened(H5Gopen2(state_->file.get(), group.c_str(), state_->links.get()), H5Gclose);
  if (!opened) state_->fail_call(group, "cannot be opened as a group");
  std::vector<std::string> names;
  const auto add = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    try {
      static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    } catch (const std::bad_alloc&) {
      return -1;  // no exception may pass through the library
    }
    return 0;
  };
  if (H5Literate(opened.get(), H5_INDEX_NAME, H5_ITER_INC, nullptr, add, &names) < 0)
    state_->fail_call(group, "its members cannot be listed");
  return names;
}

std::vector<std::int64_t> Hdf5File::integers(const std::string& object, const std::string& attribute,
                                             const std::vector<std::string>& names) const {
  const LibraryCall call;
  return state_->attribute<std::int64_t>(object, attribute, names);
}

std::int64_t Hdf5File::integer(const std::string& object, const std::string& attribute) const {
  const auto values = integers(object, attribute);
  if (values.size() != 1) fail(object, fmt::format("attribute {} holds {} values instead of one", attribute, values.size()));
  return values.front();
}

std::vector<double> Hdf5File::reals(const std::string& object, const std::string& attribute) const {
  const LibraryCall call;
  return state_->attribute<double>(object, attribute, {});
}

std::string Hdf5File::text(const std::string& object, const std::string& attribute) const {
  const LibraryCall call;
  const State::Attribute a = state_->open_attribute(object, attribute);
  if (H5Tget_class(a.type.get()) != H5T_STRING || a.count != 1) state_->fail(a.where, "of another type than one text");
  if (H5Tis_variable_str(a.type.get()) > 0) {
    char* found = nullptr;
    if (H5Aread(a.attribute.get(), a.type.get(), &found) < 0) state_->fail_call(a.where, "cannot be read");
    const std::string value = found == nullptr ? "" : without_filling(found, kMaxRecordBytes);
    H5free_memory(found);
    return value;
  }
  std::vector<char> bytes(H5Tget_size(a.type.get()));
  if (H5Aread(a.attribute.get(), a.type.get(), bytes.data()) < 0) state_->fail_call(a.where, "cannot be read");
  return without_filling(bytes.data(), bytes.size());
}

Hdf5Array<std::int64_t> Hdf5File::read_integers(const std::string& dataset) const {
  const LibraryCall call;
  return state_->read_all<std::int64_t>(dataset);
}

Hdf5Array<double> Hdf5File::read_reals(const std::string& dataset) const {
  const LibraryCall call;
  return state_->read_all<double>(dataset);
}

std::vector<std::int64_t> Hdf5File::read_records(const std::string& dataset, const std::vector<std::string>& names) const {
  const LibraryCall call;
  const State::DataSet d = state_->open_set(dataset);
  if (d.type_class != H5T_COMPOUND) state_->fail(dataset, "of another type than a compound of whole numbers");
  const Handle record = state_->record_type(d.type.get(), names, native<std::int64_t>(), dataset, false);
  require_memory(path(), CheckedSize::of(d.count) * static_cast<std::int64_t>(names.size()), 1);
  std::vector<std::int64_t> values(static_cast<std::size_t>(d.count) * names.size());
  if (!values.empty() && H5Dread(d.set.get(), record.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    state_->fail_call(dataset, "cannot be read");
  return values;
}

std::vector<std::string> Hdf5File::read_texts(const std::string& dataset) const {
  const LibraryCall call;
  const State::DataSet d = state_->open_set(dataset);
  if (d.type_class != H5T_STRING || H5Tis_variable_str(d.type.get()) != 0)
    state_->fail(dataset, "of another type than texts of fixed length");
  std::vector<char> bytes(static_cast<std::size_t>(d.count) * d.type_bytes);
  if (d.count > 0 && H5Dread(d.set.get(), d.type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0)
    state_->fail_call(dataset, "cannot be read");
  std::vector<std::string> texts(static_cast<std::size_t>(d.count));
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const char* at = bytes.data() + i * d.type_bytes;
    texts[i].assign(at, ::strnlen(at, d.type_bytes));
  }
  return texts;
}

std::vector<std::pair<std::string, std::int64_t>> Hdf5File::read_named_integers(const std::string& dataset) const {
  const LibraryCall call;
  return state_->read_named<std::int64_t>(dataset);
}
std::vector<std::pair<std::string, double>> Hdf5File::read_named_reals(const std::string& dataset) const {
  const LibraryCall call;
  return state_->read_named<double>(dataset);
}
std::vector<std::pair<std::string, std::string>> Hdf5File::read_named_texts(const std::string& dataset) const {
  const LibraryCall call;
  return state_->read_named<std::string>(dataset);
}

// ---- reals ----

struct Hdf5Numbers::Data {
  std::shared_ptr<Hdf5File::State> file;
  std::string name;
  Handle set;  ///< where the library reads
  Hdf5Shape shape;
  std::uint64_t count = 0;
  std::size_t bytes_each = 0;
  RealType type = RealType::float64;
  std::optional<std::uint64_t> place;  ///< byte of the first value, where it is read directly

  template <class T>
  void read_directly(std::uint64_t first, std::span<T> out) const;
  void read_by_library(std::uint64_t first, std::size_t values, void* out) const;
};

template <class T>
void Hdf5Numbers::Data::read_directly(std::uint64_t first, std::span<T> out) const {
  const std::size_t pieces = (out.size() + kPieceValues - 1) / kPieceValues;
  tbb::parallel_for(std::size_t{0}, pieces, [&](std::size_t piece) {
    const std::size_t from = piece * kPieceValues;
    const std::span<T> part = out.subspan(from, std::min(kPieceValues, out.size() - from));
    file->direct.read(*place + (first + from) * sizeof(T), reinterpret_cast<std::byte*>(part.data()), part.size_bytes());
  });
}

void Hdf5Numbers::Data::read_by_library(std::uint64_t first, std::size_t values, void* out) const {
  const LibraryCall call;
  file->start();
  std::vector<hsize_t> start(shape.size(), 0);
  std::vector<hsize_t> size(shape.begin(), shape.end());
  const std::uint64_t row = count / std::max<std::uint64_t>(1, shape.front());
  if (row == 0 || first % row != 0 || values % row != 0)
    file->fail(name, fmt::format("{} values from {} on are no whole rows of {}", values, first, amrtex::text(shape)));
  start.front() = first / row;
  size.front() = values / row;
  const hid_t as = type == RealType::float32 ? H5T_NATIVE_FLOAT : H5T_NATIVE_DOUBLE;
  const Handle space(H5Dget_space(set.get()), H5Sclose);
  const Handle memory(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose);
  if (!space || !memory || H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr) < 0 ||
      H5Dread(set.get(), as, memory.get(), space.get(), H5P_DEFAULT, out) < 0)
    file->fail_call(name, "cannot be read");
}

const Hdf5Shape& Hdf5Numbers::shape() const { return data_->shape; }
std::uint64_t Hdf5Numbers::count() const { return data_->count; }
int Hdf5Numbers::bytes_each() const { return static_cast<int>(data_->bytes_each); }
RealType Hdf5Numbers::type() const { return data_->type; }
bool Hdf5Numbers::parallel() const { return data_->place.has_value(); }

template <class T>
void Hdf5Numbers::read(std::uint64_t first, std::span<T> out) const {
  assert(sizeof(T) == bytes_of(type()));
  if (first > count() || out.size() > count() - first)
    data_->file->fail(data_->name, fmt::format("{} values from {} on are wanted; it holds {}", out.size(), first, count()));
  if (out.empty()) return;
  if (parallel())
    data_->read_directly(first, out);
  else
    data_->read_by_library(first, out.size(), out.data());
}
template void Hdf5Numbers::read(std::uint64_t, std::span<float>) const;
template void Hdf5Numbers::read(std::uint64_t, std::span<double>) const;

CellValues Hdf5Numbers::read_box(std::uint64_t first, const Box& stored, const Box& valid) const {
  CellValues values(type(), static_cast<std::size_t>(valid.cells()));
  values.visit_stored([&](auto& out) { read_within(first, stored, valid, std::span(out)); });
  return values;
}

template <class T>
void Hdf5Numbers::read_within(std::uint64_t first, const Box& stored, const Box& valid, std::span<T> out) const {
  if (stored == valid) {
    read(first, out);
    return;
  }
  const Vec3i size = valid.size();
  const auto row = static_cast<std::size_t>(size.x);
  const std::uint64_t plane = static_cast<std::uint64_t>(stored.size().x) * static_cast<std::uint64_t>(stored.size().y);
  const auto at_once = static_cast<int>(std::clamp<std::uint64_t>(kPieceValues / plane, 1, static_cast<std::uint64_t>(size.z)));
  const int groups = ceil_div(size.z, at_once);
  const auto read_group = [&](int group) {
    const Box part{Vec3i(stored.lower.x, stored.lower.y, valid.lower.z + group * at_once),
                   Vec3i(stored.upper.x, stored.upper.y, std::min(valid.lower.z + (group + 1) * at_once, valid.upper.z))};
    CellArray<T> buffer(static_cast<std::size_t>(part.cells()));
    read(first + plane * static_cast<std::uint64_t>(part.lower.z - stored.lower.z), std::span(buffer));
    for (int z = part.lower.z; z < part.upper.z; ++z)
      for (int y = valid.lower.y; y < valid.upper.y; ++y) {
        const T* from = buffer.data() + part.offset({valid.lower.x, y, z});
        std::copy(from, from + row, out.data() + valid.offset({valid.lower.x, y, z}));
      }
  };
  if (parallel())
    tbb::parallel_for(0, groups, read_group);
  else
    for (int group = 0; group < groups; ++group) read_group(group);
}

std::size_t Hdf5File::rank_of_reals(const std::string& object) const {
  const LibraryCall call;
  state_->start();
  const Handle opened(H5Oopen(state_->file.get(), object.c_str(), state_->links.get()), H5Oclose);
  if (!opened) state_->fail_call(object, "cannot be opened");
  if (H5Iget_type(opened.get()) != H5I_DATASET) return 0;
  const Handle type(H5Dget_type(opened.get()), H5Tclose);
  return type && H5Tget_class(type.get()) == H5T_FLOAT ? state_->open_set(object).shape.size() : 0;
}

Hdf5Numbers Hdf5File::open_numbers(const std::string& dataset, std::size_t rank) const {
  const LibraryCall call;
  State::DataSet d = state_->open_set(dataset);
  if (d.type_class != H5T_FLOAT || d.type_bytes > kMaxNumberBytes) state_->fail(dataset, "of another type than reals");
  if (d.shape.size() != rank)
    state_->fail(dataset, fmt::format("extents {} where {} axes are expected", amrtex::text(d.shape), rank));
  auto data = std::make_shared<Hdf5Numbers::Data>();
  data->file = state_;
  data->name = dataset;
  data->count = d.count;
  data->bytes_each = d.type_bytes;
  const auto is = [&](hid_t type) { return H5Tequal(d.type.get(), type) > 0; };
  const bool of_this_machine = is(H5T_NATIVE_DOUBLE) || is(H5T_NATIVE_FLOAT);
  data->type = is(H5T_IEEE_F32LE) || is(H5T_IEEE_F32BE) ? RealType::float32 : RealType::float64;
  if (d.contiguous && of_this_machine && d.count > 0) {
    const haddr_t place = H5Dget_offset(d.set.get());
    const std::uint64_t bytes = d.count * d.type_bytes;  // no more than the file has, as was checked
    if (place == HADDR_UNDEF || place > state_->file_bytes || bytes > state_->file_bytes - place)
      state_->fail(dataset, fmt::format("its {} bytes are said to begin at byte {} of {}", bytes, place, state_->file_bytes));
    data->place = place;
  } else {
    data->set = std::move(d.set);
  }
  data->shape = std::move(d.shape);
  Hdf5Numbers numbers;
  numbers.data_ = std::move(data);
  return numbers;
}

}  // namespace amrtex
