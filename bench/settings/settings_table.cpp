#include "bench/settings/settings_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <limits>

#include "bench/settings/orbit.hpp"
#include "renderers/scene/scene_names.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr std::int64_t kMaxFrames = 1000000;
constexpr double kHighestPsnr = 1000;
constexpr std::int64_t kMostInteger = std::numeric_limits<std::int64_t>::max();

template <class Values, class Name>
std::vector<std::string> names_of_all(const Values& values, Name&& name) {
  std::vector<std::string> names;
  for (const auto value : values) names.emplace_back(name(value));
  return names;
}

std::vector<std::string> filter_names() { return names_of_all(all_filters(), filter_name); }

std::vector<std::string> storage_names() {
  return names_of_all(std::array{Storage::r8, Storage::r16, Storage::r16f, Storage::r32f}, format_name);
}

// --- the top level ---

/// A key that is true or false.
template <bool Experiment::*member>
Setting<Experiment> flag(std::string name, std::string help) {
  return {{.name = std::move(name), .type = boolean_type(), .reference = AffectsReference::no, .help = std::move(help)},
          [](const Experiment& e) -> Json { return e.*member; },
          [](Experiment& e, const Json& v) { e.*member = v.get<bool>(); }};
}

std::vector<Key> check_members() {
  return {{.name = "psnr_db",
           .type = number_type(0, kHighestPsnr),
           .reference = AffectsReference::no,
           .help = "the least that is accepted",
           .unit = "dB"},
          {.name = "why", .type = text_type(), .reference = AffectsReference::no, .help = "where `psnr_db` comes from"},
          {.name = "off", .type = text_type(), .reference = AffectsReference::no, .help = "why pictures are not checked"}};
}

Json check_json(const Experiment& e) {
  if (e.unchecked_because) return {{"off", *e.unchecked_because}};
  if (!e.minimum_psnr_db) return nullptr;
  Json check = {{"psnr_db", *e.minimum_psnr_db}};
  if (!e.check_why.empty()) check["why"] = e.check_why;
  return check;
}

void set_check(Experiment& e, const Json& v) {
  e.minimum_psnr_db.reset();
  e.unchecked_because.reset();
  e.check_why.clear();
  if (v.is_null()) return;
  if (v.contains("psnr_db")) e.minimum_psnr_db = v["psnr_db"].get<double>();
  if (v.contains("why")) e.check_why = v["why"].get<std::string>();
  if (v.contains("off")) e.unchecked_because = v["off"].get<std::string>();
}

SettingTable<Experiment> make_experiment_settings() {
  std::vector<Setting<Experiment>> rows;
  rows.push_back({{.name = "name",
                   .type = text_type(),
                   .reference = AffectsReference::no,
                   .help = "not empty; stands in records and tables",
                   .default_text = "required; a scene's: its file name",
                   .label = true},
                  [](const Experiment& e) -> Json { return e.name; },
                  [](Experiment& e, const Json& v) { e.name = v.get<std::string>(); }});
  rows.push_back(
      {{.name = "check",
        .type = object_type(check_members()).or_null(),
        .reference = AffectsReference::no,
        .help = "a picture that is worse against its own reference has failed and gets no time. `null`: the bound that its "
                "filter, storage, sampling, step and integrator let expect "
                "([bench/README.md](../bench/README.md#check)); a bound of your own; or `off`, with the reason",
        .default_text = "`null`: the default bound"},
       check_json,
       set_check});
  rows.push_back(flag<&Experiment::baseline>(
      "baseline", "time the data set's first build, with the first render settings, before and after every point"));
  rows.push_back(flag<&Experiment::explain_error>(
      "explain_error",
      "records hold the error by cause ([bench/README.md](../bench/README.md#error-by-cause)), for two more builds and "
      "up to eight more pictures a point; a table of it joins the others"));
  rows.push_back(flag<&Experiment::explain_left_out>(
      "explain_left_out",
      "entries of `left_out` hold the seconds that building the part would have taken "
      "([bench/README.md](../bench/README.md#parts-left-out)), for seven more builds a part"));
  rows.push_back(flag<&Experiment::time_change>("time_change",
                                                "records hold the time of a change of transfer function or isovalues (`change`, "
                                                "[bench/README.md](../bench/README.md#times))"));
  rows.push_back(
      {{.name = "memory_limit",
        .type = integer_type(1, kMostInteger).or_null(),
        .reference = AffectsReference::no,
        .help = "of the textures and buffers of one build. `--memory-limit 512MiB` overrides it",
        .unit = "bytes"},
       [](const Experiment& e) { return e.memory_limit ? Json(*e.memory_limit) : Json(); },
       [](Experiment& e, const Json& v) { e.memory_limit = v.is_null() ? std::nullopt : std::optional(v.get<std::int64_t>()); }});
  rows.push_back({{.name = "context",
                   .type = choice_type({"egl", "egl_device", "osmesa"}),
                   .reference = AffectsReference::no,
                   .help = "how GL is reached. `--context` overrides it, and `--device` says which one of EGL's devices"},
                  [](const Experiment& e) -> Json { return e.context.substr(0, e.context.find(':')); },
                  [](Experiment& e, const Json& v) { e.context = v.get<std::string>(); }});
  rows.push_back({{.name = "seed",
                   .type = integer_type(0, kMostInteger),
                   .reference = AffectsReference::no,
                   .help = "of the order in which points are measured, and of `ray_offset`"},
                  [](const Experiment& e) -> Json { return e.seed; },
                  [](Experiment& e, const Json& v) { e.seed = v.get<std::uint64_t>(); }});
  return {"top", std::move(rows)};
}

