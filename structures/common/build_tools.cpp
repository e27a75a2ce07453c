#include "structures/common/build_tools.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <limits>

namespace amrtex {

void ValueRange::add(double value) {
  if (std::isnan(value)) return;
  if (empty()) {
    min = max = value;
  } else {
    min = std::min(min, value);
    max = std::max(max, value);
  }
}

namespace {

/// A float, or the largest one.
float as_float(double number) {
  constexpr double kMost = std::numeric_limits<float>::max();
  return static_cast<float>(std::clamp(number, -kMost, kMost));
}

/// How far a number may lie from that of the same value, which was once a double in field units.
double value_slack(const ValueUnits& units) { return std::ldexp(std::abs(units.offset) / units.scale, -51); }

/// How far a decoded number may lie from the one that was stored.
double storage_slack(Storage storage, StorageScale scale, double largest) {
  double slack = 4e-7 * std::max(largest, storage == Storage::r32f ? 0.0 : std::abs(scale.scale));
  if (storage == Storage::r8) slack += scale.scale * (0.51 / 255);
  if (storage == Storage::r16) slack += scale.scale * (0.51 / 65535);
  if (storage == Storage::r16f) slack += scale.scale * std::ldexp(1.0, -11);
  return slack;
}

}  // namespace

double range_origin(const FieldStatistics& s, Storage storage, StorageScale scale) {
  if (std::isnan(s.min)) return 0;
  const double min = scale.units.number(s.min), max = scale.units.number(s.max);
  // interpolants of values from 0 up stay there: regions of 0 then have the range (0, 0), which projections skip
  if (min == 0 && (storage == Storage::r32f || storage == Storage::r64f)) return 0;
  const double lowest =
      min - storage_slack(storage, scale.in_units(), std::max(std::abs(min), std::abs(max))) - value_slack(scale.units);
  return static_cast<double>(std::nextafter(static_cast<float>(lowest), -std::numeric_limits<float>::infinity()));
}

std::uint32_t encode_range(ValueRange range, double origin, Storage storage, StorageScale scale) {
  if (range.empty()) return kNoRange;
  range = {scale.units.number(range.min), scale.units.number(range.max)};
  const double slack =
      storage_slack(storage, scale.in_units(), std::max(std::abs(range.min), std::abs(range.max))) + value_slack(scale.units);
  // one part in 2^20 for the shader's own sum of origin and distance
  const double margin = slack + std::ldexp(std::abs(origin), -20);
  const auto low = static_cast<float>(std::max(range.min - margin - origin, 0.0) * (1 - 1e-6));
  const auto high = static_cast<float>((range.max + margin - origin) * (1 + 1e-6));
  const std::uint32_t below = std::bit_cast<std::uint32_t>(low) >> 16;
  const std::uint32_t above = (std::bit_cast<std::uint32_t>(high) + 0xffffU) >> 16;
  return below | (std::min(above, 0x7f80U) << 16);
}

std::uint32_t encode_range(const EncodedField& field, int number, ValueRange range) {
  if (range.empty()) return kVacantRange;
  const double origin = number == 0 ? field.range_origin : field.more_range_origins[static_cast<std::size_t>(number - 1)];
  return encode_range(range, origin, field.storage, field.scale_of(number));
}

MoreRanges::MoreRanges(EncodedField& field, std::string_view name) : field_(&field) {
  HostTexture* buffer = field.find(name);
  words_ = buffer != nullptr ? buffer->as<std::uint32_t>() : nullptr;
}

void MoreRanges::set(std::int64_t region, int number, ValueRange range) const {
  if (number == 0 || !needed()) return;
  words_[region * (field_->field_count - 1) + number - 1] = encode_range(*field_, number, range);
}

bool hidden(const SceneNeeds& needs, ValueRange range, double origin, Storage storage, StorageScale scale) {
  if (needs.invisible.empty()) return false;
  if (range.empty()) return true;
  const std::uint32_t code = encode_range(range, origin, storage, scale);
  // as decode_range and the uniforms: in floats
  const float low = static_cast<float>(origin) + std::bit_cast<float>(code << 16);
  const float high = static_cast<float>(origin) + std::bit_cast<float>(code & 0xffff0000U);
  for (const auto& [first, last] : needs.invisible)
    if (low >= as_float(scale.units.number(first)) && high <= as_float(scale.units.number(last))) return true;
  return false;
}

void store_values(Storage storage, StorageScale scale, const double* values, std::size_t count, std::byte* data,
                  std::size_t first) {
  if (storage == Storage::r32f && scale.units.plain()) {
    auto* out = reinterpret_cast<float*>(data) + first;
    for (std::size_t i = 0; i < count; ++i) out[i] = std::isnan(values[i]) ? 0.0F : static_cast<float>(values[i]);
    return;
  }
  for (std::size_t i = 0; i < count; ++i)
    store_value(storage, scale, std::isnan(values[i]) ? scale.offset : values[i], data, first + i);
}

HostTexture make_texture(std::string name, TexelFormat format, const Vec3i& size) {
  HostTexture t;
  t.name = std::move(name);
  t.kind = HostTexture::Kind::texture_3d;
  t.format = format;
  t.size = size;
  t.data.resize(static_cast<std::size_t>(t.bytes()));
  return t;
}

HostTexture make_buffer(std::string name, TexelFormat format, std::int64_t elements) {
  HostTexture t = make_texture(std::move(name), format, {static_cast<int>(std::max<std::int64_t>(elements, 1)), 1, 1});
  t.kind = HostTexture::Kind::buffer;
  t.roles.topology = t.bytes();
  return t;
}

void write_box(const Box& box, std::uint32_t fourth, std::uint32_t eighth, std::uint32_t* words) {
  for (int a = 0; a < 3; ++a) {
    words[a] = static_cast<std::uint32_t>(box.lower[a]);
    words[4 + a] = static_cast<std::uint32_t>(box.upper[a]);
  }
  words[3] = fourth;
  words[7] = eighth;
}

double leaked_value(const FieldStatistics& s, const Vec3i& pool) {
  const double weight = 3 * std::ldexp(3.0, -24) * std::max({pool.x, pool.y, pool.z});
  // of the numbers that texels hold, where what lies between is 0
  const ValueUnits units = value_units(s);
  const double min = units.number(s.min), max = units.number(s.max);
  return weight * std::max({max - min, std::abs(min), std::abs(max)}) * units.scale;
}

bool power_of_two_ratios(const AmrHierarchy& hierarchy) {
  for (int l = 0; l < hierarchy.finest_level(); ++l) {
    const int r = hierarchy.ratio_to_finer(l);
    if ((r & (r - 1)) != 0) return false;
  }
  return true;
}

namespace {

/// log2 of the ratio where all levels have the same power of two; 0 otherwise.
int common_ratio_shift(const AmrHierarchy& hierarchy) {
  if (hierarchy.finest_level() == 0) return 1;  // there is no ratio; any will do
  const auto r = static_cast<unsigned>(hierarchy.ratio_to_finer(0));
  for (int l = 1; l < hierarchy.finest_level(); ++l)
    if (static_cast<unsigned>(hierarchy.ratio_to_finer(l)) != r) return 0;
  return std::has_single_bit(r) ? std::countr_zero(r) : 0;
}

}  // namespace

namespace {

/// Throws UnsupportedError where sums of values that builders make are no double.
void require_finite_sums(const Encoding& encoding, const AmrHierarchy& h, const BuildRequest& request) {
  constexpr double kMost = 0x1p1000;
  for (int i = 0; i < request.field_count(); ++i) {
    const FieldStatistics& s = h.statistics(request.field_at(i));
    if (s.max > kMost || s.min < -kMost)
      throw UnsupportedError(
          fmt::format("encoding {}: values from {:.3g} to {:.3g}; accepted: magnitudes up to {:.3g}, of which "
                      "doubles hold sums",
                      encoding.name(), s.min, s.max, kMost));
  }
}

}  // namespace

bool any_missing(const AmrHierarchy& hierarchy, const BuildRequest& request) {
  if (request.needs.keeps_validity()) return true;
  for (int i = 0; i < request.field_count(); ++i)
    if (hierarchy.has_missing(request.field_at(i))) return true;
  return false;
}

Filtering stored_filtering(const BuildRequest& request) {
  const bool linear = request.needs.filter != Filter::nearest;
  return linear && request.storage != Storage::r64f ? request.needs.filtering : Filtering::manual;
}

EncodedField start_field(const Encoding& encoding, const AmrHierarchy& hierarchy, const BuildRequest& request,
                         const Json& parameters) {
  require_fields(encoding, hierarchy, request);
  require_level_of_detail(encoding, request.needs);
  require_analytic_gradients(encoding, request.needs);
  require_finite_sums(encoding, hierarchy, request);
  EncodedField field;
  field.encoding = encoding.name();
  field.build_parameters = parameters;
  field.definition = encoding.definition(hierarchy, request);
  field.filtering = stored_filtering(request);
  field.storage = request.storage;
  const FieldStatistics& s = hierarchy.statistics(request.field);
  field.scale = storage_scale(request.storage, s);
  for (int i = 0; i < request.field_count(); ++i) field.values.push_back(hierarchy.statistics(request.field_at(i)));
  field.field_count = request.field_count();
  for (const int other : request.more_fields) {
    const FieldStatistics& o = hierarchy.statistics(other);
    field.more_scales.push_back(storage_scale(request.storage, o));
    if (request.needs.field_ranges)
      field.more_range_origins.push_back(range_origin(o, request.storage, field.more_scales.back()));
  }
  const bool scaled = request.storage != Storage::r32f && request.storage != Storage::r64f;
  field.range_origin = range_origin(s, request.storage, field.scale);
  field.invisible = request.needs.invisible;
  if (request.needs.variation) field.variation = VariationGrid::of(hierarchy, request.field, field.scale.units);
  field.shader.file = fmt::format("{0}/{0}.glsl", encoding.name());
  field.shader.defines = {{"AMRTEX_FILTER", static_cast<int>(request.needs.filter)},
                          {"AMRTEX_HARDWARE_FILTERING", field.filtering == Filtering::hardware ? 1 : 0},
                          {"AMRTEX_POWER_OF_TWO", power_of_two_ratios(hierarchy) ? 1 : 0},
                          {"AMRTEX_RATIO_SHIFT", common_ratio_shift(hierarchy)},
                          {"AMRTEX_LEVELS", hierarchy.level_count()},
                          {"AMRTEX_FIELDS", field.field_count},
                          {"AMRTEX_VALIDITY", any_missing(hierarchy, request) ? 1 : 0},
                          {"AMRTEX_VALUE_RANGES", request.needs.value_ranges ? 1 : 0},
                          {"AMRTEX_FIELD_RANGES", request.needs.field_ranges && request.field_count() > 1 ? 1 : 0},
                          {"AMRTEX_SCALED_STORAGE", scaled ? 1 : 0},
                          {"AMRTEX_LEVEL_OF_DETAIL", request.needs.level_of_detail ? 1 : 0}};
  return field;
}

}  // namespace amrtex
