// The error by cause: each cause where it can be said in advance what it must do, and nothing where it is absent.
#include "bench/measure/error_split.hpp"

#include <gtest/gtest.h>

#include "renderers/cpu/sampled_reference.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

constexpr double kStep = 1.0 / 16;  // of the reference, finest cells

/// A structure on the context and what splits its pictures' error.
struct Explained {
  const AmrHierarchy& hierarchy;
  EncodingCase c;
  std::optional<Structure> structure;

  Explained(const AmrHierarchy& h, const EncodingCase& encoding_case, Storage storage = Storage::r32f,
            Filtering filtering = Filtering::manual)
      : hierarchy(h), c(encoding_case) {
    BuildRequest request;
    request.storage = storage;
    request.needs.filter = c.filter;
    request.needs.filtering = filtering;
    request.parameters = c.parameters;
    request.context = gl().info();
    structure.emplace(gl(), c.encoding->build(h, request), request);
  }

  static Context& gl() { return context(ContextKind::egl); }

  Picture picture(const Scene& scene) const {
    Raycaster raycaster(gl(), hierarchy, *structure, scene);
    raycaster.draw();
    return raycaster.read();
  }
  ErrorSplit split(const Scene& scene, const AnalyticField* truth = nullptr) const {
    const Picture reference = HierarchyReference(hierarchy, 0, structure->field.definition).render(scene, kStep);
    return split_error({hierarchy, *c.encoding, *structure, gl(), scene, reference, picture(scene), kStep, truth});
  }
};

Scene scene_of_mode(Mode mode, Sampling sampling = Sampling::lattice, double step = 1) {
  Scene scene;
  scene.view = perspective({2.3, 1.9, 1.5}, Vec3d(0.5));
  scene.settings.mode = mode;
  scene.settings.sampling = sampling;
  scene.settings.step = step;
  scene.settings.width = scene.settings.height = 16;
  scene.transfer_function.extinction = {{0.2, 0}, {0.6, 6}, {1.0, 20}};
  scene.transfer_function.color = {{0.2, {0.1, 0.2, 0.9}}, {1.0, {0.9, 0.6, 0.1}}};
  if (scene.settings.draws_surfaces()) scene.settings.isosurfaces.values = {0.55};
  return scene;
}

double rmse(const ErrorSplit& split, std::string_view cause) { return split.of(cause) ? split.of(cause)->rmse : kNan; }
double worst(const ErrorSplit& split, std::string_view cause) { return split.of(cause) ? split.of(cause)->max : kNan; }

EncodingCase page_table(Filter filter) { return default_case(find_encoding("page_table"), filter); }

/// A mesh over a constant or linear field, for closed forms.
AmrHierarchy linear_mesh(double slope) {
  return MeshBuilder({16, 16, 16}).root([=](const Vec3d& p) { return 0.5 + slope * (p.x - 0.5); }).hierarchy();
}

TEST(ErrorSplit, ClosesForEveryEncodingAndMode) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  // every mode with another encoding, and both samplings: what is asked is that differences add up, of whatever picture
  constexpr std::array kModes{Mode::dvr, Mode::projection, Mode::mip, Mode::iso, Mode::dvr_iso};
  const GlPairs pairs(kModes.size(), [&](const EncodingCase& c) { return accepted(h, c); });
  pairs.for_each([&](const EncodingCase& c, std::size_t pair) {
    const Explained explained(h, c, Storage::r32f, c.filterings().back());
    const Mode mode = kModes[pair % kModes.size()];
    const Sampling sampling = pair % 2 == 0 ? Sampling::lattice : Sampling::adaptive;
    SCOPED_TRACE(fmt::format("{} {}", mode_name(mode), sampling_name(sampling)));
    const ErrorSplit split = explained.split(scene_of_mode(mode, sampling));
    // a sum of at most 8 doubles of pictures below 16, and the context draws the same floats twice
    EXPECT_LE(split.sum_closes, 16 * 8 * 0x1p-52);
    EXPECT_EQ(split.of("filtering").has_value(), explained.structure->field.filtering == Filtering::hardware);
    EXPECT_FALSE(split.of("early_end"));
  });
}

