// What every encoding must do: reproduce the filter's mathematics at every kind of place, on the
// CPU in double and float and on the GL contexts. Table-driven over the registry.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/consumers/raycaster.hpp"
#include "tests/gl_probe.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

const std::vector<NamedMesh>& meshes() {
  static const std::vector<NamedMesh> all = conformance_meshes();
  return all;
}

bool power_of_two(const AmrHierarchy& h) {
  for (int l = 0; l < h.finest_level(); ++l)
    if ((h.ratio_to_finer(l) & (h.ratio_to_finer(l) - 1)) != 0) return false;
  return true;
}

/// Of conformance_meshes().
enum Mesh : std::size_t { single, nested_2, nested_4_2, nested_3_2, jump, holes, holes_3, one_cell };
const std::vector<std::size_t> kAllMeshes{single, nested_2, nested_4_2, nested_3_2, jump, holes, holes_3, one_cell};

std::size_t number_of_mesh(const AmrHierarchy& h) {
  const auto same = [&](const NamedMesh& mesh) { return &mesh.hierarchy == &h; };
  return static_cast<std::size_t>(std::find_if(meshes().begin(), meshes().end(), same) - meshes().begin());
}

/// Of the meshes every `one_in`-th for each case, in the full tier all.
template <class F>
void for_each_case(const std::vector<std::size_t>& which, F&& f, ContextKind kind = ContextKind::egl, std::size_t one_in = 1) {
  for (std::size_t i = 0; i < which.size(); ++i)
    for (const EncodingCase& c : encoding_cases()) {
      if (!chosen(i, number_of(c), one_in)) continue;
      const std::size_t mesh = which[i];
      SCOPED_TRACE(meshes()[mesh].name + ": " + c.name());
      if (accepted(meshes()[mesh].hierarchy, c, {.limits = handle_limits(kind)})) f(meshes()[mesh].hierarchy, c);
    }
}

/// Compiling a shader is what these tests take their time for: the second context sees fewer meshes.
std::vector<std::size_t> meshes_on(ContextKind kind) {
  if (kind == ContextKind::egl) return {single, nested_2, nested_3_2, jump, holes};
  return {nested_2, holes};
}

TEST(Cases, CoverEveryEncodingAndFilter) {
  if (!case_slice().empty()) GTEST_SKIP() << "AMRTEX_CASES=" << case_slice();
  for (const Encoding* e : all_encodings())
    for (const Filter filter : e->filters())
      EXPECT_TRUE(std::any_of(encoding_cases().begin(), encoding_cases().end(),
                              [&](const EncodingCase& c) { return c.encoding == e && c.filter == filter; }))
          << e->name() << " " << filter_name(filter);
}

TEST(Cases, ArePickedByEncodingFilterOrAWordOfTheirParameters) {
  for (const EncodingCase& c : encoding_cases()) {
    for (const EncodingCase& other : cases_named(encoding_cases(), c.encoding->name())) EXPECT_EQ(other.encoding, c.encoding);
    for (const EncodingCase& other : cases_named(encoding_cases(), filter_name(c.filter))) EXPECT_EQ(other.filter, c.filter);
    const auto same = cases_named(encoding_cases(), c.name());
    ASSERT_EQ(same.size(), 1u) << c.name();
    for (const EncodingCase& other : cases_named(encoding_cases(), c.parameters.dump()))
      EXPECT_EQ(other.parameters, c.parameters);
  }
  EXPECT_EQ(cases_named(encoding_cases(), "").size(), encoding_cases().size());
}

// ---- the encoding ----

TEST(Conformance, DoubleIsTheReference) {
  for_each_case(kAllMeshes, [](const AmrHierarchy& h, const EncodingCase& c) {
    const auto positions = probe_positions(h, 60);
    for (const bool ranges : {true, false}) {
      const EncodedField field = build(h, c, {.storage = Storage::r64f, .value_ranges = ranges});
      EXPECT_EQ(field.definition.filter, c.filter);
      const Comparison result = compare_double(h, field, positions);
      EXPECT_TRUE(result) << result;
    }
  });
}

