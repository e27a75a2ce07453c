// Time that GL itself measures, apart from the wall clock around glFinish.
#pragma once

#include "renderers/gpu/gl_objects.hpp"

namespace amrtex {

/// One GL_TIME_ELAPSED query. On llvmpipe the query starts anew in every tile, so it times only
/// the last ones: of use on hardware alone.
class GpuTimer {
 public:
  explicit GpuTimer(Context& context);
  void begin();
  void end();
  /// Milliseconds between the last begin() and end(); waits for the result.
  double milliseconds() const;

 private:
  Context* context_;
  GlQuery query_;
};

}  // namespace amrtex
