// What a record says of its point beside what was measured: data, settings, machine, structure.
#pragma once

#include <string>

#include "bench/measure/built.hpp"
#include "bench/measure/loaded_data.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/context/context.hpp"

namespace amrtex {

/// What all points of a run share.
struct RunConditions {
  Json shader_cache;  ///< state of the folder of compiled shaders when the context was made; null where it is the driver's
  std::string implementation;  ///< environment.hpp
};

/// Fills the keys that a point has before anything is drawn.
void describe_point(Json& record, const Experiment& experiment, LoadedData& data, const BuildPoint& build,
                    const RenderPoint& render, const GlContextInfo& context, const RunConditions& run);

/// Fills those of its structure, which are null where it could not be built.
void describe_structure(Json& record, const Built& built, const AmrHierarchy& mesh);

/// Adds one to `context.warnings`.
void warn(Json& record, const std::string& text);

}  // namespace amrtex