SettingTable<RenderPoint> make_frame_settings() {
  std::vector<Setting<RenderPoint>> rows;
  rows.push_back({{.name = "frames", .type = integer_type(1, kMaxFrames), .reference = AffectsReference::no, .help = "measured"},
                  [](const RenderPoint& r) -> Json { return r.frames; },
                  [](RenderPoint& r, const Json& v) { r.frames = v.get<int>(); }});
  rows.push_back({{.name = "warm_up",
                   .type = integer_type(0, kMaxFrames),
                   .reference = AffectsReference::no,
                   .help = "frames before them, not measured"},
                  [](const RenderPoint& r) -> Json { return r.warm_up; },
                  [](RenderPoint& r, const Json& v) { r.warm_up = v.get<int>(); }});
  return {"top", std::move(rows)};
}

SettingTable<BuildPoint> make_build_settings() {
  std::vector<Setting<BuildPoint>> rows;
  rows.push_back({{.name = "filters",
                   .type = choice_type(filter_names()),
                   .reference = AffectsReference::yes,
                   .help = "the field between cell values ([docs/filters.md](filters.md)). One that an encoding lacks "
                           "gives a record `unsupported`",
                   .record_name = "filter",
                   .column = {"filter"}},
                  [](const BuildPoint& b) -> Json { return filter_name(b.filter); },
                  [](BuildPoint& b, const Json& v) { b.filter = parse_filter(v.get<std::string>()); }});
  rows.push_back({{.name = "storage",
                   .type = choice_type(storage_names()),
                   .reference = AffectsReference::no,
                   .help = "format of stored values",
                   .column = {"storage"}},
                  [](const BuildPoint& b) -> Json { return format_name(b.storage); },
                  [](BuildPoint& b, const Json& v) { b.storage = parse_storage(v.get<std::string>()); }});
  rows.push_back(
      {{.name = "filtering",
        .type = choice_type({std::string(filtering_name(Filtering::hardware)), std::string(filtering_name(Filtering::manual))}),
        .reference = AffectsReference::no,
        .help = "who interpolates; the filter `nearest` is always `manual`",
        .column = {"filtering"}},
       [](const BuildPoint& b) -> Json { return filtering_name(b.filtering); },
       [](BuildPoint& b, const Json& v) { b.filtering = parse_filtering(v.get<std::string>()); }});
  return {"encodings", std::move(rows)};
}

