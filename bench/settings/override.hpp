// `--set key=value` of the command line: a value that replaces that of an experiment or scene file.
#pragma once

#include <string>

#include "bench/settings/json_file.hpp"

namespace amrtex {

/// Applies "render.step=0.5" to a file. The value is JSON, or else text. A key of the top level or of `render` may stand alone,
/// and so may one that a single other object has; a key of a list of objects is set in each of them, a build parameter in each
/// encoding that has it. Throws UsageErrors that start with "--set" and name the keys that could be meant; values are checked
/// where the file is read, by complaints that name "--set" too.
void override_setting(JsonFile& file, const std::string& text);

}  // namespace amrtex
