#include "structures/readers/data_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {

DataFile::DataFile(const std::filesystem::path& path)
    : path_(path.string()), descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (descriptor_ < 0) throw Error(fmt::format("{}: {}", path_, reason_of({errno, std::generic_category()})));
}

DataFile::~DataFile() { ::close(descriptor_); }

void DataFile::read(std::uint64_t offset, std::byte* out, std::size_t bytes) const {
  while (bytes > 0) {
    const ssize_t got = ::pread(descriptor_, out, bytes, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0)
      throw Error(fmt::format("{}: {} bytes at {} cannot be read: {}", path_, bytes, offset,
                              got < 0 ? reason_of({errno, std::generic_category()}) : "the file ends"));
    out += got;
    offset += static_cast<std::uint64_t>(got);
    bytes -= static_cast<std::size_t>(got);
  }
}

}  // namespace amrtex
