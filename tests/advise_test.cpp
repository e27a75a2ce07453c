// Advice: the search against made-up costs whose best point is known, and on a small mesh for real.
#include "bench/measure/advise.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include <algorithm>
#include <cmath>
#include <set>

#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;

/// Costs of one candidate.
struct Cost {
  double ms, error;
  std::int64_t bytes;
};

/// A structure's first bytes are those of its name and storage; errors fall with the square of the step, r8 adds 1/256.
Cost made_up(const Candidate& c) {
  const bool by_tolerance = c.settings.integrator == Integrator::tolerance;
  const bool preintegrated = c.settings.integrator == Integrator::preintegrated;
  const double step = by_tolerance ? 1.0 : c.settings.step;
  const double slowness = 1 + static_cast<double>(c.build.encoding.size()) + (c.build.filtering == Filtering::manual ? 2 : 0);
  const std::int64_t texel = c.build.storage == Storage::r8 ? 1 : c.build.storage == Storage::r16 ? 2 : 4;
  const double error = step * step / (preintegrated ? 400 : 100) + (c.build.storage == Storage::r8 ? 1.0 / 256 : 1e-5) +
                       (c.build.filter == Filter::linear_vertex ? 0 : 2e-3);
  return {slowness * (preintegrated ? 1.5 : 1) / step, error, 1000 * texel * static_cast<std::int64_t>(c.build.encoding.size())};
}

Json record_of(const Cost& cost, std::int64_t limit) {
  Json r = blank_record(cost.bytes <= limit ? Status::ok : Status::over_budget, cost.bytes <= limit ? "" : "too large");
  if (cost.bytes > limit) {
    r["needed_bytes"] = cost.bytes;
    return r;
  }
  r["memory"] = {{"total_bytes", cost.bytes}};
  r["frame"] = {{"wall_ms", {{"median", cost.ms}}}};
  r["error_common"] = {{"p95_seen", cost.error}, {"max", 3 * cost.error}};
  return r;
}

/// Measures by `made_up`; errors of full pictures are `unkind` times those of small ones.
Measure made_up_measure(const AdviceRequest& request, double unkind = 1) {
  return [limit = request.memory_limit, unkind](std::span<const Candidate> candidates, const Effort& effort) {
    std::vector<Json> records;
    for (const Candidate& c : candidates) {
      Cost cost = made_up(c);
      if (effort.width == Effort{}.width) cost.error *= unkind;
      records.push_back(record_of(cost, limit));
    }
    return records;
  };
}

void expect_best_of_measured(const Advice& advice, const AdviceRequest& request) {
  ASSERT_TRUE(advice.chosen);
  const MeasuredCandidate& best = advice.measured[*advice.chosen];
  EXPECT_LE(best.error, request.tolerance);
  EXPECT_LE(best.bytes, request.memory_limit);
  for (const MeasuredCandidate& m : advice.measured)
    EXPECT_FALSE(m.frame_ms < best.frame_ms && m.error <= request.tolerance && m.bytes <= request.memory_limit)
        << build_text(m.candidate.build) << " " << settings_text(m.candidate.settings);
}

TEST(Advice, IsTheFastestOfAllThatReachTheErrorWithinTheMemory) {
  for (const double tolerance : {0.2, 0.05, 0.01, 0.005})
    for (const std::int64_t limit : {std::int64_t{8000}, std::int64_t{20000}, std::numeric_limits<std::int64_t>::max()}) {
      AdviceRequest request;
      request.tolerance = tolerance;
      request.memory_limit = limit;
      SCOPED_TRACE(fmt::format("tolerance {}, limit {}", tolerance, limit));
      const Advice advice = advise(request, Effort{}, made_up_measure(request));
      expect_best_of_measured(advice, request);
      // the costs are known for all candidates, so the best of all is
      double least = std::numeric_limits<double>::infinity();
      for (const BuildPoint& build : candidate_builds(request))
        for (const RenderSettings& settings : candidate_settings(request))
          if (const Cost cost = made_up({build, settings}); cost.error <= tolerance && cost.bytes <= limit)
            least = std::min(least, cost.ms);
      EXPECT_DOUBLE_EQ(advice.measured[*advice.chosen].frame_ms, least);
    }
}

TEST(Advice, LooksForASmallerStepWhereSmallPicturesWereKind) {
  AdviceRequest request;
  for (const double unkind : {1.5, 3.0})
    expect_best_of_measured(advise(request, Effort{}, made_up_measure(request, unkind)), request);
}

TEST(Advice, TellsTheNearestWhereNothingReachesTheError) {
  AdviceRequest request;
  request.tolerance = 1e-6;
  const Advice advice = advise(request, Effort{}, made_up_measure(request));
  EXPECT_FALSE(advice.chosen);
  ASSERT_TRUE(advice.nearest);
  for (const MeasuredCandidate& m : advice.measured) EXPECT_LE(advice.measured[*advice.nearest].error, m.error);
}

