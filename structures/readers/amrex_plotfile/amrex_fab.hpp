// How AMReX stores the array of one patch (a FAB): the format of its numbers and
// where one component stands in the file. Pure functions, so that sizes beyond
// 2^31 bytes are tested without allocating them.
//
//   offset            "FAB ((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))((lo) (hi) (type)) ncomp\n"
//   values_begin      component 0, x fastest, ghost cells included; component 1; ...
//
// Source: AMReX Src/Base, AMReX_FabConv (RealDescriptor) and AMReX_VisMF (versions 2-4 of `Cell_H` leave the line out).
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

#include "structures/mesh/checked.hpp"
#include "structures/readers/index_box.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {

/// IEEE numbers of a FAB.
struct RealFormat {
  int bytes = 8;  ///< 4 or 8
  std::endian order = std::endian::little;

  bool operator==(const RealFormat&) const = default;
};

/// Bytes of one component in a data file.
struct FabRange {
  std::uint64_t begin = 0;    ///< of the component, from the start of the file
  std::uint64_t bytes = 0;    ///< of the component
  std::uint64_t fab_end = 0;  ///< behind the last component
};

/// Where a component of a FAB of `size` cells (ghost cells included) stands whose values begin at byte
/// `values_begin`; nullopt where that takes more than 63 bits, which no file can.
inline std::optional<FabRange> fab_component_range(std::uint64_t values_begin, const Vec3l& size, std::uint64_t components,
                                                   std::uint64_t component, int bytes_per_value) {
  const CheckedSize bytes = CheckedSize(bytes_per_value) * size.x * size.y * size.z;
  const CheckedSize end = bytes * CheckedSize::of(components) + CheckedSize::of(values_begin);
  if (!end.fits()) return std::nullopt;
  const auto each = static_cast<std::uint64_t>(bytes.or_most());
  return FabRange{values_begin + component * each, each, static_cast<std::uint64_t>(end.or_most())};
}

/// One of the lists `(n, (a b c ...))` of a real descriptor; at most 8 numbers.
inline std::string scan_descriptor_list(TextScanner& in) {
  in.expect("(", "a real descriptor");
  const std::int64_t count = in.integer("the length of a real descriptor's list", 1, 8);
  in.expect(",", "a real descriptor");
  in.expect("(", "a real descriptor");
  std::string list;
  for (std::int64_t i = 0; i < count; ++i)
    list += fmt::format("{}{}", i > 0 ? " " : "", in.integer("a real descriptor's number", 0, 4096));
  in.expect(")", "a real descriptor");
  in.expect(")", "a real descriptor");
  return list;
}

/// A real descriptor, `((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))`: layout of the bits, order of the bytes.
inline RealFormat scan_real_format(TextScanner& in) {
  in.expect("(", "a real descriptor");
  const std::string bits = scan_descriptor_list(in);
  in.expect(",", "a real descriptor");
  const std::string order = scan_descriptor_list(in);
  in.expect(")", "a real descriptor");
  if (bits == "64 11 52 0 1 12 0 1023" && order == "8 7 6 5 4 3 2 1") return {8, std::endian::little};
  if (bits == "64 11 52 0 1 12 0 1023" && order == "1 2 3 4 5 6 7 8") return {8, std::endian::big};
  if (bits == "32 8 23 0 1 9 0 127" && order == "4 3 2 1") return {4, std::endian::little};
  if (bits == "32 8 23 0 1 9 0 127" && order == "1 2 3 4") return {4, std::endian::big};
  in.fail(fmt::format(
      "numbers of the format ({}) in the byte order ({}) cannot be read; IEEE float32 and float64, big or little endian, can",
      bits, order));
}

namespace detail {

constexpr std::uint32_t reversed(std::uint32_t v) {
  return (v >> 24) | ((v >> 8) & 0xff00U) | ((v << 8) & 0xff0000U) | (v << 24);
}
constexpr std::uint64_t reversed(std::uint64_t v) {
  return (std::uint64_t{reversed(static_cast<std::uint32_t>(v))} << 32) | reversed(static_cast<std::uint32_t>(v >> 32));
}

}  // namespace detail

/// Numbers as they were read, into this machine's order of bytes.
template <class Real>
void set_byte_order(std::span<Real> numbers, const RealFormat& format) {
  using Bits = std::conditional_t<sizeof(Real) == 8, std::uint64_t, std::uint32_t>;
  if (format.order == std::endian::native) return;
  for (Real& number : numbers) number = std::bit_cast<Real>(detail::reversed(std::bit_cast<Bits>(number)));
}

}  // namespace amrtex
