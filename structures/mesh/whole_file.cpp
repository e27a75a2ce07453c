#include "structures/mesh/whole_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kUnfinished = ".unfinished-";

[[noreturn]] void fail(const fs::path& path, std::string_view what, int error) {
  throw OutputError(fmt::format("{}: {}: {}", path.string(), what, std::system_category().message(error)));
}

/// Has a name of its own until it gets its final one, and is removed where it never does.
class UnfinishedFile {
 public:
  UnfinishedFile(const fs::path& folder, const fs::path& target) : path_((folder / kUnfinished).string() + "XXXXXX"), target_(target) {
    descriptor_ = ::mkostemp(path_.data(), O_CLOEXEC);  // O_EXCL: no other process has this name
    if (descriptor_ < 0) fail(target_, "cannot be written", errno);
    static_cast<void>(::fchmod(descriptor_, 0644));
  }
  ~UnfinishedFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!published_) ::unlink(path_.c_str());
  }
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

  void write(std::string_view bytes) {
    if (const int error = write_all(descriptor_, bytes); error != 0) fail(target_, "cannot be written", error);
    if (::close(std::exchange(descriptor_, -1)) != 0) fail(target_, "cannot be closed", errno);
  }
  void publish() {
    if (::rename(path_.c_str(), target_.c_str()) != 0) fail(target_, "cannot be renamed to this name", errno);
    published_ = true;
  }

 private:
  std::string path_;
  fs::path target_;
  int descriptor_ = -1;
  bool published_ = false;
};

}  // namespace

int write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return ::fsync(descriptor) == 0 ? 0 : errno;
}

void write_atomically(const fs::path& target, std::string_view bytes) {
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  UnfinishedFile file(folder, target);
  file.write(bytes);
  file.publish();
  sync_folder(folder);
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw OutputError(fmt::format("{}: cannot be made: {}", folder.string(), error.message()));
}

void sync_folder(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

void remove_unfinished_files(const fs::path& folder) {
  std::error_code absent;
  for (const auto& entry : fs::directory_iterator(folder, absent))
    if (entry.path().filename().string().starts_with(kUnfinished)) fs::remove(entry.path(), absent);
}

}  // namespace amrtex