TEST(Conformance, TheDomainsLastFaceBelongsToItsLastCellAndBeyondIsNothing) {
  for_each_case({single, holes}, [](const AmrHierarchy& h, const EncodingCase& c) {
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    const Vec3d upper = h.domain_upper();
    const Vec3d lower = h.domain_lower();
    const Vec3d size = upper - lower;
    std::vector<FinestPosition> positions;
    for (int a = 0; a < 3; ++a)
      for (const double at : {lower[a], upper[a]}) {
        Vec3d p = lower + size * Vec3d(0.37, 0.62, 0.81);
        p[a] = at;
        const auto position = finest_position(h, p);
        ASSERT_TRUE(position);
        positions.push_back(*position);
        p[a] = at == upper[a] ? std::nextafter(at, kInf) : std::nextafter(at, -kInf);
        EXPECT_FALSE(finest_position(h, p)) << "one ulp outside";
      }
    positions.push_back(finest_position(h, upper).value());
    const Comparison result = compare_double(h, field, positions);
    EXPECT_TRUE(result) << result;

    // cells outside the domain hold nothing
    const Vec3i last = h.cells(h.finest_level()) - Vec3i(1);
    const std::vector<FinestPosition> outside{{{-1, 0, 0}, Vec3d(0.5)},
                                              {{0, -1, 0}, Vec3d(kBelowOne)},
                                              {{0, 0, -5}, Vec3d(0)},
                                              {last + Vec3i(1), Vec3d(0)},
                                              {{last.x, last.y + 1, last.z}, Vec3d(0)}};
    for (const ProbeResult& r : probe_on_cpu(h, field, Precision::double_precision, outside)) EXPECT_FALSE(r.found);
    if (!chosen(h.has_holes() ? 1 : 0, number_of(c), 2)) return;  // each case on one of the meshes
    const EncodedField floats = build(h, c);
    Context& egl = context(ContextKind::egl);
    for (const ProbeResult& r : probe_on_gl(egl, h, Structure(egl, floats), outside)) EXPECT_FALSE(r.found);
  });
}

TEST(Conformance, FractionsThatRoundToOneStayInTheirCell) {
  // the largest double below 1 is no float below 1
  const double below = std::nextafter(1.0, 0.0);
  const AmrHierarchy h = single_level(waves).hierarchy();
  const std::vector<FinestPosition> positions{
      {{2, 3, 4}, Vec3d(below)}, {{3, 3, 3}, {below, 0.5, 0.5}}, {{7, 7, 7}, {0.5, below, below}}};
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField field = build(h, c);
    const Values expected = reference_values(h, field.definition, positions);
    const Comparison on_cpu =
        compare(positions, expected, probe_on_cpu(h, field, Precision::single_precision, positions), 1e-5 * value_range(h));
    EXPECT_TRUE(on_cpu) << on_cpu;
    Context& egl = context(ContextKind::egl);
    const Comparison on_gl =
        compare(positions, expected, probe_on_gl(egl, h, Structure(egl, field), positions), 1e-5 * value_range(h));
    EXPECT_TRUE(on_gl) << on_gl;
  }
}

// ---- arithmetic: GL and CPU in float ----

TEST(Conformance, ManualFilteringOnGlIsTheReferenceAndTheCpusBits) {
  // each case on one or two of the five meshes of EGL, so that every encoding and filter meets all of them in some case
  for (const ContextKind kind : kContexts)
    for_each_case(
        meshes_on(kind),
        [&](const AmrHierarchy& h, const EncodingCase& c) {
          SCOPED_TRACE(context_kind_name(kind));
          const auto positions = probe_positions(h, 40);
          const EncodedField field = build(h, c);
          Context& gl = context(kind);
          const auto on_gl = probe_on_gl(gl, h, Structure(gl, field), positions);
          const Comparison with_reference =
              compare(positions, reference_values(h, field.definition, positions), on_gl, 1e-5 * value_range(h));
          EXPECT_TRUE(with_reference) << with_reference;
          const auto on_cpu = probe_on_cpu(h, field, Precision::single_precision, positions);
          const Comparison bits = compare(positions, values_of(on_cpu), on_gl, power_of_two(h) ? 0 : 1e-5 * value_range(h));
          EXPECT_TRUE(bits) << "CPU float: " << bits;
          for (std::size_t i = 0; i < positions.size(); ++i)
            if (on_gl[i].found) {
              EXPECT_EQ(on_gl[i].level, on_cpu[i].level);
            }
        },
        kind, 3);
}

TEST(Conformance, HardwareFilteringDiffersByTheTextureCoordinateAlone) {
  // the normalised coordinate of a float costs 2^-14 of the local difference an axis; 2^-12 covers three and the
  // weights' rounding
  for (const ContextKind kind : kContexts)
    for_each_case(
        meshes_on(kind),
        [&](const AmrHierarchy& h, const EncodingCase& c) {
          const auto filterings = c.filterings();
          if (std::find(filterings.begin(), filterings.end(), Filtering::hardware) == filterings.end()) return;
          SCOPED_TRACE(context_kind_name(kind));
          const auto positions = probe_positions(h, 40);
          const EncodedField field = build(h, c, {.filtering = Filtering::hardware});
          EXPECT_EQ(field.filtering, Filtering::hardware);
          Context& gl = context(kind);
          const auto on_gl = probe_on_gl(gl, h, Structure(gl, field), positions);
          const Comparison result = compare(
              positions, reference_values(h, field.definition, positions), on_gl,
              [&](std::size_t i) { return 0x1p-12 * local_range(h, on_gl[i].level, positions[i]) + 1e-5 * value_range(h); });
          EXPECT_TRUE(result) << result;
        },
        kind, 4);
}

