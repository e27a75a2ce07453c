// Running experiments: build, upload, draw, check, time, record.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "bench/settings/experiment.hpp"
#include "renderers/context/context.hpp"

namespace amrtex {

struct RunOptions {
  std::filesystem::path folder;  ///< records, pictures and references are written below it
  bool force = false;            ///< measure again what has a record
  bool keep_old = false;         ///< keep records of another implementation too (environment.hpp)
  /// Compiled shaders are kept there for measurements alone (shader_cache.hpp); empty: wherever the driver keeps them.
  std::filesystem::path shader_cache{};
  std::optional<ContextKind> context;        ///< overrides the experiment's
  std::optional<std::int64_t> memory_limit;  ///< bytes of one build; overrides the experiment's
  /// Points that are measured; absent: all. Others are passed over as if they were not in the experiment.
  std::function<bool(const BuildPoint&, const RenderPoint&)> wanted;
  std::function<void(const std::string&)> progress = [](const std::string&) {};
};

struct RunSummary {
  int measured = 0;  ///< records with status ok, written now
  int kept = 0;      ///< had a record already
  int unsupported = 0;
  int over_budget = 0;
  int failed = 0;
};

/// Measures every point that has no record of this implementation yet. Points that fail or cannot be done
/// become records too; throws only for what concerns the whole experiment, as a folder that holds records of schema 1.
RunSummary run_experiment(const Experiment& experiment, const RunOptions& options);

}  // namespace amrtex
