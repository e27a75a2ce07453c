// What a sweep comes to, in one sentence.
#pragma once

#include <string>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// Where pictures cannot be told apart by eye.
inline constexpr double kGoodPsnr = 50;

/// "smallest: …; fastest at >= 50 dB: …": of the records with status ok; errors against the common reference where there is one.
/// Says so where none is that good, or where none is there.
std::string verdict(const std::vector<Json>& records, double psnr_db = kGoodPsnr);

}  // namespace amrtex
