// Frame times of a point, beside those of the baseline of its data set.
#pragma once

#include <memory>
#include <string>

#include "bench/measure/built.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/consumers/consumer.hpp"
#include "renderers/context/context.hpp"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// The first build of a data set with the experiment's first render settings, drawn from the views that points are timed from.
class Baseline {
 public:
  /// Everything must outlive it.
  Baseline(const Experiment& experiment, std::size_t dataset, const AmrHierarchy& mesh, Context& context)
      : experiment_(experiment), dataset_(dataset), mesh_(mesh), context_(context) {}

  /// For the point's view; null where the experiment asks for no baseline. Throws UsageError where it cannot be drawn: that
  /// concerns the whole experiment, not the point that it stands beside.
  Consumer* beside(const RenderPoint& render);

 private:
  std::unique_ptr<Built> build(const Scene& scene) const;

  const Experiment& experiment_;
  std::size_t dataset_;
  const AmrHierarchy& mesh_;
  Context& context_;
  std::unique_ptr<Built> built_;
  std::unique_ptr<Consumer> consumer_;
  std::string drawn_;  ///< render settings of the consumer
};

/// `frame` of a record, and a warning for `context.warnings` where other work disturbed the times.
struct FrameTimes {
  Json frame;
  std::string warning;  ///< empty: none
};

/// Times the point again where the baseline, before and after it, does not agree with itself. `baseline` is null for none.
FrameTimes time_point(const RenderPoint& render, Consumer& consumer, Consumer* baseline, Context& context);

}  // namespace amrtex
