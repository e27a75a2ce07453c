#include "python/worker.hpp"

#include <unistd.h>

#include <csignal>

#include "structures/mesh/error.hpp"

namespace amrtex {

void Task::run() {
  std::exception_ptr error;
  try {
    work_();
  } catch (...) {
    error = std::current_exception();
  }
  work_ = nullptr;  // what it owned ends in this thread
  const std::lock_guard lock(mutex_);
  error_ = error;
  done_ = true;
  changed_.notify_all();
}

bool Task::wait_for(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, time, [this] { return done_; });
}

void Task::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return done_; });
}

void Task::rethrow() const {
  if (error_) std::rethrow_exception(error_);
}

Worker::Worker() : process_(::getpid()) {
  // signals are for the thread that knows what to do with them
  sigset_t all, before;
  ::sigfillset(&all);
  for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) ::sigdelset(&all, fault);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);
  thread_ = std::thread([this] { loop(); });
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Worker::loop() {
  for (;;) {
    std::shared_ptr<Task> task;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ending_ || !tasks_.empty(); });
      if (tasks_.empty()) return;
      task = std::move(tasks_.front());
      tasks_.pop_front();
    }
    task->run();
  }
}

void Worker::add(std::shared_ptr<Task> task) {
  {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  changed_.notify_all();
}

std::shared_ptr<Task> Worker::start(std::function<void()> work) {
  if (::getpid() != process_)
    throw Error(
        "amrtex was imported before this process was forked off; accepted: multiprocessing with the start method 'spawn'");
  auto task = std::make_shared<Task>(std::move(work));
  add(task);
  return task;
}

void Worker::leave(std::function<void()> work) noexcept {
  if (::getpid() == process_) add(std::make_shared<Task>(std::move(work)));
}

}  // namespace amrtex