TEST(Conformance, NearestHasTheLeafsBitsInEveryEncoding) {
  Context& gl = context(ContextKind::egl);
  for_each_case(kAllMeshes, [&](const AmrHierarchy& h, const EncodingCase& c) {
    if (c.filter != Filter::nearest) return;
    const std::size_t mesh = number_of_mesh(h);
    const auto positions = probe_positions(h, 60);
    Values leaves;
    for (const FinestPosition& p : positions) {
      const auto leaf = h.find_leaf(p.cell);
      const double v = leaf ? h.value(*leaf, 0) : kNan;
      leaves.push_back(std::isnan(v) ? std::nullopt : std::optional(static_cast<double>(static_cast<float>(v))));
    }
    const EncodedField field = build(h, c);
    if (chosen(mesh, number_of(c), 4)) {  // each case on two of the eight meshes
      const Comparison on_gl = compare(positions, leaves, probe_on_gl(gl, h, Structure(gl, field), positions), 0.0);
      EXPECT_TRUE(on_gl) << on_gl;
    }
    const Comparison on_cpu = compare(positions, leaves, probe_on_cpu(h, field, Precision::single_precision, positions), 0.0);
    EXPECT_TRUE(on_cpu) << on_cpu;
  });
}

// ---- storage ----

TEST(Conformance, StorageErrsByHalfAQuantum) {
  struct Case {
    Storage storage;
    double bound;  // of the field's range
  };
  // codes are in [0, 1]: half a step of 1/255 and 1/65535; half precision has 11 bits below 1
  constexpr std::array<Case, 3> kStorages{{{Storage::r8, 0.5 / 255}, {Storage::r16, 0.5 / 65535}, {Storage::r16f, 0x1p-12}}};
  Context& gl = context(ContextKind::egl);
  std::size_t number = 0;  // of the storage: on GL each case takes one of the three
  for (const auto& [storage, bound] : kStorages) {
    ++number;
    for (const std::size_t mesh : {storage == Storage::r16 ? holes : nested_2}) {
      const AmrHierarchy& h = meshes()[mesh].hierarchy;
      const auto positions = probe_positions(h, 60);
      for (const EncodingCase& c : encoding_cases()) {
        SCOPED_TRACE(fmt::format("{} {}: {}", format_name(storage), meshes()[mesh].name, c.name()));
        const EncodedField field = build(h, c, {.storage = storage});
        EXPECT_EQ(field.storage, storage);
        EXPECT_EQ(field.scale.offset, h.statistics(0).min);
        EXPECT_EQ(field.scale.scale, value_range(h));
        const Values expected = reference_values(h, field.definition, positions);
        const auto in_double = probe_on_cpu(h, field, Precision::double_precision, positions);
        const Comparison exact = compare(positions, expected, in_double, (bound + 1e-12) * value_range(h));
        EXPECT_TRUE(exact) << exact;
        EXPECT_GT(exact.worst, bound * value_range(h) / 16) << "the payload is of this storage";
        if (!chosen(number, number_of(c), kStorages.size())) continue;
        const Comparison on_gl =
            compare(positions, expected, probe_on_gl(gl, h, Structure(gl, field), positions), (bound + 1e-6) * value_range(h));
        EXPECT_TRUE(on_gl) << on_gl;
      }
    }
  }
}

// ---- regions ----

/// What locate() says of a position, beside the value.
struct RegionProbe {
  glm::vec4 value;   // value, found, smallest, largest value of the region
  glm::ivec4 lower;  // and its level
  glm::ivec4 upper;  // and its width
};

constexpr const char* kRegionProbe = R"(#include "portable_glsl.h"
#include "contract.glsl"
layout(local_size_x = 64) in;
struct Probe { vec4 value; ivec4 lower; ivec4 upper; };
layout(std430) readonly buffer cells_block { ivec4 cells[]; };
layout(std430) readonly buffer fractions_block { vec4 fractions[]; };
layout(std430) writeonly buffer results_block { Probe probes[]; };
uniform int u_count;
void main() {
  int i = int(gl_GlobalInvocationID.x);
  if (i >= u_count) return;
  Position p;
  p.cell = cells[i].xyz;
  p.fraction = fractions[i].xyz;
  Region r;
  bool inside = locate(p, r);
  FieldSample s;
  bool found = sample_field(p, s);
  probes[i].value = vec4(found ? s.value : 0.0, inside ? (found ? 1.0 : 0.5) : 0.0, r.value_range.x, r.value_range.y);
  probes[i].lower = ivec4(r.lower, r.level);
  probes[i].upper = ivec4(r.upper, r.width);
}
)";

std::vector<RegionProbe> probe_regions(Context& gl, const AmrHierarchy& h, const EncodedField& field,
                                       std::span<const FinestPosition> positions) {
  std::vector<glm::ivec4> cells;
  std::vector<glm::vec4> fractions;
  for (const FinestPosition& p : positions) {
    cells.emplace_back(p.cell, 0);
    fractions.emplace_back(Vec3f(p.fraction), 0);
  }
  return run_probe<RegionProbe>(gl, field, field_uniforms(h, field), kRegionProbe, positions.size(),
                                {{"cells_block", cells}, {"fractions_block", fractions}});
}

