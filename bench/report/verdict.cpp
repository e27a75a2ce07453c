#include "bench/report/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace amrtex {
namespace {

const Json& at(const Json& record, const char* place) {
  static const Json none;
  const Json::json_pointer pointer(place);
  return record.contains(pointer) ? record.at(pointer) : none;
}

double number(const Json& record, const char* place) {
  const Json& value = at(record, place);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

/// Infinite for a picture without any error; not a number where it was not judged.
double psnr_of(const Json& record) {
  for (const char* error : {"/error_common", "/error"}) {
    const Json& e = at(record, error);
    if (!e.is_object() || !e.contains("rmse") || !e["rmse"].is_number()) continue;
    if (e["rmse"] == 0) return std::numeric_limits<double>::infinity();
    return number(e, "/psnr_db");
  }
  return std::numeric_limits<double>::quiet_NaN();
}

std::string text_of(const Json& record) {
  const auto word = [&](const char* place) {
    const Json& value = at(record, place);
    return value.is_string() ? value.get<std::string>() : value.dump();
  };
  const double psnr = psnr_of(record), ms = number(record, "/frame/wall_ms/median");
  std::string text = fmt::format("{} ({}, {}, step {}): {:.2f} MiB", word("/encoding"), word("/filter"), word("/storage"),
                                 word("/render/step"), number(record, "/memory/total_bytes") / 1048576);
  if (ms > 0) text += fmt::format(", {:.3g} ms", ms);
  if (psnr > 0) text += fmt::format(", {:.1f} dB", psnr);
  return text;
}

/// The record of the list that has the least of a number; null where none has it.
template <class Number>
const Json* least(const std::vector<const Json*>& list, Number&& of) {
  const Json* best = nullptr;
  for (const Json* record : list)
    if (of(*record) == of(*record) && (best == nullptr || of(*record) < of(*best))) best = record;
  return best;
}

}  // namespace

std::string verdict(const std::vector<Json>& records, double psnr_db) {
  std::vector<const Json*> drawn, good;
  for (const Json& record : records)
    if (at(record, "/status") == "ok") {
      drawn.push_back(&record);
      if (psnr_of(record) >= psnr_db) good.push_back(&record);
    }
  const auto bytes = [](const Json& r) { return number(r, "/memory/total_bytes"); };
  const auto ms = [](const Json& r) { return number(r, "/frame/wall_ms/median"); };
  const Json* smallest = least(drawn, bytes);
  if (smallest == nullptr) return "nothing was drawn";
  std::string text = "smallest: " + text_of(*smallest);
  if (const Json* fastest = least(good, ms)) return text + fmt::format("; fastest at >= {:g} dB: {}", psnr_db, text_of(*fastest));
  const Json* best = least(drawn, [](const Json& r) { return -psnr_of(r); });
  return text + (best != nullptr ? fmt::format("; none reaches {:g} dB, the nearest is {}", psnr_db, text_of(*best))
                                 : std::string("; errors were not measured"));
}

}  // namespace amrtex
