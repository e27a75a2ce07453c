// What draws a structure: one interface for the raycaster and for those that draw box by box.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "renderers/scene/picture.hpp"

namespace amrtex {

/// What the shader itself counted, and how often the consumer drew.
struct WorkCounts {
  std::int64_t rays = 0;  ///< that met the drawn box of the domain; of consumers that draw box by box, that have a sample
  std::int64_t samples = 0;
  std::int64_t regions = 0;          ///< visits of rays; of slices, pixels on a slice
  std::int64_t regions_skipped = 0;  ///< of these; an invisible box is not drawn at all and not counted
  std::int64_t passes = 1;           ///< draws a frame, each blended over those before
};

/// The same of one pixel's ray.
struct PixelWork {
  bool met = false;  ///< the ray meets the drawn box of the domain
  std::int64_t samples = 0;
  std::int64_t regions = 0;
  std::int64_t regions_skipped = 0;
  int finest_level = -1;  ///< of a sample; -1 without any
};

struct FrameTime {
  double wall_ms = 0;  ///< from before the host's own work for the frame until glFinish
  double gpu_ms = 0;   ///< GL_TIME_ELAPSED; NaN without a timer
};

class Consumer {
 public:
  virtual ~Consumer() = default;

  virtual FrameTime draw() = 0;
  /// The last picture drawn: 4 channels for colour, else 1.
  virtual Picture read() const = 0;
  /// Draws once more with the counting variant of the shader.
  virtual WorkCounts count() = 0;
  virtual const std::string& shader_hash() const = 0;
  /// Is the transfer function evaluated from its points, and not from a table?
  virtual bool transfer_exact() const = 0;
  /// That finding where rays meet the scene's triangles took, before the first draw; 0 where it has none.
  virtual double triangle_seconds() const { return 0; }
  /// Of the map by which rays leap over what is hidden; 0 where there is none.
  virtual std::int64_t leap_bytes() const { return 0; }
  /// Draws so many times inside one GL_TIME_ELAPSED query, with nothing read back; milliseconds a draw. With several draws it is
  /// a throughput: the end of one may overlap the next. NaN without a timer.
  virtual double gpu_ms_a_draw(int draws) = 0;
  /// count() by pixels, in the order of Picture. Throws UnsupportedError where the consumer draws no rays.
  virtual std::vector<PixelWork> count_pixels() = 0;
};

}  // namespace amrtex
