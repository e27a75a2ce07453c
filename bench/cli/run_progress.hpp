// How far a run is: one line that changes on a terminal, one line a minute elsewhere.
#pragma once

#include <chrono>
#include <string>

namespace amrtex {

class RunProgress {
 public:
  explicit RunProgress(bool terminal) : terminal_(terminal) {}
  ~RunProgress();
  RunProgress(const RunProgress&) = delete;
  RunProgress& operator=(const RunProgress&) = delete;

  void plan(int points) { planned_ += points; }
  void now(const std::string& what);
  void record();

 private:
  using Clock = std::chrono::steady_clock;
  void show();

  bool terminal_;
  int planned_ = 0;
  int done_ = 0;
  std::string what_;
  Clock::time_point begin_ = Clock::now();
  Clock::time_point shown_ = begin_;
  bool line_is_open_ = false;
};

/// "4 min", "35 s", "2 h 10 min".
std::string duration_text(double seconds);

}  // namespace amrtex
