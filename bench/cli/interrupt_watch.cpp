#include "bench/cli/interrupt_watch.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdint>
#include <utility>

namespace amrtex {
namespace {

sigset_t watched_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, signal);
  return set;
}

}  // namespace

InterruptWatch::InterruptWatch(std::string advice) : advice_(std::move(advice)) {
  const sigset_t set = watched_signals();
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  signals_ = ::signalfd(-1, &set, SFD_CLOEXEC);
  done_ = ::eventfd(0, EFD_CLOEXEC);
  thread_ = std::thread([this] { wait(); });
}

InterruptWatch::~InterruptWatch() {
  const std::uint64_t one = 1;
  static_cast<void>(::write(done_, &one, sizeof one));
  thread_.join();
  for (const int descriptor : {signals_, done_}) ::close(descriptor);
  const sigset_t set = watched_signals();
  ::pthread_sigmask(SIG_UNBLOCK, &set, nullptr);
}

void InterruptWatch::wait() {
  std::array<pollfd, 2> ready = {pollfd{signals_, POLLIN, 0}, pollfd{done_, POLLIN, 0}};
  while (::poll(ready.data(), ready.size(), -1) < 0) {
  }
  if ((ready[0].revents & POLLIN) == 0) return;
  if (const pid_t process = process_; process > 0) ::kill(process, SIGKILL);
  // a line that is being added may be cut off: the next run drops it and measures its point again
  fmt::print(stderr, "\namrtex: interrupted; {} points of this run are kept; {}\n", records_.load(), advice_);
  ::_exit(130);
}

}  // namespace amrtex
