#include "renderers/gpu/gpu_timer.hpp"

#include "structures/mesh/error.hpp"

namespace amrtex {

GpuTimer::GpuTimer(Context& context) : context_(&context) {
  if (context.info().timer_bits == 0) throw UnsupportedError("the context has no GL_TIME_ELAPSED timer");
  query_ = make_query(context, GL_TIME_ELAPSED);
}

void GpuTimer::begin() {
  context_->make_current();
  context_->gl().BeginQuery(GL_TIME_ELAPSED, query_.id());
}

void GpuTimer::end() {
  context_->make_current();
  context_->gl().EndQuery(GL_TIME_ELAPSED);
}

double GpuTimer::milliseconds() const {
  context_->make_current();
  GLuint64 nanoseconds = 0;
  context_->gl().GetQueryObjectui64v(query_.id(), GL_QUERY_RESULT, &nanoseconds);
  return static_cast<double>(nanoseconds) * 1e-6;
}

}  // namespace amrtex
