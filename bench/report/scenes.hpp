// What may be compared with one another: the records of one scene and context.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// A scene is a data set, view, transfer function, mode, size, lamp and surfaces; where errors are those of the own filter, it is
/// that of one filter, too.
struct ComparedScene {
  std::string context;
  std::string name;  ///< data set, view, transfer function, mode
  std::vector<const Json*> records;
};

/// By name. `common`: errors are those against the common reference.
std::vector<ComparedScene> compared_scenes(std::span<const Json> records, bool common);

/// Not a number where there is none.
double number_at(const Json& record, const std::string& pointer);
/// Empty where there is none.
std::string text_at(const Json& record, const std::string& pointer);
/// Milliseconds of a frame.
double time_of(const Json& record);
/// RMSE of `error` ("/error", "/error_common") as a share of the peak; 0 where the picture is exact, whose PSNR is null.
double share_of_peak(const Json& record, const std::string& error);
/// What the errors of these records are measured against.
std::string what_error(std::span<const Json* const> records, bool common);

}  // namespace amrtex
