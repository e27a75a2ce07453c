// Names of a scene's choices, in the order in which messages and documentation list them.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "renderers/scene/scene.hpp"

namespace amrtex {

template <class E>
struct Name {
  E value;
  std::string_view text;
};

inline constexpr std::array<Name<Mode>, 5> kModeNames{
    {{Mode::dvr, "dvr"}, {Mode::projection, "projection"}, {Mode::mip, "mip"}, {Mode::iso, "iso"}, {Mode::dvr_iso, "dvr_iso"}}};
inline constexpr std::array<Name<Sampling>, 3> kSamplingNames{
    {{Sampling::lattice, "lattice"}, {Sampling::adaptive, "adaptive"}, {Sampling::planned, "planned"}}};
inline constexpr std::array<Name<Leap>, 3> kLeapNames{{{Leap::off, "off"}, {Leap::cube, "cube"}, {Leap::octant, "octant"}}};
inline constexpr std::array<Name<ConsumerKind>, 4> kConsumerNames{{{ConsumerKind::raycast, "raycast"},
                                                                   {ConsumerKind::multipass, "multipass"},
                                                                   {ConsumerKind::slices, "slices"},
                                                                   {ConsumerKind::stencil_slices, "stencil_slices"}}};
inline constexpr std::array<Name<Dispatch>, 2> kDispatchNames{{{Dispatch::fragment, "fragment"}, {Dispatch::compute, "compute"}}};
inline constexpr std::array<Name<SliceTarget>, 2> kSliceTargetNames{
    {{SliceTarget::rgba32f, "rgba32f"}, {SliceTarget::rgba8, "rgba8"}}};
inline constexpr std::array<Name<Integrator>, 5> kIntegratorNames{{{Integrator::exponential_midpoint, "exponential_midpoint"},
                                                                   {Integrator::euler, "euler"},
                                                                   {Integrator::left, "left"},
                                                                   {Integrator::preintegrated, "preintegrated"},
                                                                   {Integrator::tolerance, "tolerance"}}};
/// Another name of an integrator.
inline constexpr std::string_view kMidpointName = "midpoint";
inline constexpr std::array<Name<Output>, 3> kOutputNames{
    {{Output::color, "color"}, {Output::depth, "depth"}, {Output::normal, "normal"}}};
inline constexpr std::array<Name<Shading>, 5> kShadingNames{{{Shading::none, "none"},
                                                             {Shading::gradient, "gradient"},
                                                             {Shading::central, "central"},
                                                             {Shading::clamped, "clamped"},
                                                             {Shading::analytic, "analytic"}}};
inline constexpr std::array<Name<Mirror>, 6> kMirrorNames{
    {{{0, false}, "-x"}, {{0, true}, "+x"}, {{1, false}, "-y"}, {{1, true}, "+y"}, {{2, false}, "-z"}, {{2, true}, "+z"}}};

template <class Names>
std::vector<std::string> texts_of(const Names& names) {
  std::vector<std::string> texts;
  for (const auto& name : names) texts.emplace_back(name.text);
  return texts;
}

}  // namespace amrtex
