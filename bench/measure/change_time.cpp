#include "bench/measure/change_time.hpp"

#include <algorithm>
#include <cmath>

#include "bench/measure/stopwatch.hpp"
#include "renderers/consumers/scene_resources.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

constexpr double kPart = 0.01;

/// Added to values, or to their logarithm.
void move_points(TransferFunction& tf) {
  if (tf.extinction.empty()) return;
  const double step = kPart * (tf.axis(tf.extinction.back().value) - tf.axis(tf.extinction.front().value));
  const auto moved = [&](double value) { return tf.logarithmic ? value * std::pow(10.0, step) : value + step; };
  for (auto& point : tf.extinction) point.value = moved(point.value);
  for (auto& point : tf.color) point.value = moved(point.value);
}

void move_isovalues(std::vector<double>& values) {
  if (values.empty()) return;
  const double span = values.size() > 1 ? values.back() - values.front() : std::abs(values.front());
  for (double& value : values) value += kPart * (span > 0 ? span : 1);
}

/// The numbers of one uniform, and whether it is among `others` with the same ones.
std::int64_t bytes_of_difference(const UniformValue& value, const UniformValues& others) {
  const auto same = std::any_of(others.begin(), others.end(), [&](const UniformValue& other) {
    return other.name == value.name && other.numbers == value.numbers;
  });
  if (same) return 0;
  return 4 * std::visit([](const auto& numbers) { return static_cast<std::int64_t>(numbers.size()); }, value.numbers);
}

std::int64_t uploaded_bytes(const SceneBindings& before, const SceneBindings& after) {
  std::int64_t bytes = 0;
  for (const UniformValue& value : after.uniforms) bytes += bytes_of_difference(value, before.uniforms);
  for (const HostTexture& table : after.buffers) bytes += static_cast<std::int64_t>(table.data.size());
  return bytes;
}

}  // namespace

Scene changed_scene(Scene scene) {
  move_points(scene.transfer_function);
  move_isovalues(scene.settings.isosurfaces.values);
  return scene;
}

ChangeTimes time_changes(Context& context, const DomainGeometry& geometry, const Structure& structure, const Scene& scene,
                         int times) {
  if (scene.settings.consumer != ConsumerKind::raycast)
    throw UnsupportedError("time of a change: only the consumer raycast is measured");
  if (scene.settings.prune) throw UnsupportedError("time of a change: with 'prune' what was hidden is not there to be shown");
  const Scene other = changed_scene(scene);
  const EncodedField& field = structure.field;
  // both scenes by one shader, also where one of them hides nothing
  const auto defines = [&](const Scene& s) { return bind_scene(geometry, field, s).defines; };
  const LeapMap leaps = defines(scene) == defines(other) ? LeapMap::where_something_is_hidden : LeapMap::always;
  const SceneBindings before = bind_scene(geometry, field, scene, leaps), after = bind_scene(geometry, field, other, leaps);
  if (before.defines != after.defines) throw UnsupportedError("time of a change: the changed scene needs another shader");
  ShaderKey vertex;
  vertex.entry = "fullscreen.vert";
  const SceneResources first(context, geometry, field, scene, leaps);
  Program program(context, assemble_shader(vertex), assemble_shader(first.shader_key("raycast.frag", false)));
  first.bind(program, structure.gpu);
  ChangeTimes result;
  result.bytes = uploaded_bytes(before, after);
  for (int i = 0; i < times; ++i) {
    context.gl().Finish();
    const Stopwatch watch;
    const SceneResources resources(context, geometry, field, i % 2 == 0 ? other : scene, leaps);
    resources.bind(program, structure.gpu);
    context.gl().Finish();
    result.wall_ms.push_back(watch.seconds() * 1000);
  }
  context.check("changing the transfer function");
  return result;
}

}  // namespace amrtex
