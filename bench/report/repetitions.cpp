#include "bench/report/repetitions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"

namespace amrtex {
namespace {

std::string text_at(const Json& record, const char* pointer) {
  const Json& value = value_at(record, pointer);
  return value.is_string() ? value.get<std::string>() : "";
}

bool is_ok(const Json& record) { return text_at(record, "/status") == status_name(Status::ok); }

/// A value of each record; nothing where one lacks it.
std::optional<std::vector<double>> numbers(const Repetitions& point, const char* pointer) {
  std::vector<double> list;
  for (const Json* record : point) {
    const Json& value = value_at(*record, pointer);
    if (!value.is_number()) return std::nullopt;
    list.push_back(value.get<double>());
  }
  return list;
}

/// All are `ok`.
Json together(const Repetitions& point) {
  Json record = *point.front();
  for (const char* pointer : {"/build_seconds", "/upload_seconds", "/first_frame_ms", "/frame/relative"})
    if (const auto values = numbers(point, pointer)) record[Json::json_pointer(pointer)] = median(*values);
  if (const auto walls = numbers(point, "/frame/wall_ms/median")) {
    record["frame"]["wall_ms"] = timing_json(*walls);
    record["frame"]["all_wall_ms"] = *walls;
  }
  if (const auto gpu = numbers(point, "/frame/gpu_ms/median")) record["frame"]["gpu_ms"] = timing_json(*gpu);
  return record;
}

Json one_of(Repetitions point) {
  keep_last_program(point);
  if (point.size() == 1) return *point.front();
  const auto failed = std::find_if_not(point.begin(), point.end(), [](const Json* record) { return is_ok(*record); });
  if (failed == point.end()) return together(point);
  Json record = **failed;
  const auto count = std::count_if(point.begin(), point.end(), [](const Json* each) { return !is_ok(*each); });
  if (count < static_cast<std::ptrdiff_t>(point.size()))
    record["reason"] = fmt::format("in {} of {} repetitions: {}", count, point.size(), text_at(record, "/reason"));
  return record;
}

}  // namespace

std::size_t keep_last_program(Repetitions& point) {
  const Json* last = point.front();
  for (const Json* record : point)
    if (text_at(*record, "/context/date") >= text_at(*last, "/context/date")) last = record;
  const Json program = value_at(*last, "/implementation");
  return std::erase_if(point, [&](const Json* record) { return value_at(*record, "/implementation") != program; });
}

const Json& representative(const Repetitions& point) {
  const auto ok = std::find_if(point.begin(), point.end(), [](const Json* record) { return is_ok(*record); });
  return ok == point.end() ? *point.front() : **ok;
}

std::vector<Json> one_a_point(std::span<const Json> records) {
  std::map<std::pair<std::string, std::string>, std::size_t> places;
  std::vector<Repetitions> points;
  for (const Json& record : records) {
    const RecordKey key = key_of(record);
    const auto [place, added] = places.try_emplace({key.configuration, key.context}, points.size());
    if (added) points.emplace_back();
    points[place->second].push_back(&record);
  }
  std::vector<Json> ones;
  for (const Repetitions& point : points) ones.push_back(one_of(point));
  return ones;
}

}  // namespace amrtex