/// Largest difference of a picture of the encoding with a double payload, in double, to one of the reference's values
/// at the same places.
double encoding_error(const AmrHierarchy& h, const EncodedField& exact, const Scene& scene) {
  const HierarchyReference reference(h, 0, exact.definition);
  const FieldValues values = [&](const FinestPosition& p, int) { return reference.sample(p); };
  return difference(render_on_cpu(h, exact, scene, true), render_sampled(h, exact, scene, values));
}

TEST(ErrorSplit, AnEncodingThatIsItsFilterAddsNothing) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    if (!accepted(h, c) || !accepted(h, c, {.storage = Storage::r64f})) return;  // else its payload is part of it
    const EncodedField exact = build(h, c, {.storage = Storage::r64f});
    for (const Mode mode : {Mode::dvr, Mode::projection, Mode::mip, Mode::dvr_iso})
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        SCOPED_TRACE(fmt::format("{} {}", mode_name(mode), sampling_name(sampling)));
        Scene scene = scene_of_mode(mode, sampling);
        scene.settings.isosurfaces.shading = Shading::none;  // gradients may be stored, at the encoding's own places
        // nearest: one value fetched, the same light; linear: interpolated in another order
        double bound = c.filter == Filter::nearest ? 4 * 0x1p-52 : 1e-12;
        // hits of two bisections agree to the tolerance, 2^-10 of 1/16; the light between them is at most 20 times that
        if (scene.settings.draws_surfaces()) bound = 20.0 / 16 / 1024;
        EXPECT_LE(encoding_error(h, exact, scene), bound);
      }
  });
}

// Values of one code each: |decoded - value| <= half a quantum, (max - min) / 255 / 2 or / 65535 / 2, and a line
// integral of filtered errors is at most that times the chord.
TEST(ErrorSplit, StorageIsAtMostHalfAQuantumAlongTheChord) {
  const AmrHierarchy h = linear_mesh(0.8);
  const Scene scene = scene_of_mode(Mode::projection, Sampling::lattice, 0.5);
  double longest = 0;
  for (int y = 0; y < scene.settings.height; ++y)
    for (int x = 0; x < scene.settings.width; ++x) longest = std::max(longest, chord(scene, x, y, Vec3d(0), Vec3d(1)));
  const double range = value_range(h);
  struct Row {
    Storage storage;
    double quantum;
  };
  for (const Row& row : {Row{Storage::r8, range / 255}, Row{Storage::r16, range / 65535}, Row{Storage::r16f, range * 0x1p-10}})
    for (const Filter filter : {Filter::nearest, Filter::linear_page}) {
      SCOPED_TRACE(fmt::format("{} {}", format_name(row.storage), filter_name(filter)));
      const EncodingCase c = page_table(filter);
      const ErrorSplit split = Explained(h, c, row.storage).split(scene);
      EXPECT_LE(worst(split, "storage"), row.quantum / 2 * longest * 1.001);
      EXPECT_GT(worst(split, "storage"), 0);
      EXPECT_LE(worst(split, "encoding"), 1e-12);
      EXPECT_LT(worst(split, "arithmetic") + worst(split, "driver"), 1e-4);
    }
}

// A constant that lies half a quantum off its code: the integral is off by that times the chord, exactly. One cell of
// another value, at the domain's corner, gives the storage its range.
TEST(ErrorSplit, StorageOfAConstantIsItsRoundingTimesTheChord) {
  const double value = 100.4 / 255;
  const AmrHierarchy h = MeshBuilder({16, 16, 16})
                             .root([&](const Vec3d& p) {
                               const Vec3i c(p * 16.0);
                               if (c == Vec3i(0)) return 0.0;
                               return c == Vec3i(0, 0, 1) ? 1.0 : value;
                             })
                             .hierarchy();
  Scene scene = scene_of_mode(Mode::projection, Sampling::lattice, 0.5);
  scene.view = orthographic(Vec3d(0.75), {-0.3, -0.4, -0.2}, 0.3);  // past the two cells
  const EncodingCase c = page_table(Filter::nearest);
  const ErrorSplit split = Explained(h, c, Storage::r8).split(scene);
  double expected = 0;
  for (int y = 0; y < scene.settings.height; ++y)
    for (int x = 0; x < scene.settings.width; ++x)
      expected = std::max(expected, chord(scene, x, y, Vec3d(0), Vec3d(1)) * (0.4 / 255));
  EXPECT_NEAR(worst(split, "storage"), expected, 1e-9);
  for (const std::string_view cause : split_causes())
    if (cause != "storage" && split.of(cause)) {
      EXPECT_LT(rmse(split, cause), 0.01 * rmse(split, "storage")) << cause;
    }
}

