#include "bench/measure/built.hpp"

#include <fmt/format.h>

#include "bench/measure/scene_data.hpp"
#include "bench/measure/stopwatch.hpp"
#include "renderers/bindings/scene_needs.hpp"

namespace amrtex {

std::unique_ptr<Built> build_structure(const Experiment& experiment, const BuildPoint& build, const AmrHierarchy& mesh,
                                       const Scene& scene, Context& context) {
  BuildRequest request;
  request.storage = build.storage;
  request.parameters = build.parameters;
  request.context = context.info();
  request.memory_limit = experiment.memory_limit.value_or(request.memory_limit);
  request.needs = scene_needs(scene, build.filter, build.filtering);
  request.more_fields = more_fields(mesh, scene);
  const Encoding& encoding = find_encoding(build.encoding);
  if (const Support support = encoding.supported(request.context); !support.ok)
    throw UnsupportedError(fmt::format("encoding {}: {}", build.encoding, support.reason));
  const Stopwatch building;
  EncodedField field = encoding.build(mesh, request);
  const double build_seconds = building.seconds();
  const Stopwatch uploading;
  const HostArrays arrays = experiment.explain_error ? HostArrays::keep : HostArrays::give_back;
  auto built = std::make_unique<Built>(Built{Structure(context, std::move(field), request, arrays), build_seconds, 0});
  context.gl().Finish();
  built->upload_seconds = uploading.seconds();
  return built;
}

}  // namespace amrtex
