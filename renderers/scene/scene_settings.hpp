// The keys of a scene: one row each. A new key is a row here, its field in scene.hpp and the code that draws it.
#pragma once

#include "renderers/scene/scene.hpp"
#include "renderers/scene/setting.hpp"

namespace amrtex {

/// Keys of `render`, and those of the top level that are part of a scene: `transfer_functions`, `region`.
const SettingTable<Scene>& scene_settings();
const SettingTable<View>& view_settings();
const SettingTable<TransferFunction>& transfer_function_settings();

/// Keys of scene_settings() that stand at the top level of a file, beside `render`.
bool is_top_level(const Key& key);

/// Throws a UsageError "'key': what is wrong" for the first key whose value is none, or does not go with others.
void validate(const Scene& scene);
/// The same of one key.
void validate_setting(const Scene& scene, std::string_view key);
/// Throws an UnsupportedError where the scene's consumer does not draw what a key asks for.
void require_consumer(const Scene& scene);

/// The `render` part of a record, without names.
Json scene_record(const Scene& scene);
/// What tells two scenes apart. A key at its default is left out: one that is added later renames no record.
Json scene_configuration(const Scene& scene, const SettingTable<Scene>& settings = scene_settings());
/// What the double reference of a scene depends on: the key of its cache, together with mesh and filter.
Json scene_reference(const Scene& scene, const SettingTable<Scene>& settings = scene_settings());

}  // namespace amrtex
