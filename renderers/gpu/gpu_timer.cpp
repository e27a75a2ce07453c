#include "renderers/gpu/gpu_timer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "structures/mesh/error.hpp"

namespace amrtex {

std::string timer_refusal(const GlContextInfo& info) {
  if (info.timer_bits == 0) return "the context has no timer: GL_TIME_ELAPSED has 0 bits";
  if (info.software) return fmt::format("{} draws on the CPU: its timer tells nothing of a GPU", info.renderer);
  return "";
}

GpuTimer::GpuTimer(Context& context) : context_(&context) {
  if (context.info().timer_bits > 0) query_ = make_query(context, GL_TIME_ELAPSED);
}

void GpuTimer::begin() {
  if (!query_) return;
  context_->make_current();
  context_->gl().BeginQuery(GL_TIME_ELAPSED, query_.id());
}

void GpuTimer::end() {
  if (!query_) return;
  context_->make_current();
  context_->gl().EndQuery(GL_TIME_ELAPSED);
}

double GpuTimer::milliseconds() const {
  if (!query_) return std::numeric_limits<double>::quiet_NaN();
  context_->make_current();
  GLuint64 nanoseconds = 0;
  context_->gl().GetQueryObjectui64v(query_.id(), GL_QUERY_RESULT, &nanoseconds);
  return static_cast<double>(nanoseconds) * 1e-6;
}

namespace {

constexpr int kStamps = 64;

/// Times of time stamps that follow each other at once, ns.
std::vector<GLuint64> read_stamps(Context& context) {
  const GladGLContext& gl = context.gl();
  std::vector<GlQuery> queries;
  for (int i = 0; i < kStamps; ++i) {
    queries.push_back(make_query(context, GL_TIMESTAMP));
    gl.QueryCounter(queries.back().id(), GL_TIMESTAMP);
    gl.Flush();
  }
  std::vector<GLuint64> stamps;
  for (const GlQuery& query : queries) gl.GetQueryObjectui64v(query.id(), GL_QUERY_RESULT, &stamps.emplace_back());
  return stamps;
}

double smallest_difference(std::vector<GLuint64> stamps) {
  std::sort(stamps.begin(), stamps.end());
  GLuint64 smallest = 0;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    const GLuint64 difference = stamps[i] - stamps[i - 1];
    if (difference > 0 && (smallest == 0 || difference < smallest)) smallest = difference;
  }
  return static_cast<double>(smallest);
}

}  // namespace

std::optional<TimerQuality> measure_timer(Context& context) {
  if (context.info().timer_bits == 0) return std::nullopt;
  context.make_current();
  GpuTimer timer(context);
  std::vector<double> empty;
  for (int i = 0; i < kStamps / 2; ++i) {
    timer.begin();
    timer.end();
    empty.push_back(timer.milliseconds() * 1e6);
  }
  std::nth_element(empty.begin(), empty.begin() + kStamps / 4, empty.end());
  const TimerQuality quality{smallest_difference(read_stamps(context)), empty[kStamps / 4]};
  context.check("measuring the timer");
  return quality;
}

}  // namespace amrtex
