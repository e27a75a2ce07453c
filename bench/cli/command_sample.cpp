#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "bench/cli/commands.hpp"
#include "bench/cli/context_arguments.hpp"
#include "bench/measure/error_split.hpp"
#include "renderers/consumers/probe.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

struct Arguments {
  std::string data, field, encoding, filter, points;
  std::string storage = "r32f", filtering = "manual";
  ContextArguments context;
  std::vector<std::string> parameters;
  bool json = false;
};

std::vector<Vec3d> read_points(const std::string& path) {
  const std::string text = load_stream(path, kMaxTextBytes);
  check_lines(path, text);
  std::istringstream file(text);
  std::vector<Vec3d> points;
  std::string line;
  for (int n = 1; std::getline(file, line); ++n) {
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[line.find_first_not_of(" \t")] == '#') continue;
    std::istringstream numbers(line);
    Vec3d p;
    std::string rest;
    if (!(numbers >> p.x >> p.y >> p.z) || (numbers >> rest))
      throw Error(fmt::format("points file {}, line {}: {} is not three numbers x y z (world units)", path, n, quote(line)));
    points.push_back(p);
  }
  if (points.empty()) throw Error(fmt::format("points file {}: no point; a line x y z for each is expected", path));
  return points;
}

}  // namespace

Json parse_parameters(const std::vector<std::string>& given) {
  Json parameters = Json::object();
  for (const std::string& p : given) {
    const auto equals = p.find('=');
    if (equals == std::string::npos)
      throw UsageError(fmt::format("--parameter {}: accepted: NAME=VALUE, as in page_size=8", clipped(p)));
    if (!is_utf8(p)) throw UsageError(fmt::format("--parameter {}: not UTF-8; accepted: NAME=VALUE", clipped(p)));
    const std::string value = p.substr(equals + 1);
    const Json json = Json::parse(value, nullptr, false);
    parameters[p.substr(0, equals)] = json.is_discarded() ? Json(value) : json;
  }
  return parameters;
}

namespace {

struct Sampled {
  Vec3d p;
  int level = -1;
  std::optional<double> reference{};
  ProbeResult encoding_double{}, encoding_gl{};
  std::optional<Vec3d> p_gl{};  ///< the point that the GL column is taken at, world
  double off_gl = 0;            ///< of the largest coordinate of it, widths of the finest cells
};

void note_gl_point(const AmrHierarchy& mesh, const FinestPosition& exact, const FinestPosition& rounded, Sampled& sample) {
  sample.p_gl = mesh.domain_lower() + (Vec3d(rounded.cell) + rounded.fraction) * mesh.spacing(mesh.finest_level());
  const Vec3d off = glm::abs(rounded.fraction - exact.fraction);
  sample.off_gl = std::max({off.x, off.y, off.z});
}

std::vector<Sampled> sample(const Arguments& a) {
  const Encoding& encoding = find_encoding(a.encoding);
  BuildRequest request;
  request.needs = {parse_filter(a.filter), parse_filtering(a.filtering), true};
  request.storage = parse_storage(a.storage);
  request.parameters = complete_parameters(encoding, parse_parameters(a.parameters));
  const ContextChoice choice = a.context.choice("egl");
  const std::vector<Vec3d> points = read_points(a.points);
  const AmrHierarchy mesh(read_mesh(a.data, FieldChoice::one(a.field)));
  const auto context = make_context(choice);
  request.context = context->info();
  require_support(encoding, request.context);
  const Structure structure(*context, encoding.build(mesh, request), request);

  const EncodedField exact_field = build_exact(encoding, mesh, request);
  const HierarchyReference reference(mesh, request.field, structure.field.definition);

  std::vector<Sampled> samples;
  std::vector<FinestPosition> inside, rounded;
  std::vector<std::size_t> where;
  for (const Vec3d& p : points) {
    samples.push_back({.p = p});
    const auto position = finest_position(mesh, p);
    if (!position) continue;
    rounded.push_back(position_on_gl(*position));
    note_gl_point(mesh, *position, rounded.back(), samples.back());
    samples.back().reference = reference.sample(*position);
    if (const auto leaf = mesh.find_leaf(position->cell)) samples.back().level = leaf->level;
    inside.push_back(*position);
    where.push_back(samples.size() - 1);
  }
  const auto doubles = probe_on_cpu(mesh, exact_field, Precision::double_precision, inside);
  const auto gl = probe_on_gl(*context, mesh, structure, rounded);
  for (std::size_t i = 0; i < inside.size(); ++i) {
    samples[where[i]].encoding_double = doubles[i];
    samples[where[i]].encoding_gl = gl[i];
  }
  return samples;
}

Json value_or_null(const ProbeResult& r) { return r.found ? Json(r.value) : Json(nullptr); }

int run(const Arguments& a) {
  const std::vector<Sampled> samples = sample(a);
  if (a.json) {
    Json list = Json::array();
    for (const Sampled& s : samples)
      list.push_back({{"p", {s.p.x, s.p.y, s.p.z}},
                      {"level", s.level < 0 ? Json(nullptr) : Json(s.level)},
                      {"reference", s.reference ? Json(*s.reference) : Json(nullptr)},
                      {"encoding_double", value_or_null(s.encoding_double)},
                      {"encoding_gl", value_or_null(s.encoding_gl)},
                      {"p_gl", s.p_gl ? Json({s.p_gl->x, s.p_gl->y, s.p_gl->z}) : Json(nullptr)}});
    fmt::print("{}\n", list.dump(1));
    return 0;
  }
  const auto text = [](bool found, double v) { return found ? fmt::format("{:.9g}", v) : std::string("-"); };
  fmt::print("{:>12} {:>12} {:>12} {:>5} {:>16} {:>16} {:>16} {:>12}\n", "x", "y", "z", "level", "reference", "encoding double",
             "encoding GL", "GL point off");
  for (const Sampled& s : samples)
    fmt::print("{:12.6g} {:12.6g} {:12.6g} {:>5} {:>16} {:>16} {:>16} {:>12}\n", s.p.x, s.p.y, s.p.z,
               s.level < 0 ? "-" : std::to_string(s.level), text(s.reference.has_value(), s.reference.value_or(0)),
               text(s.encoding_double.found, s.encoding_double.value), text(s.encoding_gl.found, s.encoding_gl.value),
               s.p_gl ? fmt::format("{:.2g}", s.off_gl) : "-");
  return 0;
}

}  // namespace

void add_sample_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("sample", "the field at points: reference, encoding in double, encoding on the GL context");
  c->add_option("data", a->data, "data set")->required();
  c->add_option("--field", a->field, "field (default: the first)");
  c->add_option("--encoding", a->encoding, "see `amrtex encodings`")->required();
  c->add_option("--filter", a->filter, "nearest, linear_page, ...")->required();
  c->add_option("--points", a->points, "file with x y z a line, world units")->required();
  c->add_option("--parameter", a->parameters, "build parameter NAME=VALUE; may be repeated");
  c->add_option("--storage", a->storage, "r8, r16, r16f, r32f");
  c->add_option("--filtering", a->filtering, "hardware or manual");
  add_context_options(*c, a->context, "egl otherwise");
  c->add_flag("--json", a->json, "for programs");
  c->footer(
      "Reference and encoding double are taken at the point itself. A GL context is given a cell and a fraction of it in float: "
      "the "
      "column GL point off (widths of the finest cells), with --json the key p_gl (world), tells where that is.\n\n"
      "Example: amrtex sample data/amrex_tiny/plt00008 --encoding page_table --filter linear_page --parameter page_size=8 "
      "--points points.txt");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
