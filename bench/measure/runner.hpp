// Running experiments: build, upload, draw, check, time, record.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "bench/settings/experiment.hpp"
#include "renderers/consumers/consumer.hpp"
#include "renderers/context/context.hpp"
#include "structures/generators/synthetic.hpp"

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

/// The mesh of one data set of an experiment, with the field that is wanted first, and after it
/// those that some render point colours surfaces by.
AmrHierarchy load_dataset(const Experiment& experiment, const DatasetSource& source);

/// The field that a generated data set samples; null for a file.
std::unique_ptr<AnalyticField> analytic_field(const DatasetSource& source);

/// Fields beside the drawn one that the scene fetches. Throws UsageError naming the fields there are.
std::vector<int> more_fields(const AmrHierarchy& hierarchy, const Scene& scene);

/// Hex digits that tell apart what a scene of this mesh is made of: every field in use to the bit, the mesh with its place and
/// spacing, and the corners of triangles, whatever their files are called.
std::string exact_data_hash(const AmrHierarchy& hierarchy, const Scene& scene);

/// What is legal about a scene of field 0 of this mesh, and yet likely not meant.
std::vector<std::string> scene_warnings(const AmrHierarchy& hierarchy, const Scene& scene);

/// Frame times through Google Benchmark with manual time: `warm_up` frames are dropped.
std::vector<FrameTime> time_frames(Consumer& consumer, int warm_up, int frames);

}  // namespace amrtex
