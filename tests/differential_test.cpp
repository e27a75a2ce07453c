// Random legal meshes: every encoding with every filter against the double reference, and against
// itself on other machines (GL contexts, thread counts). A failure prints its seed.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <iostream>
#include <map>
#include <set>

#include "structures/generators/random_mesh.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

constexpr std::uint64_t kSeeds = 64;

RandomMeshOptions small_meshes() {
  RandomMeshOptions options;
  options.max_finest_cells = 1 << 15;
  return options;
}

/// Meshes that an encoding refuses are legal; they are counted and printed.
struct Refusals {
  int built = 0;
  std::map<std::string, int> refused;

  std::optional<EncodedField> try_build(const AmrHierarchy& h, const EncodingCase& c, const BuildOptions& options) {
    try {
      EncodedField field = build(h, c, options);
      ++built;
      return field;
    } catch (const UnsupportedError& e) {
      ++refused[fmt::format("{}: {}", c.name(), e.what())];
      return std::nullopt;
    }
  }
  void print() const {
    std::cout << fmt::format("{} fields built\n", built);
    for (const auto& [what, n] : refused) std::cout << fmt::format("refused {} times: {}\n", n, what);
  }
};

TEST(Differential, TheSeedsHoldEverythingThatIsRare) {
  std::set<std::string> seen;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const AmrHierarchy h(random_mesh(seed, small_meshes()));
    if (h.has_holes()) seen.insert("holes");
    if (h.statistics(0).cells_without_value > 0) seen.insert("missing values");
    for (int l = 0; l < h.finest_level(); ++l) seen.insert(fmt::format("ratio {}", h.ratio_to_finer(l)));
    for (int l = 1; l < h.finest_level(); ++l)
      if (h.patches(l).empty()) seen.insert("jump");
    const Vec3d s = h.spacing(0);
    if (s.x != s.y) seen.insert("anisotropic cells");
    if (h.level_count() > 2) seen.insert("three levels");
  }
  for (const char* thing :
       {"holes", "missing values", "ratio 2", "ratio 3", "ratio 4", "jump", "anisotropic cells", "three levels"})
    EXPECT_TRUE(seen.contains(thing)) << thing;
}

TEST(Differential, DoubleIsTheReferenceOnRandomMeshes) {
  Refusals refusals;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const AmrHierarchy h(random_mesh(seed, small_meshes()));
    const auto positions = probe_positions(h, 16, seed);
    for (const EncodingCase& c : encoding_cases()) {
      SCOPED_TRACE(fmt::format("seed {}: {}", seed, c.name()));
      const auto field = refusals.try_build(h, c, {.storage = Storage::r64f, .value_ranges = seed % 2 == 0});
      if (!field) continue;
      const Comparison result = compare_double(h, *field, positions);
      EXPECT_TRUE(result) << result;
    }
  }
  refusals.print();
  EXPECT_GT(refusals.built, static_cast<int>(kSeeds));
}

TEST(Differential, EachOfSeveralFieldsHasTheBitsOfAStructureOfItsOwn) {
  Refusals refusals;
  RandomMeshOptions options = small_meshes();
  options.fields = 3;
  for (std::uint64_t seed = 200; seed < 224; ++seed) {
    const AmrHierarchy h(random_mesh(seed, options));
    const auto positions = probe_positions(h, 16, seed);
    for (const EncodingCase& c : encoding_cases()) {
      const auto together = refusals.try_build(h, c, {.field = 1, .more_fields = {2, 0}});
      if (!together) continue;
      for (int number = 0; number < 3; ++number) {
        SCOPED_TRACE(fmt::format("seed {}: {}, field number {}", seed, c.name(), number));
        const EncodedField alone = build(h, c, {.field = (number + 1) % 3});
        const auto expected = values_of(probe_on_cpu(h, alone, Precision::single_precision, positions));
        const Comparison bits =
            compare(positions, expected, probe_on_cpu(h, *together, Precision::single_precision, positions, number), 0.0);
        EXPECT_TRUE(bits) << bits;
      }
    }
  }
  refusals.print();
}

TEST(Differential, GlIsTheReferenceAndTheCpusBitsOnRandomMeshes) {
  // each case on one of nine meshes, and every third on OSMesa: all meshes see every encoding, and the CPU all cases above
  Refusals refusals;
  for (const ContextKind kind : kContexts)
    for (std::uint64_t seed = 0; seed < (kind == ContextKind::egl ? 9u : 3u); ++seed) {
      const AmrHierarchy h(random_mesh(100 + seed, small_meshes()));
      const auto positions = probe_positions(h, 16, seed);
      for (const EncodingCase& c : encoding_cases()) {
        if (!chosen(seed, number_of(c), 9)) continue;
        const auto filterings = c.filterings();
        const Filtering filtering = filterings[seed % filterings.size()];
        SCOPED_TRACE(fmt::format("{} seed {}: {} {}", context_kind_name(kind), 100 + seed, c.name(), filtering_name(filtering)));
        const auto field = refusals.try_build(h, c, {.filtering = filtering, .limits = handle_limits(kind)});
        if (!field) continue;
        Context& gl = context(kind);
        const auto on_gl = probe_on_gl(gl, h, Structure(gl, *field), positions);
        const double hardware = filtering == Filtering::hardware ? 0x1p-12 : 0;
        const Comparison result =
            compare(positions, reference_values(h, field->definition, positions), on_gl, [&](std::size_t i) {
              return 1e-5 * value_range(h) + (hardware > 0 ? hardware * local_range(h, on_gl[i].level, positions[i]) : 0);
            });
        EXPECT_TRUE(result) << result;
        if (filtering == Filtering::hardware) continue;
        const auto on_cpu = probe_on_cpu(h, *field, Precision::single_precision, positions);
        const Comparison same = compare(positions, values_of(on_cpu), on_gl, 1e-6 * value_range(h));
        EXPECT_TRUE(same) << "CPU float: " << same;
      }
    }
  refusals.print();
}

