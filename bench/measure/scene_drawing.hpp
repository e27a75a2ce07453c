// One scene, drawn when it is asked for: its picture, its reference, what its pixels cost, and the structure behind them.
#pragma once

#include <memory>
#include <optional>

#include "bench/measure/built.hpp"
#include "bench/measure/heat_map.hpp"
#include "renderers/consumers/consumer.hpp"
#include "renderers/reference/hierarchy_reference.hpp"

namespace amrtex {

class SceneDrawing {
 public:
  /// `scene`: an experiment of one point. Reads its data set.
  explicit SceneDrawing(Experiment scene);
  ~SceneDrawing();
  SceneDrawing(const SceneDrawing&) = delete;
  SceneDrawing& operator=(const SceneDrawing&) = delete;

  const Experiment& experiment() const { return experiment_; }
  const BuildPoint& build() const { return experiment_.builds.front(); }
  const Scene& scene() const { return scene_; }
  const AmrHierarchy& mesh() const { return mesh_; }

  /// These draw on the scene's GL context, and throw as build_structure() and make_consumer() do.
  const Picture& picture();
  Picture heat(Heat heat);
  /// Of the scene's own filter, by the experiment's rule.
  const Picture& reference();
  /// The filter in double precision.
  HierarchyReference filter() const;
  /// The scene's encoding and parameters, built without a context. `boxes`: with those that are drawn one by one.
  EncodedField field(bool boxes) const;

 private:
  Consumer& consumer();

  Experiment experiment_;
  Scene scene_;
  AmrHierarchy mesh_;
  std::unique_ptr<Context> context_;
  std::unique_ptr<Built> built_;
  std::unique_ptr<Consumer> consumer_;
  std::optional<Picture> picture_, reference_;
};

}  // namespace amrtex