TEST(Conformance, RegionsHoldTheirPositionsAndTheirValues) {
  // each case with one of the meshes, storages and filterings: a pair of an encoding and a filter has several cases
  Context& gl = context(ContextKind::egl);
  for_each_case({nested_2, holes_3}, [&](const AmrHierarchy& h, const EncodingCase& c) {
    const auto positions = probe_positions(h, 60);
    std::size_t way = &h == &meshes()[holes_3].hierarchy ? 2 * c.filterings().size() : 0;
    for (const Storage storage : {Storage::r32f, Storage::r8})
      for (const Filtering filtering : c.filterings()) {
        if (!chosen(way++, number_of(c), 4 * c.filterings().size())) continue;
        SCOPED_TRACE(fmt::format("{} {}", format_name(storage), filtering_name(filtering)));
        const EncodedField field = build(h, c, {.storage = storage, .filtering = filtering});
        const auto probes = probe_regions(gl, h, field, positions);
        int bad_boxes = 0, skippable = 0;
        for (std::size_t i = 0; i < positions.size(); ++i) {
          const RegionProbe& p = probes[i];
          if (p.value.y == 0) continue;  // outside the mesh
          const Box box{Vec3i(p.lower), Vec3i(p.upper)};
          const Vec3i last = h.cells(h.finest_level());
          bool good = box.contains(positions[i].cell) && p.upper.w == h.cell_width(p.lower.w);
          for (int a = 0; a < 3; ++a)
            good = good && box.lower[a] % p.upper.w == 0 && (box.upper[a] % p.upper.w == 0 || box.upper[a] == last[a]);
          bad_boxes += good ? 0 : 1;
          if (p.value.y < 1) continue;
          const bool in_range = p.value.x >= p.value.z && p.value.x <= p.value.w;
          EXPECT_TRUE(in_range) << fmt::format("{} is not in [{}, {}]", p.value.x, p.value.z, p.value.w);
          skippable += p.value.w - p.value.z < 0.9 * value_range(h) ? 1 : 0;
        }
        EXPECT_EQ(bad_boxes, 0);
        if (h.leaf_cells() > 5000) {
          EXPECT_GT(skippable, 0) << "ranges that hold everything skip nothing";
        }
      }
  });
}

// ---- continuity ----

/// Places on faces, edges and corners of leaves of every level, each from all of the 2, 4 or 8 sides.
std::vector<std::vector<FinestPosition>> places_from_all_sides(const AmrHierarchy& h) {
  std::mt19937_64 random(7);
  const Box domain = h.domain(h.finest_level());
  std::vector<std::vector<FinestPosition>> places;
  for (const LeafCell& leaf : some_leaves(h, 40, random)) {
    const int w = h.cell_width(leaf.level);
    for (int on = 1; on < 8; ++on) {  // the axes along which the place lies on a face of the leaf
      FinestPosition p{leaf.cell * w, Vec3d(0)};
      for (int a = 0; a < 3; ++a) {
        const bool on_face = ((on >> a) & 1) != 0;
        p.cell[a] += on_face ? w * static_cast<int>(random() % 2) : static_cast<int>(random() % static_cast<unsigned>(w));
        if (!on_face) p.fraction[a] = static_cast<double>(random() % 1024) / 1024;
      }
      std::vector<FinestPosition>& sides = places.emplace_back();
      for (int below = 0; below < 8; ++below) {
        if ((below & ~on) != 0) continue;
        FinestPosition side = p;
        for (int a = 0; a < 3; ++a)
          if (((below >> a) & 1) != 0) {
            side.cell[a] -= 1;
            side.fraction[a] = kBelowOne;
          }
        if (domain.contains(side.cell)) sides.push_back(side);
      }
    }
  }
  return places;
}

/// Largest difference between the sides of a place.
double largest_jump(const std::vector<std::vector<FinestPosition>>& places, std::span<const ProbeResult> values) {
  double jump = 0;
  std::size_t i = 0;
  for (const auto& sides : places) {
    double low = kInf;
    double high = -kInf;
    for (std::size_t k = 0; k < sides.size(); ++k, ++i)
      if (values[i].found) {
        low = std::min(low, values[i].value);
        high = std::max(high, values[i].value);
      }
    jump = std::max(jump, high - low);
  }
  return jump;
}

