#include "structures/readers/raw_volume/raw_volume.hpp"

#include <array>
#include <fstream>
#include <string_view>

#include "structures/mesh/error.hpp"
#include "structures/readers/raw_volume/volume_file.hpp"
#include "structures/readers/reader_tools.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

enum class Kind { none, raw, nrrd, npy };

Kind kind_of(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return Kind::none;
  std::array<char, 7> begin{};
  std::ifstream(path, std::ios::binary).read(begin.data(), begin.size());
  const std::string_view magic(begin.data(), begin.size());
  if (magic == "NRRD000") return Kind::nrrd;
  if (magic.substr(0, 6) == "\x93NUMPY") return Kind::npy;
  return path.extension() == ".raw" ? Kind::raw : Kind::none;
}

VolumeFile describe(const fs::path& path) {
  switch (kind_of(path)) {
    case Kind::nrrd:
      return describe_nrrd(path);
    case Kind::npy:
      return describe_npy(path);
    case Kind::raw:
      if (const auto file = describe_raw(path)) return *file;
      throw Error(path.string() +
                  ": nothing says its shape and type; accepted: a name like head_256x256x109_uint16.raw, or a detached NRRD "
                  "header (.nhdr)");
    case Kind::none:
      break;
  }
  static_cast<void>(regular_file_size(path));  // throws where there is no file
  throw Error(path.string() + ": no volume; accepted: .raw with shape and type in its name, NRRD, .npy");
}

Volume open_volume(const fs::path& path, const VolumeFile& file) {
  return {dataset_name(path),      file.field, file.cells, file.lower, file.spacing, open_values(file),
          real_type_of(file.type), file.unit};
}

}  // namespace

bool is_raw_volume(const fs::path& path) { return kind_of(path) != Kind::none; }

Volume read_volume(const fs::path& path) { return open_volume(path, describe(path)); }

MeshDescription read_raw_volume(const fs::path& path, const FieldChoice& fields) {
  const VolumeFile file = describe(path);
  static_cast<void>(fields.among(path, {file.field}));
  return coarsen_volume(open_volume(path, file));
}

}  // namespace amrtex
