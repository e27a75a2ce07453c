#include "renderers/scene/scene_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

template <class Names, class E>
std::string_view name_in(const Names& names, E value) {
  for (const auto& name : names)
    if (name.value == value) return name.text;
  return "";
}

/// `also`: what the list of accepted names says about others.
template <class Names>
auto value_in(const Names& names, std::string_view what, std::string_view text, std::string_view also = "") {
  for (const auto& name : names)
    if (name.text == text) return name.value;
  throw UsageError(fmt::format("unknown {} {}; accepted are {}{}", what, quote(text), fmt::join(texts_of(names), ", "), also));
}

}  // namespace

std::string_view mode_name(Mode mode) { return name_in(kModeNames, mode); }
std::string_view sampling_name(Sampling sampling) { return name_in(kSamplingNames, sampling); }
std::string_view leap_name(Leap leap) { return name_in(kLeapNames, leap); }
std::string_view consumer_name(ConsumerKind consumer) { return name_in(kConsumerNames, consumer); }
std::string_view slice_target_name(SliceTarget target) { return name_in(kSliceTargetNames, target); }
std::string_view dispatch_name(Dispatch dispatch) { return name_in(kDispatchNames, dispatch); }
std::string_view integrator_name(Integrator integrator) { return name_in(kIntegratorNames, integrator); }
std::string_view output_name(Output output) { return name_in(kOutputNames, output); }
std::string_view shading_name(Shading shading) { return name_in(kShadingNames, shading); }

Mode parse_mode(std::string_view name) { return value_in(kModeNames, "mode", name); }
Sampling parse_sampling(std::string_view name) { return value_in(kSamplingNames, "sampling", name); }
Leap parse_leap(std::string_view name) { return value_in(kLeapNames, "leap", name); }
ConsumerKind parse_consumer(std::string_view name) { return value_in(kConsumerNames, "consumer", name); }
SliceTarget parse_slice_target(std::string_view name) { return value_in(kSliceTargetNames, "slice_target", name); }
Dispatch parse_dispatch(std::string_view name) { return value_in(kDispatchNames, "dispatch", name); }
Output parse_output(std::string_view name) { return value_in(kOutputNames, "output", name); }
Shading parse_shading(std::string_view name) { return value_in(kShadingNames, "shading", name); }

Integrator parse_integrator(std::string_view name) {
  if (name == kMidpointName) return Integrator::exponential_midpoint;
  return value_in(kIntegratorNames, "integrator", name, fmt::format("; {} stands for the first", kMidpointName));
}

std::string mirror_name(const Mirror& mirror) { return std::string(name_in(kMirrorNames, mirror)); }
Mirror parse_mirror(std::string_view name) { return value_in(kMirrorNames, "face", name); }

}  // namespace amrtex
