// What a structure is made of, declared before anything is allocated.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "structures/common/host_texture.hpp"

namespace amrtex {

/// What of a scene's needs brings back what was left out (with_need() in encoding.hpp).
enum class Need {
  none,          ///< no need of a scene does
  validity,      ///< bits that tell cells without a value
  border,        ///< cells around a brick or page
  value_ranges,  ///< by which regions are skipped
  gradients,
  hidden  ///< what the transfer function makes invisible
};

struct LeftOut {
  std::string what, why;
  std::int64_t bytes = 0;
  Need need = Need::none;              ///< what with_need() brings it back with
  std::optional<double> seconds = {};  ///< of the build, where they were measured (bench/measure/left_out_time.hpp)
};

/// One texture or buffer. From it follow its bytes, its place in the limits of a context, what is allocated, and where it is
/// absent what is told of that.
struct Part {
  std::string name;  ///< of the sampler or buffer in the encoding's GLSL
  std::string what;  ///< in messages and in `left_out`, plural: "validity bits"
  HostTexture::Kind kind = HostTexture::Kind::buffer;
  TexelFormat format = TexelFormat::r32ui;
  Vec3i size{1};                           ///< texels of a texture
  std::int64_t elements = 0;               ///< of a buffer; one is allocated where there are none
  std::optional<MemoryByRole> roles = {};  ///< in texels, what is left is padding; none: all is topology
  bool hardware_linear = false;
  bool holds_values = false;
  std::string handles = {};  ///< as HostTexture's
  std::int64_t handle_index = 0;

  bool present = true;
  std::string why_absent = {};  ///< empty: nobody would expect it, nothing is told
  Need need = Need::none;
  std::optional<std::int64_t> saved_bytes = {};  ///< by its absence, where these are not its own

  /// INT64_MAX where they take more than 63 bits, which a texture of a deep mesh would.
  std::int64_t texels() const;
  std::int64_t bytes() const;
  HostTexture allocate() const;

  Part when(bool is_present, std::string why = {}, Need brought_back_by = Need::none) &&;
  Part holding(const MemoryByRole& texels) &&;
};

Part buffer_part(std::string name, std::string what, TexelFormat format, std::int64_t elements);
Part texture_part(std::string name, std::string what, TexelFormat format, const Vec3i& size);

}  // namespace amrtex
