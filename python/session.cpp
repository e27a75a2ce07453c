#include "python/session.hpp"

#include <pybind11/pybind11.h>
#include <unistd.h>

#include <cstdio>

namespace amrtex {

namespace py = pybind11;
using namespace std::chrono_literals;

Session& Session::instance() {
  static auto* const session = new Session;
  return *session;
}

void Session::wait(const std::shared_ptr<Task>& task, const std::function<void()>& cancel) {
  for (bool done = false; !done;) {
    {
      const py::gil_scoped_release others_may_run;
      done = task->wait_for(50ms);
    }
    if (done || PyErr_CheckSignals() == 0) continue;
    const py::error_already_set interrupt;
    if (cancel) {
      const py::gil_scoped_release others_may_run;
      cancel();
      task->wait();
    } else {
      in_vain_ = task;
    }
    throw interrupt;
  }
  task->rethrow();
}

void Session::finish() noexcept {
  constexpr int kInterrupted = 130;
  if (in_vain_ && !in_vain_->wait_for(0ms)) {
    std::fflush(nullptr);
    ::_exit(kInterrupted);
  }
  try {
    worker_.start([] {})->wait();
  } catch (...) {  // a forked process, which has no such thread
  }
}

}  // namespace amrtex
