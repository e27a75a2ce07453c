// How a sweep is run: what its measurers and the loop over its points share.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/settings/experiment.hpp"
#include "renderers/context/context.hpp"

namespace amrtex {

struct RunOptions {
  std::filesystem::path folder;  ///< records, pictures and references are written below it
  bool force = false;            ///< measure again what has a record
  bool keep_old = false;         ///< keep records of another implementation too (environment.hpp)
  bool retry_failed = false;     ///< measure again what has a record `failed`
  bool pictures = true;          ///< keep those that are drawn
  bool count_work = true;        ///< records say how much was sampled, which takes another shader a point; only in this process
  int repeat = 1;                ///< processes that measure each point
  /// Compiled shaders are kept there for measurements alone (shader_cache.hpp); empty: wherever the driver keeps them.
  std::filesystem::path shader_cache{};
  std::optional<ContextChoice> context;      ///< overrides the experiment's
  std::optional<std::int64_t> memory_limit;  ///< bytes of one build; overrides the experiment's
  /// Points that are measured; absent: all. Others are passed over as if they were not in the experiment.
  std::function<bool(const BuildPoint&, const RenderPoint&)> wanted;
  std::vector<std::string> only;  ///< configurations, or their beginnings; empty: all

  /// The command that starts a measuring process of the same experiment (measuring_child.hpp). A crash, a hang or a shortage of memory
  /// costs its point alone then. Empty: points are measured in this process, which suits a caller that can afford to lose it.
  std::vector<std::string> measuring_process;
  std::int64_t process_limit = 0;       ///< bytes that such a process may allocate; 0: any number
  std::optional<double> time_out;       ///< seconds a point; absent: ten times the longest so far, and at least 60
  std::optional<double> time_limit;     ///< seconds, after which no further point is begun
  std::function<void(pid_t)> measuring = [](pid_t) {};  ///< hears which process measures, 0 for none
  std::function<void(int)> planned = [](int) {};        ///< hears how many points of a data set are open
  std::function<void(const Json&)> recorded = [](const Json&) {};  ///< hears each record that is on disk now
  std::function<void(const std::string&)> progress = [](const std::string&) {};
};

}  // namespace amrtex