TEST(Conformance, VerticesMakeAFieldWithoutJumpsAcrossFacesEdgesAndCornersOfAnyLevels) {
  // the bound is 1e-6 of the range, in floats and double; linear_lod is the control that jumps
  std::vector<NamedMesh> jumping;
  jumping.push_back({"ratio 2", nested(waves).hierarchy()});
  jumping.push_back({"ratios 4 and 2", nested(waves, {4, 2}).hierarchy()});
  jumping.push_back({"ratios 2 and 4", nested(waves, {2, 4}).hierarchy()});
  jumping.push_back({"jump of two levels", jump_of_two(waves).hierarchy()});
  jumping.push_back({"holes and missing values", holes_and_missing(waves).hierarchy()});
  Context& gl = context(ContextKind::egl);
  int continuous = 0;
  std::size_t mesh = 0;  // on GL each case meets one or two of the five
  for (const auto& [name, h] : jumping) {
    ++mesh;
    const auto places = places_from_all_sides(h);
    std::vector<FinestPosition> positions;
    for (const auto& sides : places) positions.insert(positions.end(), sides.begin(), sides.end());
    for (const EncodingCase& c : encoding_cases()) {
      if (c.filter != Filter::linear_vertex && c.filter != Filter::linear_lod) continue;
      SCOPED_TRACE(name + ": " + c.name());
      const EncodedField floats = build(h, c);
      std::vector<double> jumps{largest_jump(places, probe_on_cpu(h, floats, Precision::single_precision, positions))};
      if (chosen(mesh, number_of(c), 3))
        jumps.push_back(largest_jump(places, probe_on_gl(gl, h, Structure(gl, floats), positions)));
      for (const double jump : jumps) {
        if (c.filter == Filter::linear_lod) {
          EXPECT_GT(jump / value_range(h), 1e-3);
        } else {
          EXPECT_LE(jump / value_range(h), 1e-6);
        }
      }
      if (c.filter == Filter::linear_lod) continue;
      const EncodedField doubles = build(h, c, {.storage = Storage::r64f});
      EXPECT_LE(largest_jump(places, probe_on_cpu(h, doubles, Precision::double_precision, positions)) / value_range(h), 1e-6);
      ++continuous;
    }
  }
  EXPECT_GT(continuous, 0);
}

// ---- no value: nothing spreads further than the filter's footprint ----

TEST(Conformance, MissingValuesSpreadNoFurtherThanTheFootprint) {
  // one cell holds 1e6, or NaN in its stead: what is two cells off does not change by a bit
  const Vec3i odd(8, 5, 7);
  const auto with = [&](double value) {
    return MeshBuilder(Vec3i(14)).root([&](const Vec3d& p) { return Vec3i(p * 14.0) == odd ? value : waves(p); }).hierarchy();
  };
  const AmrHierarchy missing = with(kNan);
  const AmrHierarchy present = with(0.25);
  std::vector<FinestPosition> far;
  std::vector<FinestPosition> within;
  for (const FinestPosition& p : probe_positions(missing, 1500)) {
    const Vec3i d = glm::abs(p.cell - odd);
    const int distance = std::max({d.x, d.y, d.z});
    if (distance >= 2) far.push_back(p);
    if (distance == 0) within.push_back(p);
  }
  ASSERT_GT(far.size(), 1000u);
  ASSERT_GT(within.size(), 5u);
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField a = build(missing, c);
    const EncodedField b = build(present, c);
    const Comparison same = compare(far, values_of(probe_on_cpu(present, b, Precision::single_precision, far)),
                                    probe_on_cpu(missing, a, Precision::single_precision, far), 0.0);
    EXPECT_TRUE(same) << same;
    for (const ProbeResult& r : probe_on_cpu(missing, a, Precision::single_precision, within)) EXPECT_FALSE(r.found);
    const std::vector<Filtering> filterings = c.filterings();
    for (std::size_t i = 0; i < filterings.size(); ++i) {
      if (!chosen(i, number_of(c), 2)) continue;
      const Filtering filtering = filterings[i];
      const EncodedField field = build(missing, c, {.filtering = filtering});
      Context& gl = context(ContextKind::egl);
      for (const ProbeResult& r : probe_on_gl(gl, missing, Structure(gl, field), far))
        EXPECT_TRUE(r.found && std::isfinite(r.value));
      for (const ProbeResult& r : probe_on_gl(gl, missing, Structure(gl, field), within)) EXPECT_FALSE(r.found);
    }
  }
}

// ---- several fields in one structure ----

const std::vector<NamedMesh>& meshes_of_two_fields() {
  static const std::vector<NamedMesh> all = [] {
    std::vector<NamedMesh> list;
    list.push_back({"every cell has a value", nested(waves).also("g", slopes).hierarchy()});
    list.push_back({"the fields miss different cells", fields_with_gaps().hierarchy()});
    list.push_back(
        {"one field misses cells",
         single_level(waves).also("g", [](const Vec3d& p) { return p.x < -0.3 && p.z > 2.2 ? kNan : slopes(p); }).hierarchy()});
    return list;
  }();
  return all;
}

template <class F>
void for_each_case_of_two_fields(F&& f) {
  for (const NamedMesh& mesh : meshes_of_two_fields())
    for (const EncodingCase& c : encoding_cases()) {
      SCOPED_TRACE(mesh.name + ": " + c.name());
      if (accepted(mesh.hierarchy, c, {.more_fields = {1}})) f(mesh.hierarchy, c);
    }
}

void expect_same(std::span<const FinestPosition> positions, std::span<const ProbeResult> expected,
                 std::span<const ProbeResult> got, std::string_view what) {
  const Comparison bits = compare(positions, values_of(expected), got, 0.0);
  EXPECT_TRUE(bits) << what << ": " << bits;
  for (std::size_t i = 0; i < positions.size(); ++i)
    if (expected[i].found && got[i].found) {
      EXPECT_EQ(got[i].level, expected[i].level);
    }
}

