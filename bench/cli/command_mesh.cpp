#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "bench/cli/commands.hpp"
#include "bench/settings/json_file.hpp"
#include "bench/settings/value_histogram.hpp"
#include "structures/common/encoding.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// What is told of a field; its values are not kept.
struct FieldInfo {
  std::string name;
  FieldStatistics statistics;
  std::string hash;
  std::string unit;
  ShownRange range;
  ValueHistogram histogram;
};

constexpr int kBins = 16, kLineBins = 48, kWidth = 78;

FieldInfo field_info(const AmrHierarchy& mesh, int field, int bins) {
  const ShownRange range = shown_range(mesh, field);
  return {mesh.fields()[static_cast<std::size_t>(field)],
          mesh.statistics(field),
          mesh.content_hash(field),
          mesh.unit(field),
          range,
          value_histogram(mesh, field, range.lower, range.upper, range.logarithmic, bins)};
}

/// Of the field that is named, or of all. One after the other is read, so that memory has to hold one of them.
std::vector<FieldInfo> field_infos(const std::string& path, const std::string& field, const AmrHierarchy& first) {
  const bool one = !field.empty() || first.fields_there().size() == 1;
  std::vector<FieldInfo> infos = {field_info(first, 0, one ? kBins : kLineBins)};
  for (std::size_t i = 1; i < first.fields_there().size() && !one; ++i) {
    const AmrHierarchy mesh(read_mesh(path, {first.fields_there()[i]}));
    infos.push_back(field_info(mesh, 0, kLineBins));
  }
  return infos;
}

Json info_json(const AmrHierarchy& mesh, const std::vector<FieldInfo>& fields) {
  Json json;
  json["name"] = mesh.name();
  for (int l = 0; l < mesh.level_count(); ++l)
    json["levels"].push_back({{"level", l},
                              {"patches", mesh.patches(l).size()},
                              {"cells", mesh.stored_cells(l)},
                              {"leaf_cells", mesh.leaf_cells(l)},
                              {"ratio_to_finer", mesh.ratio_to_finer(l)}});
  json["leaf_cells"] = mesh.leaf_cells();
  const Vec3d lower = mesh.domain_lower();
  const Vec3d upper = mesh.domain_upper();
  const Vec3i finest = mesh.cells(mesh.finest_level());
  json["domain"] = {{"lower", {lower.x, lower.y, lower.z}}, {"upper", {upper.x, upper.y, upper.z}}};
  json["finest_cells"] = {finest.x, finest.y, finest.z};
  json["holes"] = mesh.has_holes();
  json["periodic"] = mesh.periodic();
  json["dimensions"] = mesh.dimensions();
  for (const FieldInfo& field : fields) {
    const FieldStatistics& s = field.statistics;
    json["fields"].push_back({{"name", field.name},
                              {"min", s.min},
                              {"max", s.max},
                              {"volume_integral", s.volume_integral},
                              {"cells_without_value", s.cells_without_value},
                              {"unit", field.unit.empty() ? Json() : Json(field.unit)},
                              {"hash", field.hash}});
  }
  json["hash"] = fields.front().hash;
  return json;
}

/// Of the longest name of a field, in columns.
std::size_t name_width(const std::vector<FieldInfo>& fields) {
  std::size_t width = 12;
  for (const FieldInfo& field : fields) width = std::max(width, printable(field.name).size());
  return std::min(width, std::size_t{32});
}

/// How the values are spread over the volume: of one field in full, of several a line each.
void print_histograms(const std::vector<FieldInfo>& fields) {
  fmt::print("\n  share of the volume by value; bars over its logarithm\n");
  for (const FieldInfo& field : fields)
    if (fields.size() == 1)
      fmt::print("{}", histogram_text(field.histogram, kWidth));
    else
      fmt::print("  {:{}} {:>10.4g} |{}| {:.4g}{}\n", printable(field.name), name_width(fields), field.range.lower,
                 sparkline(field.histogram), field.range.upper, field.range.logarithmic ? "  (log)" : "");
}

