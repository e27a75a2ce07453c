// Measures points of one data set: build, upload, draw, check, time, describe. Knows nothing of files of records, nor of other processes.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bench/measure/built.hpp"
#include "bench/measure/description.hpp"
#include "bench/measure/frame_times.hpp"
#include "bench/measure/judgement.hpp"
#include "bench/measure/loaded_data.hpp"
#include "bench/measure/time_shares.hpp"

namespace amrtex {

/// A point of an experiment by the indices of its parts, and what it is called.
struct PlannedPoint {
  std::size_t build = 0;
  std::size_t render = 0;
  std::string configuration;  ///< names its record
  int structure = 0;          ///< points of one build and one number are drawn from one structure
};

/// What is done at the moment. A time-out counts the first two alone.
enum class Phase { building, drawing, other };

struct MeasuringOptions {
  std::filesystem::path folder;  ///< of pictures and references
  bool pictures = true;
  bool count_work = true;
  Json shader_cache;           ///< state of the folder of compiled shaders; null where it is the driver's
  std::string context = "egl";  ///< kind
  std::function<void(Phase)> phase = [](Phase) {};
};

class PointMeasurer {
 public:
  /// Reads the data set. `experiment` must outlive it. The GL context is made when the first point is measured.
  PointMeasurer(const Experiment& experiment, std::size_t dataset, MeasuringOptions options);

  std::size_t dataset() const { return data_.dataset(); }
  /// All points of the data set, by build.
  std::vector<PlannedPoint> plan();

  /// Draws the references of these points that are not there yet (judgement.hpp).
  void draw_references(const std::vector<PlannedPoint>& points);
  /// One record for each render point, handed on as soon as it is there. The points share one structure. Throws UsageError for what concerns
  /// the whole experiment, OutputError for the output folder; everything else is a record.
  void measure(std::size_t build, const std::vector<std::size_t>& renders, int repetition, const std::function<void(const Json&)>& done);
  /// The record of a point that failed elsewhere: a process that measured it has ended.
  Json failure(std::size_t build, std::size_t render, int repetition, std::string_view reason);

  TimeShares take_shares() { return std::exchange(shares_, {}); }

 private:
  Context& context();
  Json measure_one(const BuildPoint& build, Built& built, const RenderPoint& render, int repetition);
  Json failed(const BuildPoint& build, const RenderPoint& render, int repetition, const std::exception& error);
  void describe(Json& record, const BuildPoint& build, const RenderPoint& render, int repetition);
  std::unique_ptr<Built> build_for(const BuildPoint& build, const RenderPoint& render);
  void add_times(Json& record, const RenderPoint& render, Consumer& consumer);
  void add_change(Json& record, const Built& built, const Scene& scene);
  void keep_picture(const Json& record, const Picture& picture, const std::optional<Judgement>& own) const;
  void add_warnings(Json& record, const Scene& scene, const Consumer& consumer) const;
  bool equal_needs(const BuildPoint& build, const RenderPoint& a, const RenderPoint& b) const;

  const Experiment& experiment_;
  MeasuringOptions options_;
  TimeShares shares_;
  LoadedData data_;
  std::string implementation_;
  std::unique_ptr<Context> context_;
  std::unique_ptr<Baseline> baseline_;
};

}  // namespace amrtex
