// Experiment files: what is built, what is drawn of it, and how it is measured.
// Every value given as a list is an axis; builds and render points are apart, and one
// build serves all render points. A scene file is an experiment without axes.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "renderers/scene/reference_rule.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

/// Either a file or a generator specification.
struct DatasetSource {
  std::string name;                           ///< for tables; "blobs_shell levels=4" where it was not given
  std::optional<std::filesystem::path> file;  ///< exists
  std::optional<std::string> field;           ///< absent = the first field
  Json generate;                              ///< null where a file is read
  std::string written;                        ///< the file's path as the experiment has it
};

/// One structure to build.
struct BuildPoint {
  std::size_t dataset = 0;  ///< index into Experiment::datasets
  std::string encoding;
  Json parameters;  ///< complete, defaults filled in
  Filter filter = Filter::nearest;
  Storage storage = Storage::r32f;
  Filtering filtering = Filtering::hardware;  ///< always manual for nearest, which filters nothing
};

/// One picture of every structure.
struct RenderPoint {
  RenderSettings settings;
  View view;
  std::string view_name;                   ///< as given, or "view 2": its place in the list
  TransferFunction transfer_function;      ///< without points where the mode has no use for it
  std::string transfer_function_name;      ///< empty where the mode has no use for it
  std::vector<FieldTransfer> more_fields;  ///< `transfer_functions` behind the first: drawn in the same volume
  int frames = 9;                          ///< measured
  int warm_up = 2;                         ///< drawn before them, not measured
};

/// What pictures are judged by. `error` is always against a point's own filter.
struct ReferenceSettings {
  double tolerance = ReferenceTolerance{}.value;  ///< of full scale, in dvr and dvr_iso
  std::optional<double> step{};                   ///< in its place: a fixed one, widths of the finest cells
  /// Filter of `error_common`; absent ("own" in the file) leaves that out. `linear_page`
  /// stands for one page of the finest level, the dense field.
  std::optional<Filter> common_filter = Filter::linear_vertex;
  bool own = true;                   ///< false: no `error`, which takes a reference of its own for each filter and page size
  std::optional<Shading> shading{};  ///< normals that isosurfaces are judged by; absent: those of the picture's own `shading`

  ReferenceRule rule() const { return step ? ReferenceRule(*step) : ReferenceRule(ReferenceTolerance{tolerance}); }
};

struct Experiment {
  std::string name;
  std::filesystem::path file;
  std::vector<DatasetSource> datasets;
  std::vector<BuildPoint> builds;                                    ///< by dataset, then in the order of the file; no two alike
  std::vector<RenderPoint> renders;                                  ///< in the order of the file; no two alike
  std::optional<ReferenceSettings> reference = ReferenceSettings{};  ///< absent: errors are left out
  std::uint64_t seed = 1;                                            ///< of the order in which points are measured
  std::string context = "egl";                                       ///< egl, egl_device or osmesa; from the command line egl_device:N as well
  std::optional<std::int64_t> memory_limit;                          ///< bytes of the textures and buffers of one build
  std::optional<double> minimum_psnr_db;         ///< against a point's own reference; absent: the default (check_bound.hpp)
  std::string check_why;                         ///< where minimum_psnr_db comes from, if the file says so
  std::optional<std::string> unchecked_because;  ///< pictures are not checked, and why
  std::optional<std::array<Vec3d, 2>> region;    ///< scene files: sub-box to draw, world
  /// The data set's first build, drawn with the first render settings, is timed before and
  /// after every point, so that times are ratios inside one run.
  bool baseline = false;
  bool explain_error =
      false;  ///< records hold the error by cause, for several more pictures a point (bench/measure/error_split.hpp)
  bool explain_left_out =
      false;  ///< records hold what each part left out would have cost to build (bench/measure/left_out_time.hpp)
  bool time_change =
      false;  ///< records hold the time of a change of transfer function or isovalues (bench/measure/change_time.hpp)
  std::vector<std::string> axes;  ///< places in the file whose list has more than one value

  std::size_t points() const { return builds.size() * renders.size(); }
};

/// How a file is read.
struct ReadOptions {
  std::vector<std::string> set = {};      ///< "render.step=0.5": values that replace those of the file (docs/experiments.md)
  std::uint64_t most_points = 1'000'000;  ///< a file with more is refused before any of them is made
  /// The caller has the mesh: `datasets` may be left out, and of what it says only `field` counts. The data set has no source then.
  bool holds_data = false;
};

/// Throw UsageErrors that name file, line and key and what is accepted there, and Error
/// when the file cannot be read. Relative data paths are looked for in the folder of the
/// file, then in the current one.
Experiment read_experiment(const std::filesystem::path& path, const ReadOptions& options = {});
Experiment parse_experiment(std::string text, const std::filesystem::path& path, const ReadOptions& options = {});

/// An experiment of one point; a UsageError names the axes that a scene cannot have.
Experiment read_scene(const std::filesystem::path& path, const ReadOptions& options = {});
Experiment parse_scene(std::string text, const std::filesystem::path& path, const ReadOptions& options = {});

/// The scene of one render point.
Scene scene_of(const Experiment& experiment, const RenderPoint& render);

/// The `render` part of a record, names of view and transfer function included.
Json render_json(const RenderPoint& render);

/// An experiment file of this point alone: `parse_experiment` makes the same point of it. The data set's path is relative to the folder that the
/// program runs in, where it lies below that.
Json point_experiment(const Experiment& experiment, const BuildPoint& build, const RenderPoint& render);

/// Everything that decides what a point measures, for `configuration_hash`; keys at their default are left out, so that a key
/// that is added later renames no record. `dataset_hash` is that of the mesh as loaded.
Json point_configuration(const Experiment& experiment, const BuildPoint& build, const RenderPoint& render,
                         std::string_view dataset_hash);

}  // namespace amrtex
