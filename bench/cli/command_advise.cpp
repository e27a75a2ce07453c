#include <fmt/format.h>
#include <fmt/ranges.h>
#include <stdlib.h>  // mkdtemp
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <set>

#include "bench/cli/commands.hpp"
#include "bench/cli/context_arguments.hpp"
#include "bench/measure/advise.hpp"
#include "bench/records/record.hpp"
#include "bench/settings/default_scene.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr double kMebibyte = 1048576.0;
constexpr std::size_t kRunnersUp = 8;  ///< told in print; --json has all

struct Arguments {
  std::string data, field, memory_limit, transfer_function, view, keep, scene, reference = "linear_vertex";
  ContextArguments context;
  std::vector<std::string> filters, storages, filterings;
  double tolerance = 1e-2;
  int width = 512, height = 512, frames = 5;
  std::optional<double> level_of_detail;
  bool json = false;
};

/// Removed with all that lies in it, unless the user named it.
class Folder {
 public:
  explicit Folder(const std::string& kept) : path_(kept), temporary_(kept.empty()) {
    if (!temporary_) return;
    std::string name = (fs::temp_directory_path() / "amrtex_advise_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw Error(fmt::format("{}: no temporary folder can be made; name one by --keep", name));
    path_ = name;
  }
  ~Folder() {
    std::error_code ignored;
    if (temporary_) fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
  bool temporary_;
};

/// A file that cannot be read is bad usage here: there is nothing to advise on.
AmrHierarchy read_data(const Arguments& a) {
  try {
    return AmrHierarchy(read_mesh(a.data, FieldChoice::one(a.field)));
  } catch (const BudgetError&) {
    throw;
  } catch (const Error& e) {
    throw UsageError(e.what());
  }
}

/// As `amrtex render` draws the data set.
Json default_transfer_function(const AmrHierarchy& mesh, const SceneRequest& request) {
  const FieldStatistics& range = mesh.statistics(0);
  if (!(range.max > range.min))
    throw UsageError(fmt::format("{}: the field {} is {} everywhere; accepted: a field with a range, or --transfer-function",
                                 clipped(mesh.name()), clipped(mesh.fields().front()), range.min));
  return to_json(default_transfer(mesh, request));
}

/// The scene as a file would say it, but for what is sought.
Json scene_json(const Arguments& a, const AmrHierarchy& mesh) {
  const std::string file = fs::absolute(a.data).lexically_normal().string();
  if (!is_utf8(file)) throw UsageError(fmt::format("{}: a path that is not UTF-8 cannot stand in a scene", clipped(file)));
  Json dataset = {{"file", file}, {"field", mesh.fields().front()}};
  SceneRequest request;
  request.width = a.width;
  request.height = a.height;
  return {{"name", "advise"},
          {"datasets", Json::array({dataset})},
          {"encodings", Json::array({{{"name", all_encodings().front()->name()}}})},
          {"render", {{"mode", "dvr"}, {"sampling", "adaptive"}, {"width", a.width}, {"height", a.height}}},
          {"views", a.view.empty() ? to_json(default_view(mesh, request)) : read_json_argument(a.view, "--view")},
          {"transfer_function", a.transfer_function.empty() ? default_transfer_function(mesh, request)
                                                            : read_json_argument(a.transfer_function, "--transfer-function")}};
}

template <class T>
void choose(std::vector<T>& list, const std::vector<std::string>& names, T (*parse)(std::string_view)) {
  if (names.empty()) return;
  list.clear();
  for (const std::string& name : names) list.push_back(parse(name));
}

AdviceRequest request_of(const Arguments& a) {
  AdviceRequest request;
  if (!(a.tolerance > 0 && a.tolerance <= 1))
    throw UsageError(fmt::format("--tolerance {}: accepted: a number in (0, 1], the largest error of a channel", a.tolerance));
  request.tolerance = a.tolerance;
  if (!a.memory_limit.empty()) request.memory_limit = parse_bytes(a.memory_limit);
  if (request.memory_limit < 1) throw UsageError(fmt::format("--memory-limit {}: accepted: at least one byte", a.memory_limit));
  choose(request.filters, a.filters, parse_filter);
  choose(request.storages, a.storages, parse_storage);
  choose(request.filterings, a.filterings, parse_filtering);
  request.level_of_detail = a.level_of_detail;
  if (a.reference == "own")
    request.reference.reset();
  else
    request.reference = parse_filter(a.reference);
  return request;
}

double mebibytes(std::int64_t bytes) { return static_cast<double>(bytes) / kMebibyte; }

// --- what is told ---

Json measured_json(const MeasuredCandidate& m) {
  const BuildPoint& b = m.candidate.build;
  const RenderSettings& s = m.candidate.settings;
  const bool by_tolerance = s.integrator == Integrator::tolerance;
  return {{"encoding", b.encoding},
          {"build_parameters", b.parameters},
          {"filter", filter_name(b.filter)},
          {"storage", format_name(b.storage)},
          {"filtering", filtering_name(b.filtering)},
          {"integrator", integrator_name(s.integrator)},
          {"step", by_tolerance ? Json() : Json(s.step)},
          {"tolerance", by_tolerance ? Json(s.tolerance) : Json()},
          {"level_of_detail", s.level_of_detail ? Json(*s.level_of_detail) : Json()},
          {"frame_ms", m.frame_ms},
          {"bytes", m.bytes},
          {"p95", m.error},
          {"max", m.max_error}};
}

Json advice_json(const Arguments& a, const AdviceRequest& request, const Advice& advice, const Json& scene) {
  const bool limited = request.memory_limit != std::numeric_limits<std::int64_t>::max();
  Json json = {{"tolerance", request.tolerance},
               {"memory_limit", limited ? Json(request.memory_limit) : Json()},
               {"reference", a.reference},
               {"advice", nullptr},
               {"nearest", nullptr},
               {"scene", nullptr},
               {"measured", Json::array()},
               {"lost", Json::array()},
               {"refused", Json::array()},
               {"smallest_bytes", advice.smallest_bytes > 0 ? Json(advice.smallest_bytes) : Json()}};
  if (advice.chosen) {
    json["advice"] = measured_json(advice.measured[*advice.chosen]);
    json["scene"] = scene_with(scene, advice.measured[*advice.chosen].candidate);
  }
  if (advice.nearest) json["nearest"] = measured_json(advice.measured[*advice.nearest]);
  for (const MeasuredCandidate& m : advice.measured) json["measured"].push_back(measured_json(m));
  for (const Loss& loss : advice.lost) json["lost"].push_back({{"structure", build_text(loss.build)}, {"reason", loss.reason}});
  for (const Refusal& r : advice.refused)
    json["refused"].push_back({{"encoding", r.encoding}, {"status", r.status}, {"reason", r.reason}, {"count", r.count}});
  return json;
}

void print_measured(const char* title, const MeasuredCandidate& m) {
  fmt::print("{}\n  structure  {}\n  steps      {}\n  memory     {:.2f} MiB\n  frame      {:.1f} ms\n", title,
             build_text(m.candidate.build), settings_text(m.candidate.settings), mebibytes(m.bytes), m.frame_ms);
  fmt::print("  error      {:.2g} is not exceeded by 95 % of the pixels that see something, {:.2g} by none\n", m.error,
             m.max_error);
}

/// The best of each encoding and filter that lost.
std::vector<const Loss*> runners_up(const Advice& advice) {
  std::vector<const Loss*> list;
  std::set<std::pair<std::string, Filter>> seen;
  for (const Loss& loss : advice.lost)
    if (list.size() < kRunnersUp && seen.insert({loss.build.encoding, loss.build.filter}).second) list.push_back(&loss);
  return list;
}

void print_others(const Advice& advice) {
  const std::vector<const Loss*> best = runners_up(advice);
  if (!best.empty())
    fmt::print("\nNot taken, the best of each encoding and filter ({} structures in all):\n", advice.lost.size());
  for (const Loss* loss : best) fmt::print("  {}: {}\n", build_text(loss->build), loss->reason);
  if (!advice.refused.empty()) fmt::print("\nNot possible:\n");
  for (const Refusal& r : advice.refused) fmt::print("  {} x {} {}: {}\n", r.count, r.encoding, r.status, r.reason);
}

/// One line that says how far the goal is.
std::string why_none(const AdviceRequest& request, const Advice& advice) {
  if (advice.nearest) {
    const MeasuredCandidate& m = advice.measured[*advice.nearest];
    return fmt::format("nothing reaches the error {:g} for 95 % of the pixels that see something; the nearest has {:.2g}: {}, {}",
                       request.tolerance, m.error, build_text(m.candidate.build), settings_text(m.candidate.settings));
  }
  if (advice.smallest_bytes > request.memory_limit)
    return fmt::format("nothing fits into {} bytes; the smallest structure needs {} ({:.2f} MiB)", request.memory_limit,
                       advice.smallest_bytes, mebibytes(advice.smallest_bytes));
  return "no structure could be measured";
}

void check_scene_name(const std::string& scene) {
  if (fs::path(scene).extension() != ".json")
    throw UsageError(fmt::format("--scene {}: accepted: a name ending in .json", clipped(scene)));
  if (const std::string reason = why_absent(fs::absolute(scene).parent_path()); !reason.empty())
    throw UsageError(
        fmt::format("--scene {}: its folder: {}; accepted: a file in a folder that is there", clipped(scene), reason));
}

int run(const Arguments& a) {
  const AdviceRequest request = request_of(a);
  RunOptions options;
  options.context = a.context.choice("egl");
  if (!a.scene.empty()) check_scene_name(a.scene);
  const AmrHierarchy mesh = read_data(a);
  const Json scene = scene_json(a, mesh);
  const Experiment experiment = parse_experiment(scene.dump(1), "advise");
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const auto progress = [terminal](const std::string& text) {
    if (terminal) fmt::print(stderr, "{}\n", printable(text));
  };
  const Folder folder(a.keep);
  options.folder = folder.path();
  const Effort full{a.width, a.height, a.frames, 1};
  const Advice advice = advise(request, full, measure_by_running(experiment, request, options),
                               filter_error_by_reference(experiment, request, options), progress);

  if (a.json) fmt::print("{}\n", advice_json(a, request, advice, scene).dump(2));
  if (!advice.chosen) {
    if (!a.json) print_others(advice);
    fmt::print(stderr, "amrtex: {}\n", one_line(why_none(request, advice), 390));
    return 1;
  }
  const MeasuredCandidate& best = advice.measured[*advice.chosen];
  const std::string text = scene_with(scene, best.candidate).dump(2) + "\n";
  if (!a.scene.empty()) write_atomically(a.scene, text);
  if (a.json) return 0;
  print_measured("Take", best);
  const std::string limit = a.memory_limit.empty() ? "" : fmt::format(" and {:.2f} MiB", mebibytes(request.memory_limit));
  fmt::print("\nThe fastest within the error {:g}{}, of {} pictures. Errors are against the reference of {}.\n",
             request.tolerance, limit, advice.pictures, a.reference == "own" ? "the own filter" : a.reference);
  print_others(advice);
  if (a.scene.empty())
    fmt::print("\nScene, for `amrtex render` (--scene FILE writes it):\n{}", text);
  else
    fmt::print("\nScene, for `amrtex render`: {}\n", a.scene);
  return 0;
}

}  // namespace

void add_advise_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("advise", "measures which encoding, filter, storage and step to take for a data set");
  c->add_option("data", a->data, "data set")->required();
  c->add_option("--field", a->field, "field to draw; the first otherwise");
  c->add_option("--tolerance", a->tolerance,
                "error of a channel that 95 % of the pixels that see something may not exceed, in (0, 1]; 0.01 otherwise");
  c->add_option("--memory-limit", a->memory_limit, "for the structure, as 512MiB");
  c->add_option("--filter", a->filters, "filters to try; the linear ones otherwise")->allow_extra_args(false)->delimiter(',');
  c->add_option("--storage", a->storages, "storages to try; r32f, r16, r8 otherwise")->allow_extra_args(false)->delimiter(',');
  c->add_option("--filtering", a->filterings, "hardware, manual; both otherwise")->allow_extra_args(false)->delimiter(',');
  c->add_option("--level-of-detail", a->level_of_detail,
                "pixels; cells that are smaller on the picture may be drawn as their coarser ones: tried as well")
      ->check(CLI::PositiveNumber);
  c->add_option("--reference", a->reference, "filter that pictures are held against; linear_vertex otherwise. own: each its own");
  c->add_option("--transfer-function", a->transfer_function,
                "JSON file or the JSON itself (docs/experiments.md); one that follows the field's histogram otherwise");
  c->add_option("--view", a->view, "JSON file or the JSON itself; the whole domain from a corner otherwise");
  c->add_option("--width", a->width, "pixels; 512 otherwise")->check(CLI::Range(1, 16384));
  c->add_option("--height", a->height, "pixels; 512 otherwise")->check(CLI::Range(1, 16384));
  c->add_option("--frames", a->frames, "timed frames of each of the last pictures; 5 otherwise")->check(CLI::Range(1, 1000));
  add_context_options(*c, a->context, "egl otherwise");
  c->add_option("--keep", a->keep, "folder for the records of all measurements; asked again it goes on from them");
  c->add_option("--scene", a->scene, "scene file to write, for `amrtex render`");
  c->add_flag("--json", a->json, "for programs");
  c->footer(
      "Example: amrtex advise data/amrex_tiny/plt00008 --tolerance 0.01 --memory-limit 1MiB --scene out/scene.json\n"
      "Exit code 1 where nothing reaches the tolerance within the limit.");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
