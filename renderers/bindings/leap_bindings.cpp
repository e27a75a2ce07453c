#include "renderers/bindings/leap_bindings.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>

#include "renderers/bindings/block_map.hpp"
#include "renderers/bindings/distance_map.hpp"
#include "renderers/bindings/transfer_bindings.hpp"

namespace amrtex {
namespace {

static_assert(static_cast<int>(Leap::off) == AMRTEX_LEAPS_NONE && static_cast<int>(Leap::cube) == AMRTEX_LEAPS_CUBE &&
              static_cast<int>(Leap::octant) == AMRTEX_LEAPS_OCTANT);

float as_float(double v) { return static_cast<float>(v); }

/// May rays leap at all, as far as the scene tells?
bool leaps(const EncodedField& field, const Scene& scene) {
  const RenderSettings& s = scene.settings;
  const bool from_ranges_alone = s.mode == Mode::dvr || (s.mode == Mode::projection && field.scale.units.offset == 0);
  return s.skip && s.leap != Leap::off && from_ranges_alone && s.integrator != Integrator::preintegrated &&
         scene.more_fields.empty() && s.consumer == ConsumerKind::raycast && !s.prunes_levels() && !field.leaps.empty();
}

/// As region_invisible() in shaders/sample.glsl, in floats.
class Hides {
 public:
  Hides(const EncodedField& field, const Scene& stored) : origin_(as_float(field.range_origin)) {
    if (stored.settings.mode == Mode::projection)
      hidden_.push_back({0, 0});
    else
      for (const auto& [from, to] : invisible_ranges(stored.transfer_function)) hidden_.push_back({as_float(from), as_float(to)});
  }

  bool operator()(std::uint32_t code) const {
    if (code == kNoRange) return true;
    const float low = origin_ + std::bit_cast<float>(code << 16);
    const float high = origin_ + std::bit_cast<float>(code & 0xffff0000U);
    return std::any_of(hidden_.begin(), hidden_.end(),
                       [&](const std::array<float, 2>& range) { return low >= range[0] && high <= range[1]; });
  }

 private:
  float origin_;
  std::vector<std::array<float, 2>> hidden_;
};

std::vector<std::uint8_t> octants(const Vec3i& blocks, const std::vector<std::uint8_t>& seen) {
  std::vector<std::uint8_t> all(8 * seen.size());
  tbb::parallel_for(0, 8, [&](int octant) {
    const std::vector<std::uint8_t> one = octant_distances(blocks, seen, octant);
    std::copy(one.begin(), one.end(), all.begin() + octant * std::ssize(seen));
  });
  return all;
}

}  // namespace

void add_leaps(const EncodedField& field, const Scene& stored, LeapMap map, SceneBindings& b) {
  std::vector<std::uint8_t> seen;
  const bool may_leap = leaps(field, stored);
  if (may_leap) {
    const Hides hides(field, stored);
    seen.resize(field.leaps.ranges.size());
    std::transform(field.leaps.ranges.begin(), field.leaps.ranges.end(), seen.begin(),
                   [&](std::uint32_t code) { return hides(code) ? 0 : 1; });
  }
  const bool has_map = may_leap && (map == LeapMap::always || std::find(seen.begin(), seen.end(), 0) != seen.end());
  b.define("AMRTEX_LEAPS", has_map ? static_cast<int>(stored.settings.leap) : 0);
  if (!has_map) return;
  const Vec3i& blocks = field.leaps.blocks;
  b.buffers.push_back(block_map(
      "leap_distances", stored.settings.leap == Leap::octant ? octants(blocks, seen) : chessboard_distances(blocks, seen)));
  b.uniforms.push_back({"u_leap_blocks", std::vector<int>{blocks.x, blocks.y, blocks.z}});
  b.set("u_leap_shift", field.leaps.shift);
}

}  // namespace amrtex
