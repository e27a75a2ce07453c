// What the records of one scene come to: which is the smallest, which the fastest that is exact enough, and what each costs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/report/scenes.hpp"

namespace amrtex {

/// Errors that answers are asked for, as PSNR.
inline constexpr double kAskedDecibels[] = {40, 50, 60};

/// One answer.
struct Answer {
  std::string asked;                  ///< "smallest", "40 dB"
  std::optional<std::size_t> record;  ///< of the scene's; nothing where none is like that
  std::string setting;                ///< what tells the record from the others of the scene
  std::string cost;                   ///< bytes, milliseconds, decibels
};

struct SceneFacts {
  bool common = true;                               ///< which error
  std::vector<std::string> settings;                ///< of each record: what tells it from the others
  std::vector<Answer> answers;                      ///< smallest first, then the errors
  std::string smallest, fastest;                    ///< a sentence each
  std::vector<std::size_t> time_front, byte_front;  ///< no other record is as cheap and as exact
};

/// "/error_common" or "/error".
std::string error_pointer(bool common);
/// Of a record that is there to be compared: PSNR in dB, infinite where the picture is exact; not a number where it was not
/// judged.
double decibels_of(const Json& record, bool common);
/// What tells each record from the others, by the columns of the tables. Where nothing does, its encoding.
std::vector<std::string> setting_texts(const std::vector<const Json*>& records);

SceneFacts facts_of(const ComparedScene& scene, bool common);

}  // namespace amrtex
