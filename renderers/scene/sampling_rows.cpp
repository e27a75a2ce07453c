// Keys of `render` that say how a picture is drawn.
#include "renderers/scene/scene_names.hpp"
#include "renderers/scene/scene_rows.hpp"
#include "renderers/scene/scene_settings.hpp"

namespace amrtex::scene_rows {
namespace {

constexpr int kMaxPictureEdge = 16384;
constexpr int kMostLevel = 63;

}  // namespace

Rows consumer_rows() {
  Rows rows;
  rows.push_back(
      {{.name = "consumer",
        .type = choice_type(texts_of(kConsumerNames)),
        .reference = AffectsReference::no,
        .help = "who draws ([renderers/README.md](../renderers/README.md)); the last three draw box by box",
        .column = {"consumer"},
        .takes = {{"mode", {"dvr", "projection", "mip"}, Otherwise::unsupported, "a surface between two boxes needs both sides"},
                  {"integrator", {"exponential_midpoint"}, Otherwise::unsupported, "others carry samples from box to box"}}},
       [](const Scene& s) -> Json { return consumer_name(s.settings.consumer); },
       [](Scene& s, const Json& v) { s.settings.consumer = parse_consumer(v.get<std::string>()); }});
  rows.push_back({{.name = "slice_target",
                   .type = choice_type(texts_of(kSliceTargetNames)),
                   .reference = AffectsReference::no,
                   .help = "what slices, whose distance is `step`, are blended in; `rgba8` is a historical control",
                   .recorded = Recorded::where_it_applies,
                   .column = {"slice target"},
                   .takes = {means_nothing_unless("consumer", {"slices", "stencil_slices"}),
                             {"mode", {"dvr"}, Otherwise::unsupported, "eight bits hold colours and no values"}}},
                  [](const Scene& s) -> Json { return slice_target_name(s.settings.slice_target); },
                  [](Scene& s, const Json& v) { s.settings.slice_target = parse_slice_target(v.get<std::string>()); }});
  rows.push_back({{.name = "dispatch",
                   .type = choice_type(texts_of(kDispatchNames)),
                   .reference = AffectsReference::no,
                   .help = "how rays are started: by fragments, or by a compute shader in tiles of 8 x 8 pixels; one picture either way",
                   .recorded = Recorded::where_given,
                   .column = {.label = "dispatch", .only_where_given = true},
                   .takes = {means_nothing_unless("consumer", {"raycast"})}},
                  [](const Scene& s) -> Json { return dispatch_name(s.settings.dispatch); },
                  [](Scene& s, const Json& v) { s.settings.dispatch = parse_dispatch(v.get<std::string>()); }});
  return rows;
}

Rows sampling_rows() {
  Rows rows;
  const std::vector<Json> with_step{"exponential_midpoint", "euler", "left", "preintegrated"};
  ValueType integrators = choice_type(texts_of(kIntegratorNames));
  integrators.aliases = {{std::string(kMidpointName), "exponential_midpoint"}};
  rows.push_back(
      {{.name = "mode",
        .type = choice_type(texts_of(kModeNames)),
        .reference = AffectsReference::yes,
        .help = "`dvr`: emission and absorption; `projection`: line integral; `mip`: maximum; `iso`: isosurfaces; `dvr_iso`: "
                "isosurfaces in the volume",
        .column = {"mode"}},
       [](const Scene& s) -> Json { return mode_name(s.settings.mode); },
       [](Scene& s, const Json& v) { s.settings.mode = parse_mode(v.get<std::string>()); }});
  rows.push_back({{.name = "sampling",
                   .type = choice_type(texts_of(kSamplingNames)),
                   .reference = AffectsReference::no,
                   .help = "where samples lie ([docs/sampling.md](sampling.md))",
                   .column = {"sampling"},
                   .takes = {{"mode", {"dvr", "projection"}, Otherwise::refused, "others have no error that a step leaves", {"planned"}},
                             {"consumer", {"raycast"}, Otherwise::unsupported, "steps are planned along a whole ray", {"planned"}},
                             {"integrator", {"exponential_midpoint"}, Otherwise::refused, "its errors are those that are planned", {"planned"}}}},
                  [](const Scene& s) -> Json { return sampling_name(s.settings.sampling); },
                  [](Scene& s, const Json& v) { s.settings.sampling = parse_sampling(v.get<std::string>()); }});
  rows.push_back(
      {{.name = "step",
        .type = number_above(0),
        .reference = AffectsReference::no,
        .help = "distance of samples: of the finest level's cells (`lattice`) or of the region's (`adaptive`), smallest edge",
        .unit = "cell widths",
        .column = {"step (cells)", true},
        .takes = {means_nothing_unless("integrator", with_step), means_nothing_unless("sampling", {"lattice", "adaptive"})}},
       [](const Scene& s) -> Json { return s.settings.step; },
       [](Scene& s, const Json& v) { s.settings.step = v.get<double>(); }});
  rows.push_back(
      {{.name = "budget",
        .type = number_above(0, 1),
        .reference = AffectsReference::no,
        .help = "what a ray's intervals may add to the error of a channel, by the sum of their estimates: in channels (`dvr`) or in parts of "
                "the field's range times the domain's longest edge (`projection`)",
        .recorded = Recorded::where_it_applies,
        .column = {"budget", true},
        .takes = {means_nothing_unless("sampling", {"planned"})}},
       [](const Scene& s) -> Json { return s.settings.budget; },
       [](Scene& s, const Json& v) { s.settings.budget = v.get<double>(); }});
  rows.push_back(
      {{.name = "tolerance",
        .type = number_above(0, 1),
        .reference = AffectsReference::no,
        .help = "error asked of every channel of a pixel; stands for the integrator `tolerance` where none is given, which takes "
                "every filter but `nearest`",
        .recorded = Recorded::where_it_applies,
        .column = {"tolerance", true},
        .takes = {means_nothing_unless("integrator", {"tolerance"})},
        .stands_for = {"integrator", "tolerance"}},
       [](const Scene& s) -> Json { return s.settings.tolerance; },
       [](Scene& s, const Json& v) { s.settings.tolerance = v.get<double>(); }});
  rows.push_back({{.name = "integrator",
                   .type = integrators,
                   .reference = AffectsReference::no,
                   .help = "how light follows from samples ([docs/integrators.md](integrators.md))",
                   .column = {"integrator"},
                   .takes = {only_with("mode", {"dvr"}, "all but exponential_midpoint integrate a volume alone"),
                             {"sampling", {"adaptive"}, Otherwise::refused, "it chooses its intervals itself", {"tolerance"}}}},
                  [](const Scene& s) -> Json { return integrator_name(s.settings.integrator); },
                  [](Scene& s, const Json& v) { s.settings.integrator = parse_integrator(v.get<std::string>()); }});
  return rows;
}

Rows picture_rows() {
  Rows rows;
  rows.push_back({{.name = "width",
                   .type = integer_type(1, kMaxPictureEdge),
                   .reference = AffectsReference::yes,
                   .help = "of the picture",
                   .unit = "pixels"},
                  [](const Scene& s) -> Json { return s.settings.width; },
                  [](Scene& s, const Json& v) { s.settings.width = v.get<int>(); }});
  rows.push_back({{.name = "height",
                   .type = integer_type(1, kMaxPictureEdge),
                   .reference = AffectsReference::yes,
                   .help = "of the picture",
                   .unit = "pixels"},
                  [](const Scene& s) -> Json { return s.settings.height; },
                  [](Scene& s, const Json& v) { s.settings.height = v.get<int>(); }});
  rows.push_back({{.name = "skip",
                   .type = boolean_type(),
                   .reference = AffectsReference::no,
                   .help = "regions whose value range is invisible are skipped",
                   .column = {"skip"}},
                  [](const Scene& s) -> Json { return s.settings.skip; },
                  [](Scene& s, const Json& v) { s.settings.skip = v.get<bool>(); }});
  rows.push_back(
      {{.name = "leap",
        .type = choice_type(texts_of(kLeapNames)),
        .reference = AffectsReference::no,
        .help =
            "hidden regions are passed many at a time by a map of distances ([docs/sampling.md](sampling.md#skipping)), in modes "
            "`dvr` and `projection`: `cube` one map, `octant` one for each octant of directions",
        .column = {"leap"},
        .takes = {means_nothing_unless("skip", {true})}},
       [](const Scene& s) -> Json { return leap_name(s.settings.leap); },
       [](Scene& s, const Json& v) { s.settings.leap = parse_leap(v.get<std::string>()); }});
  rows.push_back({{.name = "level_of_detail",
                   .type = number_above(0).or_null(),
                   .reference = AffectsReference::no,
                   .help = "cells that are refined are drawn themselves where they are smaller on the picture",
                   .unit = "pixels",
                   .recorded = Recorded::where_given,
                   .column = {"level of detail (pixels)", true},
                   .takes = {drawn_by({"raycast"}, "boxes are those of leaves")},
                   .capability = Capability::level_of_detail},
                  [](const Scene& s) -> Json { return or_null(s.settings.level_of_detail); },
                  [](Scene& s, const Json& v) { s.settings.level_of_detail = optional_of<double>(v); }});
  rows.push_back({{.name = "max_level",
                   .type = integer_type(0, kMostLevel).or_null(),
                   .reference = AffectsReference::no,
                   .help = "nothing finer is drawn where a cell of this level or a coarser one lies",
                   .recorded = Recorded::where_given,
                   .column = {"max level", true},
                   .takes = {drawn_by({"raycast"}, "boxes are those of leaves")},
                   .capability = Capability::level_of_detail},
                  [](const Scene& s) -> Json { return or_null(s.settings.max_level); },
                  [](Scene& s, const Json& v) { s.settings.max_level = optional_of<int>(v); }});
  return rows;
}

Rows structure_rows() {
  Rows rows;
  rows.push_back(
      {{.name = "needs",
        .type = choice_type({"scene", "all"}),
        .reference = AffectsReference::no,
        .help = "`scene`: structures hold what the scene needs; `all`: validity bits, value ranges, borders and gradients though "
                "nothing reads them, to see what leaving out saves",
        .column = {"needs"}},
       [](const Scene& s) -> Json { return s.settings.everything ? "all" : "scene"; },
       [](Scene& s, const Json& v) { s.settings.everything = v == "all"; }});
  rows.push_back(
      {{.name = "prune",
        .type = boolean_type(),
        .reference = AffectsReference::no,
        .help =
            "what the transfer function hides is not built: pages of `page_table`, nodes of `octree`, leaves and bricks of "
            "`kd_tree`; one transfer function in the whole experiment. Such a structure refuses to be drawn where anything of "
            "what was left out would show. `--prune` for `amrtex render`",
        .column = {"prune"},
        .takes = {only_with("mode", {"dvr"}, "elsewhere the transfer function hides nothing for good"),
                  only_with("needs", {"scene"}, "'needs' all keeps what pruning leaves out"),
                  not_with("level_of_detail", nullptr, "'level_of_detail' draws cells that pruning knows nothing of"),
                  not_with("max_level", nullptr, "'max_level' draws cells that pruning knows nothing of"),
                  only_with("integrator", {"exponential_midpoint", "euler", "left"},
                            "others join hidden values to visible ones")},
        .capability = Capability::pruning},
       [](const Scene& s) -> Json { return s.settings.prune; },
       [](Scene& s, const Json& v) { s.settings.prune = v.get<bool>(); }});
  rows.push_back({{.name = "early_end",
                   .type = number_type(0, 1).or_null(),
                   .reference = AffectsReference::no,
                   .help = "opacity at which a ray ends",
                   .column = {"early end (opacity)", true},
                   .takes = {means_nothing_unless("mode", {"dvr", "dvr_iso"}), means_nothing_unless("output", {"color"}),
                             drawn_by({"raycast"}, "a box's shader does not know what was drawn before it")}},
                  [](const Scene& s) -> Json { return or_null(s.settings.early_end); },
                  [](Scene& s, const Json& v) { s.settings.early_end = optional_of<double>(v); }});
  return rows;
}

}  // namespace amrtex::scene_rows
