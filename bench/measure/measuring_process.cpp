#include "bench/measure/measuring_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <fstream>
#include <system_error>
#include <utility>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr std::size_t kWords = 4096;

struct Pipe {
  int read = -1;
  int write = -1;
};

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw Error(fmt::format("no pipe to a measuring process: {}", std::system_category().message(errno)));
  return {ends[0], ends[1]};
}

/// How often this machine has killed a process because memory was short; 0 where it does not tell.
std::uint64_t kills_for_memory() {
  std::ifstream counters("/proc/vmstat");
  std::string name;
  std::uint64_t value = 0;
  while (counters >> name >> value)
    if (name == "oom_kill") return value;
  return 0;
}

/// Between fork and exec: nothing here may allocate.
[[noreturn]] void become(char* const* arguments, pid_t parent, const Pipe& questions, const Pipe& answers, const Pipe& words,
                         std::int64_t memory) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);  // it has ended before it was asked for its end
  // first out of the way of the numbers that they get
  const int from = ::fcntl(questions.read, F_DUPFD, 10), to = ::fcntl(answers.write, F_DUPFD, 10), said = ::fcntl(words.write, F_DUPFD, 10);
  ::dup2(from, STDIN_FILENO);
  ::dup2(said, STDOUT_FILENO);
  ::dup2(said, STDERR_FILENO);
  ::dup2(to, kAnswers);
  for (const int done : {from, to, said}) ::close(done);
  if (memory > 0) {
    // private memory: address space is what drivers reserve by the gigabyte and never touch
    const rlimit limit{static_cast<rlim_t>(memory), static_cast<rlim_t>(memory)};
    ::setrlimit(RLIMIT_DATA, &limit);
  }
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::signal(SIGINT, SIG_IGN);  // the terminal sends it to all; who started this one decides
  ::execv(arguments[0], arguments);
  ::_exit(127);
}

}  // namespace

MeasuringProcess::MeasuringProcess(const std::vector<std::string>& command, std::int64_t memory) : kills_before_(kills_for_memory()) {
  start(command, memory);
}

void MeasuringProcess::start(const std::vector<std::string>& command, std::int64_t memory) {
  std::vector<char*> arguments;
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  const Pipe questions = make_pipe(), answers = make_pipe(), words = make_pipe();
  const pid_t parent = ::getpid();
  id_ = ::fork();
  if (id_ < 0) throw Error(fmt::format("no measuring process: {}", std::system_category().message(errno)));
  if (id_ == 0) become(arguments.data(), parent, questions, answers, words, memory);
  for (const int theirs : {questions.read, answers.write, words.write}) ::close(theirs);
  questions_ = questions.write;
  answers_ = answers.read;
  words_ = words.read;
  for (const int ours : {answers_, words_}) ::fcntl(ours, F_SETFL, O_NONBLOCK);
}

MeasuringProcess::~MeasuringProcess() {
  if (id_ > 0) finish();
  for (const int descriptor : {questions_, answers_, words_})
    if (descriptor >= 0) ::close(descriptor);
}

void MeasuringProcess::send(const Json& question) {
  const std::string line = question.dump() + "\n";
  std::string_view rest = line;
  while (!rest.empty()) {
    // a process that has ended must not end this one by SIGPIPE
    sigset_t pipe, before;
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    ::pthread_sigmask(SIG_BLOCK, &pipe, &before);
    const ssize_t written = ::write(questions_, rest.data(), rest.size());
    const int error = errno;
    if (written < 0 && error == EPIPE) {
      const timespec now{};
      ::sigtimedwait(&pipe, nullptr, &now);
    }
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
    if (written < 0 && error == EINTR) continue;
    if (written < 0) return;
    rest.remove_prefix(static_cast<std::size_t>(written));
  }
}

void MeasuringProcess::read_available() {
  std::array<char, 65536> part;
  const auto read_from = [&](int descriptor, std::string& into) {
    ssize_t n = 0;
    while ((n = ::read(descriptor, part.data(), part.size())) > 0) into.append(part.data(), static_cast<std::size_t>(n));
    return n == 0;
  };
  read_from(words_, said_);
  if (said_.size() > kWords) said_.erase(0, said_.size() - kWords);
  if (read_from(answers_, pending_)) closed_ = true;
}

std::optional<Json> MeasuringProcess::receive(std::chrono::milliseconds timeout) {
  const auto end = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    if (const std::size_t line = pending_.find('\n'); line != std::string::npos) {
      const Json answer = Json::parse(pending_.substr(0, line), nullptr, false);
      pending_.erase(0, line + 1);
      if (!answer.is_discarded()) return answer;
      continue;
    }
    if (closed_) return std::nullopt;
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) return std::nullopt;
    std::array<pollfd, 2> ready = {pollfd{answers_, POLLIN, 0}, pollfd{words_, POLLIN, 0}};
    ::poll(ready.data(), ready.size(), static_cast<int>(std::min<std::int64_t>(left.count(), 1000)));
    read_available();
  }
}

MeasuringProcess::Ending MeasuringProcess::finish() {
  read_available();
  const bool ended_itself = closed_;
  if (!ended_itself) ::kill(id_, SIGKILL);
  int status = 0;
  while (::waitpid(id_, &status, 0) < 0 && errno == EINTR) {
  }
  id_ = -1;
  read_available();
  Ending ending;
  const std::string words = last_words();
  const std::string said = words.empty() ? "" : "; its last words: " + words;
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    ending.end = signal == SIGKILL ? End::killed : End::crashed;
    ending.reason = fmt::format("was ended by signal {} ({})", signal, ::strsignal(signal)) + said;
    if (signal == SIGKILL && kills_for_memory() > kills_before_) {
      ending.end = End::out_of_memory;
      ending.reason = "was ended by the system, whose memory was short" + said;
    }
  } else {
    ending.end = WEXITSTATUS(status) == 0 ? End::exited : End::crashed;
    ending.reason = fmt::format("ended with exit code {}", WEXITSTATUS(status)) + said;
  }
  return ending;
}

std::string MeasuringProcess::last_words() const {
  std::string_view text = said_;
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.remove_suffix(1);
  return one_line(text, 300);
}

}  // namespace amrtex