void print_fields(const std::vector<FieldInfo>& fields) {
  const std::size_t width = name_width(fields);
  fmt::print("\n  {:{}} {:>12} {:>14} {:>16}\n", "field", width, "min", "max", "volume integral");
  for (const FieldInfo& field : fields) {
    const FieldStatistics& s = field.statistics;
    fmt::print("  {:{}} {:12.6g} {:14.6g} {:16.9g}{}\n", printable(field.name), width, s.min, s.max, s.volume_integral,
               field.unit.empty() ? "" : "  " + printable(field.unit));
    if (s.cells_without_value > 0)
      fmt::print("    {} leaf cells have no value (NaN or infinite); they are not drawn\n", s.cells_without_value);
  }
}

void print_info(const AmrHierarchy& mesh, const std::vector<FieldInfo>& fields) {
  const Vec3d lower = mesh.domain_lower();
  const Vec3d upper = mesh.domain_upper();
  fmt::print("{}\n  domain      [{:g}, {:g}] x [{:g}, {:g}] x [{:g}, {:g}]\n", printable(mesh.name()), lower.x, upper.x, lower.y,
             upper.y, lower.z, upper.z);
  fmt::print("  leaf cells  {}{}\n", mesh.leaf_cells(), mesh.has_holes() ? " (the mesh has holes)" : "");
  if (mesh.dimensions() == 2)
    fmt::print("  two-dimensional data: drawn as a slab {:g} deep, the edge of a finest cell, with copies of each cell along z\n",
               upper.z - lower.z);
  fmt::print("  hash        {}\n\n  level  patches       cells  leaf cells  ratio to finer\n", fields.front().hash);
  for (int l = 0; l < mesh.level_count(); ++l)
    fmt::print("  {:5}  {:7}  {:10}  {:10}  {}\n", l, mesh.patches(l).size(), mesh.stored_cells(l), mesh.leaf_cells(l),
               l == mesh.finest_level() ? "-" : std::to_string(mesh.ratio_to_finer(l)));
  print_fields(fields);
  print_histograms(fields);
  for (bool p : mesh.periodic())
    if (p) {
      fmt::print("\n  periodic domain: drawn clamped at its faces\n");
      break;
    }
}

}  // namespace

Json read_json_argument(const std::string& text, const char* what) {
  if (!text.empty() && text.front() == '{') return JsonFile(text, what).root().json();
  if (const std::string reason = why_absent(text); !reason.empty())
    throw UsageError(fmt::format("{}: {}; accepted: a JSON file, or the JSON itself in quotes", clipped(text, 200), reason));
  return JsonFile::read(text).root().json();
}

void add_mesh_commands(CLI::App& app, Command& chosen) {
  struct Arguments {
    std::string input, output, field;
    bool json = false;
  };
  auto a = std::make_shared<Arguments>();

  CLI::App* info = app.add_subcommand("info", "levels, patches, cells, fields, ranges and hash of a data set");
  info->add_option("data", a->input,
                   "data set: AMReX plotfile, Chombo, AMReX-HDF5, Enzo, FLASH, VTKHDF, ExaBrick, npz, or a volume")
      ->required();
  info->add_option("--field", a->field, "only this field; all of them otherwise, one after the other");
  info->add_flag("--json", a->json, "for programs");
  info->footer("Example: amrtex info data/amrex_tiny/plt00008");
  info->callback([a, &chosen] {
    chosen = [a] {
      const AmrHierarchy mesh(read_mesh(a->input, FieldChoice::one(a->field)));
      const std::vector<FieldInfo> fields = field_infos(a->input, a->field, mesh);
      if (a->json)
        fmt::print("{}\n", info_json(mesh, fields).dump(2, ' ', true, Json::error_handler_t::replace));
      else
        print_info(mesh, fields);
      return 0;
    };
  });

  CLI::App* generate = app.add_subcommand("generate", "a synthetic mesh over an analytic field, as an AMReX plotfile");
  generate->add_option("spec", a->input, "JSON file, or the JSON itself (docs/generate.md)")->required();
  generate->add_option("-o,--out", a->output, "folder to write; must not exist")->required();
  generate->footer("Example: amrtex generate '{\"field\": \"shell\", \"levels\": 3}' -o out/shell");
  generate->callback([a, &chosen] {
    chosen = [a] {
      write_amrex_plotfile(AmrHierarchy(generate_mesh(read_json_argument(a->input, "specification"))), a->output);
      return 0;
    };
  });
}

}  // namespace amrtex