TEST(SeveralFields, MissDifferentCellsInTheTests) {
  const AmrHierarchy& h = meshes_of_two_fields()[1].hierarchy;
  std::set<std::pair<bool, bool>> seen;
  for (const FinestPosition& p : probe_positions(h, 100)) {
    const auto leaf = h.find_leaf(p.cell);
    if (leaf) seen.emplace(std::isnan(h.value(*leaf, 0)), std::isnan(h.value(*leaf, 1)));
  }
  EXPECT_EQ(seen.size(), 4u);
  EXPECT_TRUE(h.has_holes());
}

TEST(SeveralFields, EachHasTheBitsOfAStructureOfItsOwnOnTheCpu) {
  for_each_case_of_two_fields([](const AmrHierarchy& h, const EncodingCase& c) {
    const auto positions = probe_positions(h, 60);
    for (const Storage storage : {Storage::r64f, Storage::r32f, Storage::r8, Storage::r16f}) {
      SCOPED_TRACE(format_name(storage));
      const Precision precision = storage == Storage::r64f ? Precision::double_precision : Precision::single_precision;
      const EncodedField both = build(h, c, {.storage = storage, .more_fields = {1}});
      EXPECT_EQ(both.field_count, 2);
      for (const int number : {0, 1}) {
        const EncodedField alone = build(h, c, {.storage = storage, .field = number});
        EXPECT_EQ(both.scale_of(number).offset, alone.scale.offset);
        expect_same(positions, probe_on_cpu(h, alone, precision, positions), probe_on_cpu(h, both, precision, positions, number),
                    fmt::format("field {}", number));
      }
    }
  });
}

TEST(SeveralFields, EachHasTheBitsOfAStructureOfItsOwnOnGl) {
  Context& gl = context(ContextKind::egl);
  // each encoding with one filter, on the mesh whose fields miss cells; the same text is asked of all cases and meshes above
  const AmrHierarchy& h = meshes_of_two_fields()[1].hierarchy;
  const auto takes = [&](const EncodingCase& c) { return accepted(h, c, {.more_fields = {1}}); };
  GlPairs(all_encodings().size(), takes).for_each([&](const EncodingCase& c) {
    const auto positions = probe_positions(h, 40);
    const bool scaled = c.filter == Filter::nearest;  // either storage is compiled in some case
    const Storage storage = scaled ? Storage::r16 : Storage::r32f;
    const EncodedField both = build(h, c, {.storage = storage, .more_fields = {1}});
    const Structure structure(gl, both);
    for (const int number : {0, 1}) {
      const EncodedField alone = build(h, c, {.storage = storage, .field = number});
      expect_same(positions, probe_on_gl(gl, h, Structure(gl, alone), positions),
                  probe_on_gl(gl, h, structure, positions, number), fmt::format("field {}", number));
    }
  });
}

TEST(SeveralFields, HardwareFilteringReadsTheTextureOfItsField) {
  Context& gl = context(ContextKind::egl);
  const AmrHierarchy& h = meshes_of_two_fields()[1].hierarchy;
  const auto positions = probe_positions(h, 40);
  const auto takes = [&](const EncodingCase& c) {
    return interpolates(c.filter) && accepted(h, c, {.filtering = Filtering::hardware, .more_fields = {1}});
  };
  GlPairs(3, takes).for_each([&](const EncodingCase& c) {  // as many as interpolate in the texture unit in ways of their own
    const EncodedField both = build(h, c, {.filtering = Filtering::hardware, .more_fields = {1}});
    const Structure structure(gl, both);
    for (const int number : {0, 1}) {
      const EncodedField manual = build(h, c, {.field = number});
      const FieldStatistics& s = h.statistics(number);
      const Comparison result = compare(positions, values_of(probe_on_cpu(h, manual, Precision::single_precision, positions)),
                                        probe_on_gl(gl, h, structure, positions, number), 0x1p-11 * (s.max - s.min));
      EXPECT_TRUE(result) << result;
    }
  });
}

/// Seen askew from outside; half of the values are invisible, so that regions are skipped.
Scene askew(const AmrHierarchy& h, Mode mode) {
  Scene scene;
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  const Vec3d size = h.domain_upper() - h.domain_lower();
  scene.view.eye = middle + size * Vec3d(1.1, -1.7, 0.8);
  scene.view.at = middle;
  scene.transfer_function.extinction = {{0.5, 0}, {1, 20}};
  scene.transfer_function.color = {{0, {1, 0.2, 0}}, {1, {0, 0.5, 1}}};
  scene.settings.mode = mode;
  scene.settings.width = 40;
  scene.settings.height = 32;
  return scene;
}

