#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>

#include "bench/cli/commands.hpp"
#include "renderers/cpu/structure_view.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "structures/mesh/error.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

struct Arguments {
  std::string data, field, encoding, filter;
  std::string storage = "r32f", sampling = "adaptive";
  std::vector<std::string> parameters;
  std::vector<double> ray;
  double step = 1;
  bool json = false, texels = false;
};

/// What the command shows, from one build.
struct Shown {
  AmrHierarchy mesh;
  EncodedField field;
  std::vector<FieldRegion> regions;
  std::optional<std::vector<SamplePlace>> samples;  ///< where a ray was asked for
};

WorldRay parse_ray(const std::vector<double>& numbers) {
  const Vec3d direction(numbers[3], numbers[4], numbers[5]);
  const double length = glm::length(direction);
  if (!(length > 0) || !std::isfinite(length))
    throw UsageError(fmt::format("--ray: direction ({}, {}, {}); accepted: three finite numbers, not all 0", direction.x,
                                 direction.y, direction.z));
  return {{numbers[0], numbers[1], numbers[2]}, direction / length};
}

Shown build(const Arguments& a) {
  const Encoding& encoding = find_encoding(a.encoding);
  BuildRequest request;
  request.needs = {parse_filter(a.filter), Filtering::manual, true};
  request.storage = parse_storage(a.storage);
  request.parameters = complete_parameters(encoding, parse_parameters(a.parameters));
  const Sampling sampling = parse_sampling(a.sampling);
  if (!(a.step > 0) || !std::isfinite(a.step))
    throw UsageError(fmt::format("--step {}; accepted: a number above 0, in cell widths", a.step));
  AmrHierarchy mesh(read_mesh(a.data, FieldChoice::one(a.field)));
  EncodedField field = encoding.build(mesh, request);
  std::vector<FieldRegion> regions = list_regions(mesh, field);
  std::optional<std::vector<SamplePlace>> samples;
  if (!a.ray.empty()) {
    const HierarchyReference reference(mesh, request.field, field.definition);
    const FieldValues values = [&](const FinestPosition& p, int) { return reference.sample(p); };
    samples = list_samples(mesh, field, values, parse_ray(a.ray), sampling, a.step);
  }
  return {std::move(mesh), std::move(field), std::move(regions), std::move(samples)};
}

Json json_of(const Vec3i& v) { return {v.x, v.y, v.z}; }

Json json_of(const MemoryByRole& m) {
  return {{"payload", m.payload}, {"duplicated", m.duplicated}, {"topology", m.topology}, {"padding", m.padding}};
}

Json patches_json(const AmrHierarchy& mesh) {
  Json list = Json::array();
  for (int l = 0; l < mesh.level_count(); ++l)
    for (const Patch& p : mesh.patches(l)) {
      const Box finest = p.box.refined(mesh.cell_width(l));
      list.push_back({{"level", l}, {"lower", json_of(finest.lower)}, {"upper", json_of(finest.upper)}});
    }
  return list;
}

Json regions_json(const std::vector<FieldRegion>& regions) {
  Json list = Json::array();
  for (const FieldRegion& r : regions)
    list.push_back(
        {{"level", r.level}, {"lower", json_of(r.cells.lower)}, {"upper", json_of(r.cells.upper)}, {"holds_mesh", r.holds_mesh}});
  return list;
}

Json texture_json(const EncodedField& field, const HostTexture& t, bool texels) {
  Json json = {{"name", t.name},     {"format", format_name(t.format)}, {"size", json_of(t.size)},
               {"bytes", t.bytes()}, {"roles", json_of(t.roles)},       {"holds_values", t.holds_values}};
  if (!texels || !t.holds_values) return json;
  Json& values = json["values"] = Json::array();
  for (std::int64_t i = 0; i < t.texels(); ++i)
    values.push_back(load_value(t.format, field.scale, t.data.data(), static_cast<std::size_t>(i)));
  return json;
}

