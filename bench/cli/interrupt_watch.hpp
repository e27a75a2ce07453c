// Ctrl-C while points are measured: the measuring process ends, what is kept is told, and the command ends with 130.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <string>
#include <thread>

namespace amrtex {

class InterruptWatch {
 public:
  /// From here on SIGINT, SIGTERM and SIGHUP are this object's. To be made before other threads, which take over what they hear.
  /// `advice` says how to go on.
  explicit InterruptWatch(std::string advice);
  ~InterruptWatch();
  InterruptWatch(const InterruptWatch&) = delete;
  InterruptWatch& operator=(const InterruptWatch&) = delete;

  /// The process that ends too; 0 for none.
  void watch(pid_t process) { process_ = process; }
  void count_record() { ++records_; }

 private:
  void wait();

  std::string advice_;
  std::atomic<pid_t> process_ = 0;
  std::atomic<int> records_ = 0;
  int signals_ = -1;
  int done_ = -1;
  std::thread thread_;
};

}  // namespace amrtex
