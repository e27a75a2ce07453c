// A process that measures, as the one that started it sees it: a pipe each way, its last words, and how it ended.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// The descriptor on which a measuring process answers; its questions come on its standard input.
inline constexpr int kAnswers = 3;

class MeasuringProcess {
 public:
  /// Starts `command`, its program first. `memory` limits what it may allocate, in bytes; 0 for no limit. It ends with the process that
  /// started it. Throws Error where it cannot be started.
  MeasuringProcess(const std::vector<std::string>& command, std::int64_t memory);
  /// Ends it.
  ~MeasuringProcess();
  MeasuringProcess(const MeasuringProcess&) = delete;
  MeasuringProcess& operator=(const MeasuringProcess&) = delete;

  pid_t id() const { return id_; }
  /// One line of JSON. A process that has ended hears nothing, which receive() then tells.
  void send(const Json& question);
  /// The next answer; absent after `timeout`, or when the process has ended.
  std::optional<Json> receive(std::chrono::milliseconds timeout);
  bool ended() const { return closed_; }

  enum class End { exited, crashed, killed, out_of_memory };
  struct Ending {
    End end = End::exited;
    std::string reason;  ///< "was ended by signal 11 (Segmentation fault)", with its last words
  };
  /// Waits for a process that has ended, or ends it.
  Ending finish();
  /// The end of what it wrote on its standard output and error: messages of drivers, mostly.
  std::string last_words() const;

 private:
  void start(const std::vector<std::string>& command, std::int64_t memory);
  void read_available();

  pid_t id_ = -1;
  int questions_ = -1;
  int answers_ = -1;
  int words_ = -1;
  bool closed_ = false;
  std::string pending_;  ///< of an answer whose end is not there yet
  std::string said_;
  std::uint64_t kills_before_ = 0;  ///< for want of memory, on this machine
};

}  // namespace amrtex
