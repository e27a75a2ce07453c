// Which encoding, filter, storage and step to take for one scene: the fastest whose picture is exact enough and whose
// structure is small enough, found by measuring coarsely first and what is left carefully. Knows no encoding by name:
// what is tried follows from the registry and from ParameterInfo::compared.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bench/measure/runner.hpp"
#include "bench/settings/experiment.hpp"

namespace amrtex {

/// What is asked for, and among what.
struct AdviceRequest {
  double tolerance = 1e-2;  ///< error that 95 % of the pixels that see something may not exceed, in (0, 1]
  std::int64_t memory_limit = std::numeric_limits<std::int64_t>::max();  ///< bytes of all textures and buffers of a structure
  std::vector<Filter> filters{interpolating_filters().begin(), interpolating_filters().end()};
  std::vector<Storage> storages = {Storage::r32f, Storage::r16, Storage::r8};
  std::vector<Filtering> filterings = {Filtering::hardware, Filtering::manual};
  /// Where there is one, each way to draw is tried with it as well, of encodings that know how (scene key level_of_detail).
  std::optional<double> level_of_detail;
  /// What pictures are held against; absent: each against its own filter, and then filters do not compete.
  std::optional<Filter> reference = Filter::linear_vertex;
};

/// One setting: a structure and how it is drawn.
struct Candidate {
  BuildPoint build;
  RenderSettings settings;  ///< without width and height, which the effort decides
};

/// How carefully to measure.
struct Effort {
  int width = 512, height = 512;  ///< pixels
  int frames = 5;
  int warm_up = 1;
};

/// A record (bench/records/record.hpp) for each candidate, in their order.
using Measure = std::function<std::vector<Json>(std::span<const Candidate>, const Effort&)>;

/// The error that a structure's filter has at any step and in any storage: such as only filters make, or absent where filters do not
/// compete. Sees pictures of the effort's size.
using FilterError = std::function<std::optional<double>(const BuildPoint&, const Effort&)>;

/// A candidate that was measured at full size. Errors are those that the request asks about.
struct MeasuredCandidate {
  Candidate candidate;
  double frame_ms = 0;   ///< median wall time
  double error = 0;      ///< that 95 % of the pixels do not exceed that are not empty
  double max_error = 0;  ///< of any pixel
  std::int64_t bytes = 0;
};

/// Why a structure is not what is advised.
struct Loss {
  BuildPoint build;
  std::string reason;
};

/// Structures that could not be measured, alike in encoding and reason.
struct Refusal {
  std::string encoding;
  std::string status;  ///< of their records
  std::string reason;  ///< of the first
  int count = 0;
};

struct Advice {
  std::vector<MeasuredCandidate> measured;  ///< at full size, by time
  std::optional<std::size_t> chosen;        ///< index into `measured`: the fastest within tolerance and limit
  std::optional<std::size_t> nearest;       ///< where nothing is chosen: the most exact one
  std::vector<Loss> lost;                   ///< one for each other structure that was measured, the best first
  std::vector<Refusal> refused;
  std::int64_t smallest_bytes = 0;  ///< of all structures whose size is known, the limit apart; 0 where none is
  std::size_t pictures = 0;         ///< measured in all
};

/// All structures worth trying: each encoding, the values of its parameters that are compared, its filters among those asked
/// for, storages and filterings. Throws UsageError where no encoding has one of the filters.
std::vector<BuildPoint> candidate_builds(const AdviceRequest& request);
/// Ways to draw that are worth trying, from the fastest to the most exact of each integrator.
std::vector<RenderSettings> candidate_settings(const AdviceRequest& request);

/// Leaves behind filters that cannot reach the tolerance. Then measures small pictures: every encoding, parameter and filter in the first
/// storage that fits with a fine step, then the best of them in all storages and filterings with all steps, then the best of those by all
/// integrators; and the best settings at the effort `full`. `progress` hears what goes on. Throws UsageError for a tolerance outside of (0, 1].
Advice advise(
    const AdviceRequest& request, const Effort& full, const Measure& measure,
    const FilterError& filter_error = [](const BuildPoint&, const Effort&) { return std::nullopt; },
    const std::function<void(const std::string&)>& progress = [](const std::string&) {});

/// Measures by `run_experiment` below `options.folder`; data set, view and transfer function are those of `scene`, whose
/// mode is `dvr`.
Measure measure_by_running(const Experiment& scene, const AdviceRequest& request, const RunOptions& options);

/// By the double reference, kept below `options.folder`.
FilterError filter_error_by_reference(const Experiment& scene, const AdviceRequest& request, const RunOptions& options);

/// "page_table (page_size 8), linear_page, r16, hardware".
std::string build_text(const BuildPoint& build);
/// "exponential_midpoint, step 2" or "tolerance 0.01".
std::string settings_text(const RenderSettings& settings);

/// The scene file of one candidate: that of `scene`, with the keys that were found.
Json scene_with(Json scene, const Candidate& candidate);

}  // namespace amrtex
