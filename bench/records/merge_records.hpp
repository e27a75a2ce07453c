// Folders of records of many machines become one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace amrtex {

struct MergedRecords {
  std::size_t added = 0;
  std::size_t present = 0;     ///< were there already, so that merging twice changes nothing
  std::size_t renumbered = 0;  ///< of those added: two machines of one kind both had this repetition, and each keeps its own
  std::size_t pictures = 0;    ///< of points of `out` that had none there: an input's, as numbers and to look at
  std::vector<std::string> warnings;  ///< of lines that cannot be read
};

/// Adds the records of `inputs` to those of `out`, which is made where it is not there; inputs stay as they are. Contexts stay
/// apart. Pictures go along with their points: the first input that has a point's gives it. A point that another program measured in the same context is refused, since tables and comparisons would take both for
/// one: UsageError, as for inputs that hold no records or older ones. Nothing is written then.
MergedRecords merge_records(const std::filesystem::path& out, std::span<const std::filesystem::path> inputs);

}  // namespace amrtex
