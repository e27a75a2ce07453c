// A thread that does one thing after the other. GL contexts are used by one thread at a time, and Python's own must stay free to
// hear Ctrl-C.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

namespace amrtex {

/// Something that a worker does, as the one who waits for it sees it.
class Task {
 public:
  explicit Task(std::function<void()> work) : work_(std::move(work)) {}

  void run();
  /// Is it done within this time?
  bool wait_for(std::chrono::milliseconds time);
  void wait();
  /// What it threw. After it is done.
  void rethrow() const;

 private:
  std::function<void()> work_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool done_ = false;
  std::exception_ptr error_;
};

class Worker {
 public:
  Worker();
  /// Does what is left to do.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// `work` must own what it uses: who asked may stop waiting for it. Throws Error in a process that was forked off, which has no
  /// copy of the thread.
  std::shared_ptr<Task> start(std::function<void()> work);
  /// The same, for what nobody waits for; in a forked process it is dropped.
  void leave(std::function<void()> work) noexcept;

 private:
  void loop();
  void add(std::shared_ptr<Task> task);

  int process_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::shared_ptr<Task>> tasks_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace amrtex
