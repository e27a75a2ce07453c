// Where a volume's values stand in a file and how they are written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/cell_values.hpp"
#include "structures/mesh/spaces.hpp"
#include "structures/readers/raw_volume/volume_source.hpp"

namespace amrtex {

enum class ValueType { u1, i1, u2, i2, u4, i4, f4, f8 };
int bytes_of(ValueType type);
/// What holds every number of the type exactly.
RealType real_type_of(ValueType type);

struct VolumeFile {
  std::filesystem::path data;      ///< holds the values
  std::uint64_t offset = 0;        ///< bytes in front of them, or in front of what is packed
  std::uint64_t inner_offset = 0;  ///< bytes in front of them in what is unpacked
  bool ends_with_values = false;   ///< the values are the file's last bytes, whatever stands in front
  bool gzip = false;
  bool swapped = false;  ///< the bytes of a value stand in the order that is not this machine's
  bool exact = true;     ///< the file must end behind the values
  ValueType type = ValueType::u1;
  Vec3i cells{1};
  Vec3d lower{0};    ///< world
  Vec3d spacing{1};  ///< world
  std::string field;
  std::string unit;  ///< of the values; empty where nothing says it
};

/// What `name_WxHxD_type.raw` says; nullopt for other names. Throws Error for a name of this form with a type or a shape
/// that is none.
std::optional<VolumeFile> describe_raw(const std::filesystem::path& path);
/// Reads the header of a NRRD file, with the values behind it or in another file.
VolumeFile describe_nrrd(const std::filesystem::path& path);
/// Reads the header of an array of NumPy with three axes, the last of which is x.
VolumeFile describe_npy(const std::filesystem::path& path);

/// The sizes as a shape, or an Error with the file where one is not from 1 to 2^31 - 1.
Vec3i volume_shape(const std::filesystem::path& path, const std::vector<std::int64_t>& sizes);

/// The values, as they are asked for; packed ones are unpacked here, all of them. The sizes of files are held against what they
/// should be before memory is asked for.
std::unique_ptr<VolumeSource> open_values(const VolumeFile& file);

}  // namespace amrtex
