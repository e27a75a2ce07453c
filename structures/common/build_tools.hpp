// What builders of encodings share: storing blocks of values, validity bits, ranges.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "structures/common/coded_range.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

/// Minimum and maximum of values; NaN is left out; minimum > maximum when none is left.
struct ValueRange {
  double min = 1;
  double max = -1;
  bool empty() const { return min > max; }
  void add(double value);
  bool operator==(const ValueRange&) const = default;
};

/// What ranges are relative to: at most every number that the shader can return.
double range_origin(const FieldStatistics& statistics, Storage storage, StorageScale scale);

/// The range of everything that fetch_field may return for values stored in this format, as numbers in the field's units and in
/// 32 bits: distances of minimum (lower half) and maximum (upper half) from the origin as the
/// upper halves of floats, rounded outwards. 8 bits of mantissa and of exponent, so that
/// skipping works for fields of any magnitude. decode_range() in contract.glsl reads it.
std::uint32_t encode_range(ValueRange range, double origin, Storage storage, StorageScale scale);

/// The same of field number `number` of a structure; kVacantRange where the range is empty.
std::uint32_t encode_range(const EncodedField& field, int number, ValueRange range);

/// Writes coded ranges of the fields beside the first, as fetch_range() reads them: those of a region side by side, in the part
/// that Layout::more_ranges() declares.
class MoreRanges {
 public:
  /// `name`: of the part. Where it is absent, set() does nothing.
  MoreRanges(EncodedField& field, std::string_view name);
  bool needed() const { return words_ != nullptr; }
  /// For threads that have regions of their own. Nothing where `number` is 0.
  void set(std::int64_t region, int number, ValueRange range) const;

 private:
  const EncodedField* field_;
  std::uint32_t* words_;
};

/// Stores `count` values side by side from texel `first`; NaN is stored as 0.
void store_values(Storage storage, StorageScale scale, const double* values, std::size_t count, std::byte* data,
                  std::size_t first);

/// An allocated, zeroed texture or buffer.
HostTexture make_texture(std::string name, TexelFormat format, const Vec3i& size);
HostTexture make_buffer(std::string name, TexelFormat format, std::int64_t elements);

/// Writes a box as two times four words: lower corner and `fourth`, upper corner and `eighth`.
void write_box(const Box& box, std::uint32_t fourth, std::uint32_t eighth, std::uint32_t* words);

/// Cells of a border of one cell around each brick. Bricks have their `cells` (a Box).
template <class Bricks>
std::int64_t border_cells(const Bricks& bricks) {
  std::int64_t cells = 0;
  for (const auto& brick : bricks) cells += brick.cells.grown(1).cells() - brick.cells.cells();
  return cells;
}

/// Words of 32 bits for `bits` bits.
constexpr std::int64_t words_for_bits(std::int64_t bits) { return (bits + 31) / 32; }
inline void set_bit(std::uint32_t* words, std::int64_t bit) { words[bit / 32] |= 1U << (bit % 32); }

/// A texture unit sees a little of the texel beyond the last: the rounding of the normalised coordinate is 3 times 2^-24 of the
/// pool an axis. What of it may be added to a value where the neighbour may hold anything of the field.
double leaked_value(const FieldStatistics& statistics, const Vec3i& pool);

/// Does every refinement ratio equal a power of two?
bool power_of_two_ratios(const AmrHierarchy& hierarchy);

/// Can nothing with a value in `range` be seen? The rule by which shaders skip regions (transfer_visible), on the
/// coded range. An empty range has nothing to see; without intervals in `needs` all else is visible.
bool hidden(const SceneNeeds& needs, ValueRange range, double origin, Storage storage, StorageScale scale);

/// Must an encoding of the request's fields keep validity bits? One field with missing cells is enough, or a scene
/// that asks for them.
bool any_missing(const AmrHierarchy& hierarchy, const BuildRequest& request);

/// What the built field is filtered by: `nearest` and r64f know no hardware filter.
Filtering stored_filtering(const BuildRequest& request);

/// Fields of EncodedField that are filled in the same way for every encoding.
EncodedField start_field(const Encoding& encoding, const AmrHierarchy& hierarchy, const BuildRequest& request,
                         const Json& parameters);

}  // namespace amrtex