/// What is advised where one filter has an error and all others another, and the filters that were measured for it.
struct FilteredAdvice {
  Advice advice;
  std::set<Filter> measured;
};

FilteredAdvice advise_with_filter_errors(const AdviceRequest& request, Filter good, double error, double of_others) {
  FilteredAdvice result;
  result.advice = advise(
      request, Effort{},
      [&](std::span<const Candidate> candidates, const Effort& effort) {
        for (const Candidate& c : candidates) result.measured.insert(c.build.filter);
        return made_up_measure(request)(candidates, effort);
      },
      [&](const BuildPoint& build, const Effort&) { return std::optional(build.filter == good ? error : of_others); });
  return result;
}

TEST(Advice, MeasuresNoFilterThatCannotReachTheError) {
  AdviceRequest request;
  const auto [advice, measured] = advise_with_filter_errors(request, Filter::linear_vertex, 0, 0.5);
  EXPECT_THAT(measured, testing::ElementsAre(Filter::linear_vertex));
  expect_best_of_measured(advice, request);
  EXPECT_EQ(advice.lost.size() + 1, candidate_builds(request).size());
  EXPECT_THAT(advice.lost, Contains(Field(&Loss::reason, HasSubstr("its filter does not reach the error at any step: 0.5"))));
}

TEST(Advice, GoesOnWithTheNearestFiltersWhereNoneReachesTheError) {
  AdviceRequest request;
  EXPECT_THAT(advise_with_filter_errors(request, Filter::basis, 0.2, 0.5).measured, testing::ElementsAre(Filter::basis));
}

// One encoding misses the tolerance at any step of the midpoint rule and reaches it pre-integrated, where it is the fastest of
// all.
TEST(Advice, FindsAStructureThatOnlyPreintegrationMakesExact) {
  AdviceRequest request;
  const std::string sharp = candidate_builds(request).front().encoding;
  const Measure measure = made_up_measure(request);
  const Advice advice = advise(request, Effort{}, [&](std::span<const Candidate> candidates, const Effort& effort) {
    std::vector<Json> records = measure(candidates, effort);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (candidates[i].build.encoding != sharp || !records[i]["frame"].is_object()) continue;
      const bool preintegrated = candidates[i].settings.integrator == Integrator::preintegrated;
      records[i]["error_common"]["p95_seen"] = preintegrated ? 0.0 : 0.5;
      records[i]["frame"]["wall_ms"]["median"] = 1e-3;
    }
    return records;
  });
  ASSERT_TRUE(advice.chosen);
  EXPECT_EQ(advice.measured[*advice.chosen].candidate.build.encoding, sharp);
}

TEST(Advice, TriesALevelOfDetailBesideTheWhole) {
  AdviceRequest request;
  const std::size_t whole = candidate_settings(request).size();
  request.level_of_detail = 2;
  const std::vector<RenderSettings> all = candidate_settings(request);
  EXPECT_EQ(all.size(), 2 * whole);
  std::set<std::string> texts;
  for (const RenderSettings& settings : all) texts.insert(settings_text(settings));
  EXPECT_EQ(texts.size(), all.size());
  std::set<std::string> drawn;
  advise(request, Effort{}, [&](std::span<const Candidate> candidates, const Effort& effort) {
    for (const Candidate& c : candidates)
      if (c.settings.level_of_detail) drawn.insert(c.build.encoding);
    return made_up_measure(request)(candidates, effort);
  });
  for (const std::string& name : drawn) EXPECT_TRUE(find_encoding(name).level_of_detail().ok) << name;
  EXPECT_FALSE(drawn.empty());
}

TEST(Advice, TellsTheSmallestStructureWhereNothingFits) {
  AdviceRequest request;
  request.memory_limit = 100;
  const Advice advice = advise(request, Effort{}, made_up_measure(request));
  EXPECT_FALSE(advice.chosen);
  EXPECT_FALSE(advice.nearest);
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (const BuildPoint& build : candidate_builds(request)) least = std::min(least, made_up({build, {}}).bytes);
  EXPECT_EQ(advice.smallest_bytes, least);
  int refused = 0;
  for (const Refusal& r : advice.refused) refused += r.count;
  // one filtering of each is enough to know its bytes
  request.filterings = {Filtering::hardware};
  EXPECT_EQ(refused, static_cast<int>(candidate_builds(request).size()));
  EXPECT_THAT(advice.refused, Contains(Field(&Refusal::reason, HasSubstr("x the memory limit"))));
}

TEST(Advice, HasAReasonForEveryStructureThatItDoesNotName) {
  AdviceRequest request;
  const Advice advice = advise(request, Effort{}, made_up_measure(request));
  EXPECT_EQ(advice.lost.size() + 1, candidate_builds(request).size());
  for (const Loss& loss : advice.lost) EXPECT_THAT(loss.reason, testing::Not(IsEmpty()));
  EXPECT_THAT(advice.lost, Contains(Field(&Loss::reason, HasSubstr("slower"))));
}