SettingTable<ReferenceSettings> make_reference_settings() {
  std::vector<std::string> filters = {"own"};
  for (const std::string& name : filter_names()) filters.push_back(name);
  std::vector<Setting<ReferenceSettings>> rows;
  rows.push_back(
      {{.name = "tolerance",
        .type = number_type(ReferenceTolerance::kLeast, 1),
        .reference = AffectsReference::yes,
        .help = fmt::format("largest error of the reference in `dvr` and `dvr_iso`, of full scale: rays are integrated until "
                            "their own estimate is below it. That of `projection` and `mip` is {} of the integral of |f| "
                            "and of the largest |f| along the ray",
                            Json(kLineTolerance).dump()),
        .takes = {{"step", {nullptr}, Otherwise::idle}}},
       [](const ReferenceSettings& r) -> Json { return r.tolerance; },
       [](ReferenceSettings& r, const Json& v) { r.tolerance = v.get<double>(); }});
  rows.push_back(
      {{.name = "step",
        .type = number_above(0).or_null(),
        .reference = AffectsReference::yes,
        .help = "in place of `tolerance`, to compare with: parts of at most this length, of an error that is not known",
        .unit = "cell widths",
        .default_text = "by `tolerance`"},
       [](const ReferenceSettings& r) { return r.step ? Json(*r.step) : Json(); },
       [](ReferenceSettings& r, const Json& v) { r.step = v.is_null() ? std::nullopt : std::optional(v.get<double>()); }});
  rows.push_back(
      {{.name = "filter",
        .type = choice_type(filters),
        .reference = AffectsReference::yes,
        .help = "of `error_common`; `own` leaves that out. `linear_page` is one page of the finest level, the dense field"},
       [](const ReferenceSettings& r) -> Json { return r.common_filter ? filter_name(*r.common_filter) : "own"; },
       [](ReferenceSettings& r, const Json& v) {
         r.common_filter = v == "own" ? std::nullopt : std::optional(parse_filter(v.get<std::string>()));
       }});
  rows.push_back(
      {{.name = "own",
        .type = boolean_type(),
        .reference = AffectsReference::no,
        .help = "`false`: no `error`, which takes a reference for every filter and page size; `check`, `explain_error` need it"},
       [](const ReferenceSettings& r) -> Json { return r.own; },
       [](ReferenceSettings& r, const Json& v) { r.own = v.get<bool>(); },
       [](const ReferenceSettings& r) -> std::string {
         if (r.own || r.common_filter) return "";
         return "without the own reference and with 'filter' own there is no reference; accepted: true, or another 'filter'";
       }});
  rows.push_back(
      {{.name = "shading",
        .type = choice_type(texts_of(kShadingNames)).or_null(),
        .reference = AffectsReference::yes,
        .help =
            "the normals that isosurfaces are judged by, as in `render`. With one for all, several shadings compete; not with "
            "`explain_error`",
        .default_text = "the picture's"},
       [](const ReferenceSettings& r) { return r.shading ? Json(shading_name(*r.shading)) : Json(); },
       [](ReferenceSettings& r, const Json& v) {
         r.shading = v.is_null() ? std::nullopt : std::optional(parse_shading(v.get<std::string>()));
       }});
  return {"reference", std::move(rows)};
}

// --- keys that hold others ---

std::vector<Key> make_structure_keys() {
  const auto section = [](std::string name, std::string help, AffectsReference reference, bool required) {
    return Key{
        .name = std::move(name), .type = object_type({}), .reference = reference, .help = std::move(help), .required = required};
  };
  return {section("datasets", "what is read or generated, [see below](#datasets)", AffectsReference::yes, true),
          section("encodings", "what is built, [see below](#encodings)", AffectsReference::no, true),
          Key{.name = "render",
              .type = object_type({}),
              .reference = AffectsReference::yes,
              .help = "how pictures are drawn, [see below](#render)",
              .default_text = "`{}`"},
          section("views", "cameras, [see below](#views)", AffectsReference::yes, true),
          Key{.name = "transfer_function",
              .type = object_type({}),
              .reference = AffectsReference::yes,
              .help = "what a volume looks like, [see below](#transfer_function)",
              .default_text = "required where a volume is drawn"},
          Key{.name = "reference",
              .type = object_type({}).or_null(),
              .reference = AffectsReference::yes,
              .help = "what pictures are judged by, [see below](#reference); `null` leaves errors out (timing runs)",
              .default_text = "`{}`"}};
}

std::vector<Key> make_dataset_keys() {
  return {{.name = "file",
           .type = text_type(),
           .reference = AffectsReference::yes,
           .help = "a data set; a relative path is looked for beside the experiment file, then in the current folder",
           .default_text = "this or `generate`"},
          {.name = "field",
           .type = text_type().or_null(),
           .reference = AffectsReference::yes,
           .help = "a field of the file",
           .default_text = "the first"},
          {.name = "generate",
           .type = object_type({}),
           .reference = AffectsReference::yes,
           .help = "a specification, [generate.md](generate.md)",
           .default_text = "this or `file`"},
          {.name = "name",
           .type = text_type(),
           .reference = AffectsReference::no,
           .help = "for tables",
           .default_text = "the file's name, or the field's type with the values along axes",
           .label = true}};
}

