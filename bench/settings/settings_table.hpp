// All keys of experiment and scene files: those of a scene (renderers/scene/scene_settings.hpp), and here those of what is built
// and how it is measured.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bench/settings/experiment.hpp"
#include "renderers/scene/scene_settings.hpp"

namespace amrtex {

/// Keys of the top level that one value stands for in a whole experiment.
const SettingTable<Experiment>& experiment_settings();
/// `frames`, `warm_up`: of the top level, and axes.
const SettingTable<RenderPoint>& frame_settings();
/// `filters`, `storage`, `filtering`: of the top level and of each entry of `encodings`.
const SettingTable<BuildPoint>& build_settings();
const SettingTable<ReferenceSettings>& reference_settings();

/// An object of a file and its keys.
struct Section {
  std::string name;   ///< as the documentation calls it: "top", "render"
  std::string place;  ///< in the file; empty for the top level
  std::vector<const Key*> keys;
};
/// In the order of the documentation. Build parameters of encodings are none of them: the registry has those.
std::span<const Section> all_sections();
const Section& section_of(std::string_view name);

std::vector<std::string_view> names_of(std::span<const Key* const> keys);

}  // namespace amrtex