// The texture unit's normalised coordinate: at most 2^-14 of the local difference of values. Along a ray it is weighed by the
// chord.
TEST(ErrorSplit, HardwareFilteringStaysInItsBound) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const GlPairs pairs(2, [](const EncodingCase& c) { return c.filterings().back() == Filtering::hardware; });
  pairs.for_each([&](const EncodingCase& c) {
    const Scene scene = scene_of_mode(Mode::projection);
    const ErrorSplit split = Explained(h, c, Storage::r32f, Filtering::hardware).split(scene);
    ASSERT_TRUE(split.of("filtering"));
    EXPECT_LE(worst(split, "filtering"), value_range(h) * 0x1p-14 * std::sqrt(3.0));
  });
}

// Exponential midpoint of a field that is smooth along the whole ray: order 2, so half a step leaves a quarter.
TEST(ErrorSplit, StepFallsWithOrderTwo) {
  const AmrHierarchy h = linear_mesh(0.8);
  const EncodingCase c = page_table(Filter::linear_page);
  const Explained explained(h, c);
  Scene scene = scene_of_mode(Mode::dvr);
  scene.view = orthographic(Vec3d(0.5), {-1, -0.3, -0.2}, 0.2);
  scene.region = std::array{Vec3d(0.125, 0, 0), Vec3d(0.875, 1, 1)};  // the linear part, off the clamped boundary
  scene.transfer_function.extinction = {{0, 0}, {1, 8}};
  double before = kNan;
  for (const double step : {2.0, 1.0, 0.5, 0.25}) {
    scene.settings.step = step;
    const ErrorSplit split = explained.split(scene);
    if (!std::isnan(before)) {
      EXPECT_NEAR(std::log2(before / rmse(split, "step")), 2, 0.25) << step;
    }
    before = rmse(split, "step");
  }
  EXPECT_GT(before, 0);
}

// Behind an opacity a no more than 1 - a of light is left.
TEST(ErrorSplit, EarlyEndTakesAtMostWhatIsLeft) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodingCase c = page_table(Filter::linear_page);
  const Explained explained(h, c);
  Scene scene = scene_of_mode(Mode::dvr);
  double least = 0;
  for (const double opacity : {0.99, 0.9, 0.5}) {
    scene.settings.early_end = opacity;
    const ErrorSplit split = explained.split(scene);
    ASSERT_TRUE(split.of("early_end"));
    EXPECT_LE(worst(split, "early_end"), 1 - opacity + 1e-6);
    EXPECT_GE(worst(split, "early_end"), least);
    EXPECT_LE(split.sum_closes, 1e-14);
    least = worst(split, "early_end");
  }
  EXPECT_GT(least, 0);
}

/// Adds a little to every value that the structure holds.
void mutate(EncodedField& field) {
  for (HostTexture& t : field.textures)
    if (t.holds_values)
      for (std::int64_t i = 0; i < t.texels(); ++i)
        store_value(t.format, {}, load_value(t.format, {}, t.data.data(), static_cast<std::size_t>(i)) + 0.01, t.data.data(),
                    static_cast<std::size_t>(i));
}

/// An encoding that builds what another does, and then spoils it.
class Spoilt final : public Encoding {
 public:
  explicit Spoilt(const Encoding& whole) : whole_(whole) {}
  std::string_view name() const override { return whole_.name(); }
  std::span<const Filter> filters() const override { return whole_.filters(); }
  std::vector<ParameterInfo> parameters() const override { return whole_.parameters(); }
  void check_parameters(const Json& parameters) const override { whole_.check_parameters(parameters); }
  Support supported(const ContextInfo& info) const override { return whole_.supported(info); }
  EncodedField build(const AmrHierarchy& h, const BuildRequest& request) const override {
    EncodedField field = whole_.build(h, request);
    mutate(field);
    return field;
  }

 private:
  const Encoding& whole_;
};

