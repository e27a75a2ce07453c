#include "bench/measure/sweep_estimate.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"

namespace amrtex {
namespace {

/// Sum and number of seconds that points took.
struct Mean {
  double sum = 0;
  int n = 0;
  void add(double seconds) {
    sum += seconds;
    ++n;
  }
};

double number_at(const Json& record, const char* place) {
  const Json& value = value_at(record, place);
  return value.is_number() ? value.get<double>() : 0;
}

/// What a record tells of its own time: build, upload, first frame, and frames with their warm-up.
double seconds_of(const Json& record) {
  const double frames = number_at(record, "/frame/wall_ms/n") + number_at(record, "/frame/warm_up");
  return number_at(record, "/build_seconds") + number_at(record, "/upload_seconds") +
         (number_at(record, "/first_frame_ms") + frames * number_at(record, "/frame/wall_ms/median")) / 1000;
}

}  // namespace

std::vector<Json> load_known(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "records.jsonl")) return {};
  return load_record_lines(folder).records;
}

SweepEstimate estimate(std::span<const ListedPoint> points, std::span<const Json> known, int repeat) {
  SweepEstimate e;
  Mean all;
  std::map<std::string, Mean> by_encoding;
  for (const Json& record : known) {
    if (record.at("status") != status_name(Status::ok)) continue;
    all.add(seconds_of(record));
    by_encoding[record.at("encoding")].add(seconds_of(record));
    e.largest_bytes = std::max(e.largest_bytes, static_cast<std::int64_t>(number_at(record, "/memory/total_bytes")));
  }
  std::set<std::string> structures;
  double seconds = 0;
  for (const ListedPoint& p : points) {
    Json build = p.settings;
    build.erase("render");
    structures.insert(build.dump());
    ++e.points;
    if (p.status != "open") continue;
    ++e.open;
    const auto own = by_encoding.find(p.settings.at("encoding").get<std::string>());
    const Mean& mean = own == by_encoding.end() ? all : own->second;
    if (mean.n > 0) seconds += mean.sum / mean.n * repeat;
  }
  e.structures = structures.size();
  if (all.n > 0) e.seconds = seconds;
  return e;
}

}  // namespace amrtex