TEST(SeveralFields, ThePictureIsThatOfTheFirstAlone) {
  Context& gl = context(ContextKind::egl);
  const AmrHierarchy& h = meshes_of_two_fields()[1].hierarchy;
  const auto takes = [&](const EncodingCase& c) { return accepted(h, c, {.more_fields = {1}}); };
  GlPairs(2, takes).for_each([&](const EncodingCase& c, std::size_t pair) {
    for (const Mode mode : {Mode::dvr, Mode::mip}) {  // two marching loops
      if (!in_turn(mode == Mode::dvr ? 0 : 1, pair, 2)) continue;
      const Scene scene = askew(h, mode);
      const auto draw = [&](const EncodedField& field) {
        const Structure structure(gl, field);
        Raycaster raycaster(gl, h, structure, scene);
        raycaster.draw();
        return raycaster.read().values;
      };
      const auto alone = draw(build(h, c));
      EXPECT_GT(*std::max_element(alone.begin(), alone.end()), 0);
      EXPECT_EQ(draw(build(h, c, {.more_fields = {1}})), alone);
    }
  });
}

std::int64_t handles(const EncodedField& field) {
  return std::count_if(field.textures.begin(), field.textures.end(), [](const HostTexture& t) { return !t.handles.empty(); });
}

TEST(SeveralFields, OneFieldPaysNothing) {
  const AmrHierarchy h = single_level(waves).also("g", slopes).hierarchy();  // no page is constant
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField one = build(h, c);
    EXPECT_EQ(one.field_count, 1);
    EXPECT_TRUE(one.more_scales.empty());
    for (const HostTexture& t : one.textures) EXPECT_EQ(t.name.find('['), std::string::npos) << t.name;
    std::vector<std::string> about_fields;
    for (const auto& [name, value] : one.shader.defines)
      if (name.find("FIELD") != std::string::npos) about_fields.push_back(fmt::format("{}={}", name, value));
    EXPECT_THAT(about_fields, testing::UnorderedElementsAre("AMRTEX_FIELDS=1", "AMRTEX_FIELD_RANGES=0"));
    for (const UniformValue& u : field_uniforms(h, one))
      if (u.name == "u_value_scale") {
        EXPECT_EQ(std::get<std::vector<double>>(u.numbers).size(), 2u);
      }
    // a further field costs its values and no structure
    const EncodedField two = build(h, c, {.more_fields = {1}});
    EXPECT_EQ(two.value_texels(), 2 * one.value_texels());
    EXPECT_EQ(two.memory().payload, 2 * one.memory().payload);
    EXPECT_EQ(two.memory().duplicated, 2 * one.memory().duplicated);
    // textures that handles reach have one of 64 bits each
    EXPECT_EQ(two.memory().topology, one.memory().topology + 8 * (handles(two) - handles(one)));
  }
}

TEST(SeveralFields, FourAreTakenAndFiveRefused) {
  Context& gl = context(ContextKind::egl);
  const AmrHierarchy& h = meshes_of_two_fields()[1].hierarchy;
  const auto positions = probe_positions(h, 20);
  const GlPairs drawn(2, [&](const EncodingCase& c) { return accepted(h, c, {.more_fields = {1}}); });
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    if (!accepted(h, c, {.more_fields = {1}})) continue;
    const EncodedField four = build(h, c, {.more_fields = {1, 0, 1}});
    const auto on_cpu = [&](int number) { return probe_on_cpu(h, four, Precision::single_precision, positions, number); };
    expect_same(positions, on_cpu(1), on_cpu(3), "3 is 1");
    if (drawn.has(c)) {
      const Structure structure(gl, four);
      const auto on_gl = [&](int number) { return probe_on_gl(gl, h, structure, positions, number); };
      expect_same(positions, on_gl(1), on_gl(3), "3 is 1");
      EXPECT_THROW(on_gl(4), UsageError);
    }
    EXPECT_THROW(probe_on_cpu(h, four, Precision::single_precision, positions, 4), UsageError);
    EXPECT_THROW(build(h, c, {.more_fields = {2}}), UsageError) << "the mesh has two";
    try {
      build(h, c, {.more_fields = {1, 0, 1, 0}});
      ADD_FAILURE() << "five fields were built";
    } catch (const UsageError& e) {
      EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr(std::string(c.encoding->name())), testing::HasSubstr("5 fields"),
                                           testing::HasSubstr("at most 4")));
    }
  }
}

// ---- controls: a check that cannot fail is a defect ----

/// The same check over data that was tampered with; a fetch outside of a texture is noticed too.
bool noticed(const AmrHierarchy& h, const EncodedField& field, std::span<const FinestPosition> positions) {
  try {
    return !compare_double(h, field, positions);
  } catch (const Error&) {
    return true;
  }
}

template <class F>
void for_each_value_texture(EncodedField& field, F&& f) {
  for (HostTexture& t : field.textures)
    if (t.holds_values) f(t);
}

TEST(MutationControl, SwappedAxesAreNoticed) {
  for (const std::size_t mesh : {single, nested_2, holes}) {
    const AmrHierarchy& h = meshes()[mesh].hierarchy;
    const auto positions = probe_positions(h, 60);
    for (const EncodingCase& c : encoding_cases()) {
      SCOPED_TRACE(meshes()[mesh].name + ": " + c.name());
      EncodedField field = build(h, c, {.storage = Storage::r64f});
      ASSERT_FALSE(noticed(h, field, positions)) << "the control needs a field that passes";
      for_each_value_texture(field, [](HostTexture& t) {
        const HostTexture before = t;
        std::swap(t.size.x, t.size.y);
        for_each_cell({Vec3i(0), before.size}, [&](const Vec3i& i) {
          t.as<double>()[Box{Vec3i(0), t.size}.offset({i.y, i.x, i.z})] =
              before.as<double>()[Box{Vec3i(0), before.size}.offset(i)];
        });
      });
      EXPECT_TRUE(noticed(h, field, positions));
    }
  }
}

