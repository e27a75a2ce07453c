#include "bench/cli/run_progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

using std::chrono::duration;

constexpr duration<double> kOnTerminals{0.1};
constexpr duration<double> kElsewhere{60};

}  // namespace

std::string duration_text(double seconds) {
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  const auto minutes = static_cast<long>(seconds / 60 + 0.5);
  return minutes < 90 ? fmt::format("{} min", minutes) : fmt::format("{} h {} min", minutes / 60, minutes % 60);
}

RunProgress::~RunProgress() {
  if (line_is_open_) fmt::print(stderr, "\r\x1b[K");
}

void RunProgress::now(const std::string& what) {
  what_ = what;
  show();
}

void RunProgress::record() {
  ++done_;
  show();
}

void RunProgress::show() {
  const auto now = Clock::now();
  if (now - shown_ < (terminal_ ? kOnTerminals : kElsewhere)) return;
  shown_ = now;
  const double each = done_ > 0 ? duration<double>(now - begin_).count() / done_ : 0;
  const std::string left = done_ > 0 ? duration_text(each * std::max(planned_ - done_, 0)) + " left" : "";
  const std::string text =
      fmt::format("{} of {} points{}{}: {}", done_, std::max(planned_, done_), left.empty() ? "" : ", ", left, what_);
  if (terminal_)
    fmt::print(stderr, "\r\x1b[K{}", one_line(text, 100));
  else
    fmt::print(stderr, "{}\n", one_line(text, 200));
  line_is_open_ = terminal_;
  std::fflush(stderr);
}

}  // namespace amrtex