/// Keys of a specification whose values are lists; all others have none.
std::vector<Key> make_generate_keys() {
  std::vector<Key> keys;
  for (const char* name : {"root", "ratio", "skip_levels", "more_fields"})
    keys.push_back(
        {.name = name, .type = list_of(text_type(), 0, "a list, see generate.md"), .reference = AffectsReference::yes});
  return keys;
}

Key name_key(std::string default_text) {
  return {.name = "name",
          .type = text_type(),
          .reference = AffectsReference::no,
          .help = "for tables",
          .default_text = std::move(default_text),
          .label = true};
}

std::vector<Key> make_other_keys() {
  return {{.name = "name", .type = text_type(), .reference = AffectsReference::no, .help = "an encoding", .required = true},
          name_key("`view 1`, …; of the views of an orbit `name_00`, …"),
          name_key("`transfer function 1`, …"),
          {.name = "orbit",
           .type = object_type({}),
           .reference = AffectsReference::yes,
           .help = "in place of `eye`, `at` and `up`: a camera that goes once around a place, see below",
           .default_text = "none"}};
}

std::vector<const Key*> pointers(const std::vector<Key>& keys) {
  std::vector<const Key*> all;
  for (const Key& key : keys) all.push_back(&key);
  return all;
}

void append(std::vector<const Key*>& keys, const std::vector<const Key*>& more) {
  keys.insert(keys.end(), more.begin(), more.end());
}

/// `more` goes behind the key called `after`.
void insert_after(std::vector<const Key*>& keys, std::string_view after, const std::vector<const Key*>& more) {
  const auto place = std::find_if(keys.begin(), keys.end(), [&](const Key* key) { return key->name == after; });
  keys.insert(place + 1, more.begin(), more.end());
}

std::vector<Section> make_sections() {
  static const std::vector<Key> structure = make_structure_keys(), datasets = make_dataset_keys(),
                                generate = make_generate_keys(), other = make_other_keys();
  std::vector<const Key*> render, top_of_scene;
  for (const Key* key : scene_settings().keys()) (is_top_level(*key) ? top_of_scene : render).push_back(key);
  std::vector<const Key*> top = experiment_settings().keys();
  insert_after(top, "name", pointers(structure));
  insert_after(top, "encodings", build_settings().keys());
  insert_after(top, "transfer_function", frame_settings().keys());
  insert_after(top, "transfer_function", {top_of_scene.front()});
  append(top, {top_of_scene.begin() + 1, top_of_scene.end()});
  std::vector<const Key*> encodings = {&other[0]}, views = view_settings().keys(), function = transfer_function_settings().keys();
  append(encodings, build_settings().keys());
  append(views, {&other[3], &other[1]});
  append(function, {&other[2]});
  return {{"top", "", top},
          {"datasets", "datasets", pointers(datasets)},
          {"generate", "datasets.generate", pointers(generate)},
          {"encodings", "encodings", encodings},
          {"render", "render", render},
          {"views", "views", views},
          {"orbit", "views.orbit", orbit_keys()},
          {"transfer_function", "transfer_function", function},
          {"reference", "reference", reference_settings().keys()}};
}

}  // namespace

const SettingTable<Experiment>& experiment_settings() {
  static const SettingTable<Experiment> settings = make_experiment_settings();
  return settings;
}

const SettingTable<RenderPoint>& frame_settings() {
  static const SettingTable<RenderPoint> settings = make_frame_settings();
  return settings;
}

const SettingTable<BuildPoint>& build_settings() {
  static const SettingTable<BuildPoint> settings = make_build_settings();
  return settings;
}

const SettingTable<ReferenceSettings>& reference_settings() {
  static const SettingTable<ReferenceSettings> settings = make_reference_settings();
  return settings;
}

std::span<const Section> all_sections() {
  static const std::vector<Section> sections = make_sections();
  return sections;
}

const Section& section_of(std::string_view name) {
  for (const Section& section : all_sections())
    if (section.name == name) return section;
  std::vector<std::string> names;
  for (const Section& section : all_sections()) names.push_back(section.name);
  throw UsageError(fmt::format("no section {}; accepted: {}", quote(name), fmt::join(names, ", ")));
}

std::vector<std::string_view> names_of(std::span<const Key* const> keys) {
  std::vector<std::string_view> names;
  for (const Key* key : keys) names.push_back(key->name);
  return names;
}

}  // namespace amrtex
