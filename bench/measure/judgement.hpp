// A point's picture before the references of its experiment, and whether it may have a time.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "bench/measure/loaded_data.hpp"
#include "bench/numbers/image_error.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/context/context.hpp"
#include "renderers/gpu/structure.hpp"

namespace amrtex {

/// A picture and all that it is judged by. Everything must outlive the call alone.
struct JudgedPicture {
  const Experiment& experiment;
  LoadedData& data;
  const Structure& structure;
  Context& context;
  const Scene& scene;
  const Picture& picture;
  std::filesystem::path references;  ///< folder of reference pictures (reference_cache.hpp)
};

/// A point of an experiment.
struct AskedPoint {
  const BuildPoint& build;
  const RenderPoint& render;
};

/// Draws the references of all points that are not in the cache below `references` yet, each once and on all cores. One that cannot be
/// drawn is left out: whoever asks for it hears why.
void draw_references(const Experiment& experiment, LoadedData& data, const std::vector<AskedPoint>& points,
                     const std::filesystem::path& references);

/// What the filter of a point does beside the common one of the experiment, both by the double reference: the error that 95 % of the pixels
/// that see something do not exceed. No structure is built: steps and storages add errors of their own.
double filter_error(const Experiment& experiment, LoadedData& data, const AskedPoint& point, const std::filesystem::path& references);

/// What a picture is against its own reference.
struct Judgement {
  ErrorMetrics error;
  Picture reference;
};

/// Fills `error_common` and `error` of the record, as far as the experiment asks for them. Absent without an own reference.
std::optional<Judgement> add_errors(Json& record, const JudgedPicture& judged);

/// Fills `check`, or the reason why there is none. False, with status and reason, where the picture is not what it had to be.
bool add_check(Json& record, const Experiment& experiment, const BuildPoint& build, const RenderSettings& settings,
               const std::optional<Judgement>& own);

}  // namespace amrtex