TEST(ErrorSplit, ASpoiltTextureIsTheEncodingsErrorAlone) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const Encoding* encoding : all_encodings()) {
    SCOPED_TRACE(encoding->name());
    const EncodingCase c = default_case(*encoding, encoding->filters().front());
    const Spoilt spoilt(*c.encoding);
    EncodingCase spoilt_case = c;
    spoilt_case.encoding = &spoilt;
    const Scene scene = scene_of_mode(Mode::projection);
    const ErrorSplit whole = Explained(h, c).split(scene);
    const ErrorSplit split = Explained(h, spoilt_case).split(scene);
    EXPECT_EQ(rmse(split, "step"), rmse(whole, "step"));  // the reference and its samples do not see it
    EXPECT_GT(worst(split, "encoding"), 0.005);           // 0.01 times a chord of up to sqrt(3)
    EXPECT_LT(worst(split, "arithmetic") + worst(split, "driver"), 1e-4);
  }
}

// Spoilt on the context alone: the CPU's pictures are whole, so it is the driver's.
TEST(ErrorSplit, ATextureThatIsSpoiltOnTheContextIsTheDriversError) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodingCase c = page_table(Filter::linear_page);
  Explained explained(h, c);
  EncodedField spoilt = explained.structure->field;
  mutate(spoilt);
  explained.structure->gpu = GpuField(spoilt, Explained::gl());
  const ErrorSplit split = explained.split(scene_of_mode(Mode::projection));
  EXPECT_LE(worst(split, "encoding"), 1e-12);
  EXPECT_LT(worst(split, "arithmetic"), 1e-4);
  EXPECT_GT(worst(split, "driver"), 0.005);
}

/// f(p) = 0.2 + 0.6 x: what a linear filter reproduces inside the domain.
class LinearField final : public AnalyticField {
 public:
  double value(const Vec3d& p) const override { return 0.2 + 0.6 * p.x; }
  Vec3d gradient(const Vec3d&) const override { return {0.6, 0, 0}; }
};

TEST(ErrorSplit, FilterIsWhatTheFilterDoesToTheAnalyticField) {
  const LinearField truth;
  const AmrHierarchy h = MeshBuilder({16, 16, 16}).root([&](const Vec3d& p) { return truth.value(p); }).hierarchy();
  for (const Mode mode : {Mode::dvr, Mode::projection, Mode::mip}) {
    SCOPED_TRACE(mode_name(mode));
    Scene scene = scene_of_mode(mode);
    scene.region = std::array{Vec3d(1.0 / 32), Vec3d(31.0 / 32)};  // half a cell: beyond it the boundary is clamped
    const EncodingCase linear = page_table(Filter::linear_page);
    const ErrorSplit exact = Explained(h, linear).split(scene, &truth);
    ASSERT_TRUE(exact.filter);
    EXPECT_LT(exact.filter->max, 1e-6);
    // nearest is off by up to half a cell: 0.6 / 16 / 2
    const EncodingCase nearest = page_table(Filter::nearest);
    const ErrorSplit steps = Explained(h, nearest).split(scene, &truth);
    ASSERT_TRUE(steps.filter);
    EXPECT_GT(steps.filter->max, 1e-5);
    if (mode != Mode::dvr) {
      EXPECT_LE(steps.filter->max, 0.6 / 32 * std::sqrt(3.0));
    }
  }
  EXPECT_FALSE(Explained(h, page_table(Filter::nearest)).split(scene_of_mode(Mode::iso), &truth).filter);
  EXPECT_THROW(HierarchyReference(h, 0, {}).render(scene_of_mode(Mode::iso), kStep, truth), UsageError);
}

TEST(ErrorSplit, RecordsHoldAPairForEachCauseAndNullForWhatIsAbsent) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const Json json = split_json(Explained(h, page_table(Filter::nearest)).split(scene_of_mode(Mode::dvr)));
  for (const char* cause : {"step", "encoding", "storage", "arithmetic", "driver"}) {
    EXPECT_TRUE(json.at(cause).at("rmse").is_number()) << cause;
    EXPECT_TRUE(json.at(cause).at("max").is_number()) << cause;
  }
  for (const char* absent : {"filtering", "early_end", "filter"}) EXPECT_TRUE(json.at(absent).is_null()) << absent;
  EXPECT_TRUE(json.at("sum_closes").is_number());
}

}  // namespace
}  // namespace amrtex
