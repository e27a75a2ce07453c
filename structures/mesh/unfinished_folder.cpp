#include "structures/mesh/unfinished_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = ".amrtex-unfinished-";

std::string reason_now() { return reason_of({errno, std::generic_category()}); }

fs::path folder_of(const fs::path& target) { return target.has_parent_path() ? target.parent_path() : fs::path("."); }

/// A folder opened and locked by this process, or -1.
int open_locked(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor >= 0 && ::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return descriptor;
  if (descriptor >= 0) ::close(descriptor);
  return -1;
}

/// Does the path still name the folder that is open? Somebody may have removed it before it was locked.
bool is_named(int descriptor, const fs::path& path) {
  struct stat open {};
  struct stat named {};
  return ::fstat(descriptor, &open) == 0 && ::lstat(path.c_str(), &named) == 0 && open.st_ino == named.st_ino &&
         open.st_dev == named.st_dev;
}

/// Removes folders of this kind whose process has ended: its lock ended with it.
void remove_abandoned(const fs::path& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (!entry.path().filename().string().starts_with(kPrefix)) continue;
    const int descriptor = open_locked(entry.path());
    if (descriptor < 0) continue;
    fs::remove_all(entry.path(), ignored);
    ::close(descriptor);
  }
}

}  // namespace

UnfinishedFolder::UnfinishedFolder(const fs::path& target) : target_(target) {
  const fs::path folder = folder_of(target);
  remove_abandoned(folder);
  for (int attempt = 0; attempt < 100 && descriptor_ < 0; ++attempt) {
    std::string name = (folder / kPrefix).string() + "XXXXXX";
    if (::mkdtemp(name.data()) == nullptr)
      throw Error(fmt::format("{}: no folder can be made beside it: {}", target.string(), reason_now()));
    descriptor_ = open_locked(name);
    if (descriptor_ >= 0 && !is_named(descriptor_, name)) ::close(std::exchange(descriptor_, -1));
    if (descriptor_ >= 0) path_ = name;
  }
  if (descriptor_ < 0) throw Error(fmt::format("{}: no folder beside it can be locked", target.string()));
  static_cast<void>(::fchmod(descriptor_, 0755));
}

UnfinishedFolder::~UnfinishedFolder() {
  std::error_code ignored;  // a destructor has nobody to tell
  if (!path_.empty()) fs::remove_all(path_, ignored);
  ::close(descriptor_);
}

void UnfinishedFolder::publish() {
  refuse_existing(target_);
  std::error_code failure;
  fs::rename(path_, target_, failure);
  if (failure) throw Error(fmt::format("{}: cannot be given its name: {}", target_.string(), reason_of(failure)));
  path_.clear();
}

void UnfinishedFolder::publish_files(const std::vector<std::string>& names) {
  for (const std::string& name : names) refuse_existing(folder_of(target_) / name);
  std::vector<fs::path> done;
  for (const std::string& name : names) {
    const fs::path file = folder_of(target_) / name;
    std::error_code failure;
    fs::rename(path_ / name, file, failure);
    if (failure) {
      std::error_code ignored;
      for (const fs::path& other : done) fs::remove(other, ignored);
      throw Error(fmt::format("{}: cannot be given its name: {}", file.string(), reason_of(failure)));
    }
    done.push_back(file);
  }
}

void refuse_existing(const fs::path& target) {
  if (fs::exists(fs::symlink_status(target)))
    throw Error(fmt::format("{}: exists already; give a name that does not", target.string()));
}

fs::path without_slash(const fs::path& path) {
  fs::path target = path.lexically_normal();
  if (target.filename().empty()) target = target.parent_path();
  return target;
}

OutputFile::OutputFile(const fs::path& path) : path_(path), out_(path, std::ios::binary) { check(); }

void OutputFile::write(std::string_view bytes) {
  out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  check();
  written_ += bytes.size();
}

void OutputFile::write_cells(const CellValues& values, RealType type) {
  std::vector<double> some(std::min(values.size(), std::size_t{1} << 16));
  for (std::size_t at = 0; at < values.size(); at += some.size()) {
    some.resize(std::min(some.size(), values.size() - at));
    values.copy(at, some);
    type == RealType::float32 ? write_values(std::vector<float>(some.begin(), some.end())) : write_values(some);
  }
}

void OutputFile::close() {
  out_.close();
  check();
}

void OutputFile::check() const {
  if (!out_) throw Error(fmt::format("{}: cannot be written: {}", path_.string(), reason_now()));
}

}  // namespace amrtex
