// What the picture of a point has to reach before its time counts. This is the one place where the default is stated.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bench/numbers/image_error.hpp"
#include "bench/settings/experiment.hpp"

namespace amrtex {

/// A cause of error that a correct picture may have, and how much of it: RMSE in parts of the picture's peak.
struct Allowance {
  std::string cause;
  double rmse = 0;
};

/// The default bound of a point, cause by cause. It is their sum, since no cause may hide behind another.
std::vector<Allowance> default_allowances(const BuildPoint& build, const RenderSettings& settings);

/// The least PSNR that goes with an RMSE of this sum.
double psnr_of(std::span<const Allowance> allowances);

struct PictureCheck {
  std::optional<double> psnr_db;  ///< against the picture of the own reference; absent: nothing can be asked, or nothing is
  std::string from;               ///< "default" or "experiment", where there is a bound
  std::string why;                ///< where the bound comes from, or why there is none; empty where an experiment does not say
};

PictureCheck check_of(const Experiment& experiment, const BuildPoint& build, const RenderSettings& settings);

/// A picture without a bound passes; so does one that differs from its reference by rounding to float alone, whatever its range.
bool passes(const PictureCheck& check, const ErrorMetrics& error, const Picture& reference);

}  // namespace amrtex
