// Views of a camera that goes around a place: the key `orbit` of a view (docs/experiments.md).
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "renderers/scene/setting.hpp"

namespace amrtex {

std::vector<const Key*> orbit_keys();

/// The views that one view of an experiment stands for, each as parse_view reads it and with its name: without the key `orbit`
/// that view itself; with it `count` views called `name`_00, `name`_01, ... on a sphere around `at`, at equal angles around
/// `axis`. Throws UsageErrors that name the key and what it accepts.
std::vector<std::pair<Json, std::string>> orbit_views(const Json& view, const std::string& name);

}  // namespace amrtex