TEST(Differential, BuildsHaveTheSameBytesAtAnyThreadCount) {
  for (std::uint64_t seed = 0; seed < 24; ++seed)
    for (const EncodingCase& c : encoding_cases()) {
      SCOPED_TRACE(fmt::format("seed {}: {}", seed, c.name()));
      std::set<std::string> hashes;
      for (const std::size_t threads : {1, 2}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        const AmrHierarchy h(random_mesh(seed, small_meshes()));
        Refusals refusals;
        if (const auto field = refusals.try_build(h, c, {})) {
          hashes.insert(field->content_hash() + field->statistics.dump());
          EXPECT_EQ(field->build_parameters.size(), c.encoding->parameters().size()) << "defaults are filled in";
        }
      }
      EXPECT_LE(hashes.size(), 1u);
    }
}

TEST(Differential, ContentHashesSeeEveryByte) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const EncodingCase& c : encoding_cases()) {
    EncodedField field = build(h, c);
    const std::string before = field.content_hash();
    for (HostTexture& t : field.textures) {
      t.data.back() ^= std::byte{1};
      EXPECT_NE(field.content_hash(), before) << c.name() << " " << t.name;
      t.data.back() ^= std::byte{1};
    }
    EXPECT_EQ(field.content_hash(), before);
  }
}

TEST(Differential, RolesSumToBytesAndBytesAreWhatGlWasAskedFor) {
  Context& gl = context(ContextKind::egl);
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const AmrHierarchy h(random_mesh(seed, small_meshes()));
    for (const EncodingCase& c : encoding_cases()) {
      SCOPED_TRACE(fmt::format("seed {}: {}", seed, c.name()));
      Refusals refusals;
      const auto field = refusals.try_build(h, c, {});
      if (!field) continue;
      std::int64_t bytes = 0;
      for (const HostTexture& t : field->textures) {
        EXPECT_EQ(t.roles.total(), t.bytes()) << t.name;
        EXPECT_EQ(static_cast<std::int64_t>(t.data.size()), t.bytes()) << t.name;
        EXPECT_GE(std::min({t.roles.payload, t.roles.duplicated, t.roles.topology, t.roles.padding}), 0) << t.name;
        bytes += t.bytes();
      }
      EXPECT_EQ(field->memory().total(), bytes);
      EXPECT_EQ(GpuField(*field, gl).bytes(), bytes);
      EXPECT_GE(field->host_peak_bytes, bytes);
    }
  }
}

TEST(Differential, BudgetsAreRefusedBeforeAllocationWithTheBytes) {
  const AmrHierarchy h = MeshBuilder(Vec3i(80)).root(waves).hierarchy();  // 512 000 cells: 2 MB of floats
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    BuildRequest request;
    request.needs.filter = c.filter;
    request.parameters = c.parameters;
    const std::int64_t bytes = c.encoding->build(h, request).memory().total();
    request.memory_limit = bytes;
    EXPECT_EQ(c.encoding->build(h, request).memory().total(), bytes) << "the limit itself is allowed";
    for (const std::int64_t limit : {bytes - 1, std::int64_t{1} << 20}) {
      request.memory_limit = limit;
      try {
        c.encoding->build(h, request);
        ADD_FAILURE() << "built with a limit of " << limit << " bytes";
      } catch (const BudgetError& e) {
        const std::string message = e.what();
        EXPECT_NE(message.find(std::string(c.encoding->name())), std::string::npos) << message;
        EXPECT_NE(message.find(fmt::format("limit is {} bytes", limit)), std::string::npos) << message;
        EXPECT_NE(message.find(fmt::format("needs {} bytes", bytes)), std::string::npos) << message;
        EXPECT_NE(message.find("most of it: "), std::string::npos) << message;
      }
    }
  }
}

TEST(Differential, UnknownParametersAndMissingFiltersAreAnsweredWithWhatThereIs) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(waves).hierarchy();
  for (const Encoding* e : all_encodings()) {
    BuildRequest request;
    request.needs.filter = e->filters().front();
    request.parameters = Json{{"no_such_parameter", 1}};
    try {
      e->build(h, request);
      ADD_FAILURE() << e->name();
    } catch (const UsageError& error) {
      for (const ParameterInfo& p : e->parameters())
        EXPECT_NE(std::string(error.what()).find(p.name), std::string::npos) << error.what();
    }
    request.parameters = Json::object();
    for (const Filter filter : all_filters()) {
      if (std::find(e->filters().begin(), e->filters().end(), filter) != e->filters().end()) continue;
      request.needs.filter = filter;
      try {
        e->build(h, request);
        ADD_FAILURE() << e->name() << " " << filter_name(filter);
      } catch (const UnsupportedError& error) {
        for (const Filter has : e->filters())
          EXPECT_NE(std::string(error.what()).find(filter_name(has)), std::string::npos) << error.what();
      }
    }
  }
}

}  // namespace
}  // namespace amrtex