TEST(MutationControl, ValuesShiftedByOneTexelAreNoticed) {
  const AmrHierarchy& h = meshes()[nested_2].hierarchy;
  const auto positions = probe_positions(h, 60);
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    EncodedField field = build(h, c, {.storage = Storage::r64f});
    for_each_value_texture(field, [](HostTexture& t) { std::rotate(t.data.begin(), t.data.begin() + 8, t.data.end()); });
    EXPECT_TRUE(noticed(h, field, positions));
  }
}

TEST(MutationControl, AWrongLevelsWidthIsNoticed) {
  for (const std::size_t mesh : {nested_2, nested_4_2, nested_3_2, jump}) {
    const AmrHierarchy& h = meshes()[mesh].hierarchy;
    const auto positions = probe_positions(h, 60);
    for (const EncodingCase& c : encoding_cases()) {
      SCOPED_TRACE(meshes()[mesh].name + ": " + c.name());
      if (!accepted(h, c)) continue;
      const EncodedField field = build(h, c, {.storage = Storage::r64f});
      const Values expected = reference_values(h, field.definition, positions);
      const auto levels = probe_on_cpu(h, field, Precision::double_precision, positions);
      const int used =
          std::max_element(levels.begin(), levels.end(), [](const auto& a, const auto& b) { return a.level < b.level; })->level;
      UniformValues uniforms = field_uniforms(h, field);
      for (UniformValue& u : uniforms)
        if (u.name == "u_level_width") {
          auto& widths = std::get<std::vector<int>>(u.numbers);
          widths[static_cast<std::size_t>(used)] *= 2;
          widths.push_back(1 << 20);  // of the level that the define below adds: of no cell
        }
      ShaderKey key = probe_key(field, 0);  // where all ratios are 2 widths follow from the number of levels
      key.defines["AMRTEX_LEVELS"] = std::to_string(h.level_count() + 1);
      const auto cpu = make_cpu_field(field.encoding, Precision::double_precision);
      std::vector<const HostTexture*> textures;
      for (const HostTexture& t : field.textures) textures.push_back(&t);
      cpu->set(key, uniforms, textures);
      bool differs = false;
      try {
        std::vector<ProbeResult> results;
        for (const FinestPosition& p : positions) results.push_back(cpu->sample(p.cell, p.fraction));
        differs = !compare(positions, expected, results, 1e-12 * value_range(h));
      } catch (const Error&) {
        differs = true;
      }
      EXPECT_TRUE(differs);
    }
  }
}

TEST(MutationControl, SingleTexelsAreNoticedAsOftenAsTheyHoldACellsValue) {
  const AmrHierarchy& h = meshes()[single].hierarchy;
  std::vector<FinestPosition> positions;
  for_each_cell(h.domain(0), [&](const Vec3i& c) {
    positions.push_back({c, Vec3d(0.5)});
    positions.push_back({c, Vec3d(0)});
  });
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    constexpr int kTries = 40;
    int caught = 0;
    double share = 0;
    std::mt19937_64 random(3);
    for (int i = 0; i < kTries; ++i) {
      EncodedField copy = field;
      for_each_value_texture(copy, [&](HostTexture& t) {
        share = static_cast<double>(t.roles.payload) / static_cast<double>(t.bytes());
        t.as<double>()[std::uniform_int_distribution<std::int64_t>(0, t.texels() - 1)(random)] += 0.5;
      });
      caught += noticed(h, copy, positions) ? 1 : 0;
    }
    EXPECT_GE(caught, 0.6 * kTries * share) << "payload share " << share;
  }
}

TEST(MutationControl, CorruptedTexturesReachTheGlContextToo) {
  const AmrHierarchy& h = meshes()[nested_2].hierarchy;
  const auto positions = probe_positions(h, 40);
  Context& gl = context(ContextKind::egl);
  for (const EncodingCase& c : encoding_cases())
    for (const Filtering filtering : c.filterings()) {
      if (!chosen(filtering == Filtering::manual ? 0 : 1, number_of(c), 4)) continue;
      SCOPED_TRACE(c.name());
      EncodedField field = build(h, c, {.filtering = filtering});
      const Values expected = reference_values(h, field.definition, positions);
      for_each_value_texture(field, [](HostTexture& t) { std::rotate(t.data.begin(), t.data.begin() + 4, t.data.end()); });
      EXPECT_FALSE(compare(positions, expected, probe_on_gl(gl, h, Structure(gl, field), positions), 1e-3 * value_range(h)));
    }
}

}  // namespace
}  // namespace amrtex
