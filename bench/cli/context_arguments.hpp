// `--context` and `--device`, which every command that draws takes.
#pragma once

#include <optional>
#include <string>

#include "renderers/context/context.hpp"

namespace CLI {
class App;
}

namespace amrtex {

struct ContextArguments {
  std::string context;  ///< empty: not given
  int device = -1;      ///< negative: not given

  bool given() const { return !context.empty() || device >= 0; }
  /// What was asked for, else `fallback`. Throws UsageError where the two options contradict each other.
  ContextChoice choice(const std::string& fallback) const;
};

/// `otherwise` says in the help what is used where neither is given.
void add_context_options(CLI::App& command, ContextArguments& arguments, const std::string& otherwise);

}  // namespace amrtex
