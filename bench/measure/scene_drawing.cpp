#include "bench/measure/scene_drawing.hpp"

#include <fmt/format.h>

#include "bench/measure/scene_data.hpp"
#include "renderers/consumers/make_consumer.hpp"

namespace amrtex {

SceneDrawing::SceneDrawing(Experiment scene)
    : experiment_(std::move(scene)),
      scene_(scene_of(experiment_, experiment_.renders.front())),
      mesh_(load_dataset(experiment_, experiment_.datasets[experiment_.builds.front().dataset])) {}

SceneDrawing::~SceneDrawing() = default;

Consumer& SceneDrawing::consumer() {
  if (consumer_) return *consumer_;
  context_ = make_context(parse_context(experiment_.context));
  built_ = build_structure(experiment_, build(), mesh_, scene_, *context_);
  consumer_ = make_consumer(*context_, mesh_, built_->structure, scene_);
  return *consumer_;
}

const Picture& SceneDrawing::picture() {
  if (picture_) return *picture_;
  consumer().draw();
  return picture_.emplace(consumer().read());
}

Picture SceneDrawing::heat(Heat heat) {
  if (heat == Heat::error) return error_picture(picture(), reference());
  return counted_picture(heat, consumer().count_pixels(), scene_.settings.width, scene_.settings.height);
}

const Picture& SceneDrawing::reference() {
  if (reference_) return *reference_;
  const ReferenceSettings settings = experiment_.reference.value_or(ReferenceSettings{});
  return reference_.emplace(filter().render(scene_, settings.rule()));
}

EncodedField SceneDrawing::field(bool boxes) const {
  BuildRequest request;
  request.storage = build().storage;
  request.parameters = build().parameters;
  request.memory_limit = experiment_.memory_limit.value_or(request.memory_limit);
  request.needs = {.filter = build().filter, .filtering = Filtering::manual, .draw_boxes = boxes};
  return find_encoding(build().encoding).build(mesh_, request);
}

HierarchyReference SceneDrawing::filter() const {
  BuildRequest request;
  request.parameters = build().parameters;
  request.needs.filter = build().filter;
  return {mesh_, 0, find_encoding(build().encoding).definition(mesh_, request)};
}

}  // namespace amrtex
