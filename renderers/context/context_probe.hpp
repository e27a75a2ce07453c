// Trying out a context in a child process, because starting a broken driver may
// hang for minutes or crash, and neither may take the program along.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "renderers/context/context.hpp"

namespace amrtex {

Json to_json(const GlContextInfo& info);
GlContextInfo context_info_from_json(const Json& json);

struct ChildResult {
  bool ok = false;
  bool timed_out = false;
  std::string text;    ///< what the work returned
  std::string reason;  ///< why not ok: the error's message, the signal or the timeout
  double seconds = 0;
};

/// Runs `work` in a forked child and kills that child after `timeout`. To be called
/// before this process uses GL or starts threads: neither survives a fork.
ChildResult run_in_child(const std::function<std::string()>& work, std::chrono::milliseconds timeout);

struct ContextProbe {
  bool ok = false;
  bool timed_out = false;
  std::string reason;
  GlContextInfo info;  ///< when ok
  double seconds = 0;
};

/// make_context in a child, with the caution of run_in_child.
ContextProbe probe_context(const ContextChoice& choice, std::chrono::milliseconds timeout);

/// A device as EGL lists it, for people.
struct ListedDevice {
  int index = 0;
  bool software = false;
  std::string text;
};
/// In a child as well, because listing opens the driver. Empty, with `reason`, where there is no EGL or it lists none.
std::vector<ListedDevice> probe_devices(std::chrono::milliseconds timeout, std::string& reason);

}  // namespace amrtex