Json shown_json(const Shown& s, const Arguments& a) {
  Json json = {{"encoding", s.field.encoding},
               {"filter", a.filter},
               {"build_parameters", s.field.build_parameters},
               {"finest_cells", json_of(s.mesh.cells(s.mesh.finest_level()))},
               {"leaf_cells", s.mesh.leaf_cells()},
               {"memory", json_of(s.field.memory())},
               {"statistics", s.field.statistics},
               {"patches", patches_json(s.mesh)},
               {"regions", regions_json(s.regions)}};
  for (const HostTexture& t : s.field.textures) json["textures"].push_back(texture_json(s.field, t, a.texels));
  if (!s.samples) return json;
  json["samples"] = Json::array();
  for (const SamplePlace& p : *s.samples)
    json["samples"].push_back(
        {{"p", {p.position.x, p.position.y, p.position.z}}, {"value", p.value ? Json(*p.value) : Json(nullptr)}});
  return json;
}

void print_shown(const Shown& s) {
  std::map<int, std::int64_t> by_level;
  std::int64_t vacant = 0;
  for (const FieldRegion& r : s.regions) r.holds_mesh ? ++by_level[r.level] : ++vacant;
  fmt::print("{} {}\n\n  level   regions\n", s.field.encoding, s.field.build_parameters.dump());
  for (const auto& [level, count] : by_level) fmt::print("  {:5}  {:8}\n", level, count);
  if (vacant > 0) fmt::print("   none  {:8}  without mesh\n", vacant);
  fmt::print("\n  {:24} {:>9} {:>16} {:>12} {:>12} {:>12} {:>12}\n", "texture or buffer", "format", "size", "payload",
             "duplicated", "topology", "padding");
  for (const HostTexture& t : s.field.textures)
    fmt::print("  {:24} {:>9} {:>16} {:12} {:12} {:12} {:12}\n", t.name, format_name(t.format),
               fmt::format("{}x{}x{}", t.size.x, t.size.y, t.size.z), t.roles.payload, t.roles.duplicated, t.roles.topology,
               t.roles.padding);
  if (!s.samples) return;
  fmt::print("\n  {:>12} {:>12} {:>12} {:>16}\n", "x", "y", "z", "value");
  for (const SamplePlace& p : *s.samples)
    fmt::print("  {:12.6g} {:12.6g} {:12.6g} {:>16}\n", p.position.x, p.position.y, p.position.z,
               p.value ? fmt::format("{:.9g}", *p.value) : "-");
}

int run(const Arguments& a) {
  const Shown shown = build(a);
  if (a.json)
    fmt::print("{}\n", shown_json(shown, a).dump());
  else
    print_shown(shown);
  return 0;
}

}  // namespace

void add_structure_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c =
      app.add_subcommand("structure", "what an encoding makes of a mesh: regions, textures, and the samples of one ray");
  c->add_option("data", a->data, "data set")->required();
  c->add_option("--field", a->field, "field (default: the first)");
  c->add_option("--encoding", a->encoding, "see `amrtex encodings`")->required();
  c->add_option("--filter", a->filter, "nearest, linear_page, ...")->required();
  c->add_option("--parameter", a->parameters, "build parameter NAME=VALUE; may be repeated");
  c->add_option("--storage", a->storage, "r8, r16, r16f, r32f");
  c->add_option("--ray", a->ray, "X Y Z DX DY DZ: also where the march samples this ray; world units")->expected(6);
  c->add_option("--sampling", a->sampling, "of the ray: lattice or adaptive");
  c->add_option("--step", a->step, "of the ray: cell widths, of the finest level (lattice) or of each region (adaptive)");
  c->add_flag("--texels", a->texels, "with --json: the values in the textures too");
  c->add_flag("--json", a->json, "for programs");
  c->footer(
      "Example: amrtex structure data/amrex_tiny/plt00008 --encoding page_table --filter linear_page --parameter page_size=8");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
