// Time that GL itself measures, apart from the wall clock around glFinish.
#pragma once

#include <optional>
#include <string>

#include "renderers/gpu/gl_objects.hpp"

namespace amrtex {

/// Why GL_TIME_ELAPSED of this context says nothing about a GPU; empty where it may be used. On llvmpipe the query starts anew
/// in every tile, so it times only the last ones; other software rasterisers are no better.
std::string timer_refusal(const GlContextInfo& info);

/// One GL_TIME_ELAPSED query. Without a timer in the context, begin() and end() do nothing.
class GpuTimer {
 public:
  explicit GpuTimer(Context& context);
  void begin();
  void end();
  /// Milliseconds between the last begin() and end(), whatever they are worth (timer_refusal); waits for the result. NaN without
  /// a timer.
  double milliseconds() const;

 private:
  Context* context_;
  GlQuery query_;
};

/// What a query can tell apart, and what it costs.
struct TimerQuality {
  double resolution_ns = 0;  ///< smallest difference seen between two time stamps
  double overhead_ns = 0;    ///< median of queries around nothing
};
/// Absent where the context has no timer.
std::optional<TimerQuality> measure_timer(Context& context);

}  // namespace amrtex