TEST(Advice, RefusesWhatIsNoToleranceAndFiltersThatNobodyHas) {
  for (const double tolerance : {0.0, -1.0, 1.5, std::nan("")}) {
    AdviceRequest request;
    request.tolerance = tolerance;
    EXPECT_THROW(advise(request, Effort{}, made_up_measure(request)), UsageError) << tolerance;
  }
  AdviceRequest request;
  request.filters = {};
  EXPECT_THROW(candidate_builds(request), UsageError);
}

TEST(Candidates, AreThoseThatEncodingsAnnounceEachOnce) {
  const std::vector<BuildPoint> builds = candidate_builds({});
  std::set<std::string> texts;
  for (const BuildPoint& b : builds) {
    EXPECT_TRUE(texts.insert(build_text(b)).second) << build_text(b);
    EXPECT_EQ(b.parameters, complete_parameters(find_encoding(b.encoding), b.parameters));
  }
  for (const Encoding* encoding : all_encodings())
    for (const ParameterInfo& p : encoding->parameters())
      for (const Json& value : p.compared)
        EXPECT_TRUE(
            std::any_of(builds.begin(), builds.end(),
                        [&](const BuildPoint& b) { return b.encoding == encoding->name() && b.parameters.at(p.name) == value; }))
            << encoding->name() << " " << p.name << " " << value;
}

TEST(Candidates, CompareTheDefaultWithOtherAcceptedValues) {
  for (const Encoding* encoding : all_encodings())
    for (const ParameterInfo& p : encoding->parameters()) {
      if (p.compared.empty()) continue;
      EXPECT_THAT(p.compared, Contains(p.default_value)) << encoding->name() << " " << p.name;
      for (const Json& value : p.compared) EXPECT_NO_THROW(complete_parameters(*encoding, {{p.name, value}}));
    }
}

TEST(Candidates, MakeScenesThatCanBeRead) {
  const Json scene =
      Json::parse(R"({"datasets": [{"generate": {"field": "shell", "levels": 2}}], "encodings": [{"name": "uniform"}],
    "render": {"width": 64}, "views": {"eye": [3, 2, 1], "at": [0.5, 0.5, 0.5]},
    "transfer_function": {"extinction": [[0, 0], [1, 9]], "color": [[0, 0, 0, 1]]}})");
  AdviceRequest request;
  request.tolerance = 0.125;
  request.level_of_detail = 1.5;
  for (const RenderSettings& settings : candidate_settings(request)) {
    const Candidate candidate{candidate_builds(request).back(), settings};
    const Experiment read = parse_scene(scene_with(scene, candidate).dump(), "scene");
    EXPECT_EQ(build_text(read.builds.front()), build_text(candidate.build));
    EXPECT_EQ(settings_text(read.renders.front().settings), settings_text(settings));
    EXPECT_EQ(read.renders.front().settings.width, 64);
  }
}

TEST(Advice, IsGoodOnASmallMeshThatIsReallyMeasured) {
  std::string name = (fs::temp_directory_path() / "amrtex_advise_test_XXXXXX").string();
  ASSERT_NE(mkdtemp(name.data()), nullptr);
  const Experiment scene = parse_experiment(R"({"name": "advise",
    "datasets": [{"generate": {"field": "blobs", "levels": 2, "root": 16, "patch": 8}}], "encodings": [{"name": "uniform"}],
    "render": {"mode": "dvr"}, "views": {"eye": [2.2, 1.8, 1.5], "at": [0.5, 0.5, 0.5]},
    "transfer_function": {"extinction": [[0.05, 0], [0.8, 10]], "color": [[0, 0, 0, 0.3], [0.6, 0.9, 0.9, 0.9]]}})",
                                            "scene");
  AdviceRequest request;
  request.storages = {Storage::r32f};
  request.filterings = {Filtering::manual};
  request.filters = {Filter::linear_lod};  // few structures, so that the test is quick
  request.reference = Filter::linear_lod;
  RunOptions options;
  options.folder = name;
  const Effort full{96, 96, 1, 0};
  const Advice advice =
      advise(request, full, measure_by_running(scene, request, options), filter_error_by_reference(scene, request, options));
  expect_best_of_measured(advice, request);
  EXPECT_EQ(load_records(name).front().at("experiment"), "advise");

  // asked again with less than the smallest takes: nothing, and its size
  ASSERT_GT(advice.smallest_bytes, 1);
  request.memory_limit = advice.smallest_bytes - 1;
  const Advice none = advise(request, full, measure_by_running(scene, request, options));
  EXPECT_FALSE(none.chosen);
  EXPECT_EQ(none.smallest_bytes, advice.smallest_bytes);
  fs::remove_all(name);
}

}  // namespace
}  // namespace amrtex
