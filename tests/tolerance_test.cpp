// The integrator `tolerance` keeps what is asked of it: on twelve scenes of every kind that hides light from samples, with every
// encoding and filter, against the double reference.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "bench/numbers/image_error.hpp"
#include "bench/settings/experiment.hpp"
#include "structures/generators/hash_random.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
struct AskedScene {
  const char* name;
  AmrHierarchy mesh;
  TransferFunction light;
  View view = perspective({2.3, 1.9, 2.1}, Vec3d(0.5));
};

TransferFunction light_of(std::vector<std::pair<double, double>> extinction, bool logarithmic = false) {
  TransferFunction tf;
  tf.extinction.clear();
  for (const auto& [value, kappa] : extinction) tf.extinction.push_back({value, kappa});
  const double first = extinction.front().first, last = extinction.back().first;
  const double middle = logarithmic ? std::sqrt(first * last) : (first + last) / 2;
  tf.color = {{first, {0, 0, 0.3}}, {middle, {0.9, 0.9, 0.1}}, {last, {0.8, 0, 0}}};
  tf.logarithmic = logarithmic;
  return tf;
}

double noise(const Vec3d& p) { return cell_random(7, 1, 0, Vec3i(p * 1024.0)); }

double blob(const Vec3d& p) { return std::exp(-8 * glm::dot(p - Vec3d(0.45, 0.55, 0.5), p - Vec3d(0.45, 0.55, 0.5))); }

/// A level more in the corner of a level, five times.
AmrHierarchy deep_mesh(const Function& f) {
  MeshBuilder mesh(Vec3i(4), {2, 2, 2, 2});
  mesh.root(f).patch(1, {Vec3i(2), Vec3i(6)}, f);
  for (int level = 2; level <= 4; ++level) mesh.patch(level, {Vec3i(1 << level), Vec3i((1 << level) + 4)}, f);
  return mesh.hierarchy();
}

View close_view(const Vec3d& at) {
  View view = perspective({2.3, 1.9, 2.1}, at);
  view.fov_y = 12;
  return view;
}

std::vector<AskedScene> asked_scenes() {
  const auto hot = [](const Vec3d& p) { return Vec3i(p * 5.0) == Vec3i(2, 3, 1) ? 0.95 : 0.05; };
  const auto hole = [](const Vec3d& p) { return noise(p) < 0.1 ? kNan : noise(p); };
  const auto decades = [](const Vec3d& p) { return std::pow(10.0, -30 + 60 * waves(p)); };
  const auto spike = [](const Vec3d& p) { return 0.02 / (0.02 + glm::length(p - Vec3d(0.28))); };
  const auto shell = [](const Vec3d& p) { return glm::length(p - Vec3d(0.5)); };
  std::vector<AskedScene> scenes;
  scenes.push_back({"smooth", nested(blob).hierarchy(), light_of({{0.05, 0}, {1, 12}})});
  scenes.push_back({"ramp", nested(waves).hierarchy(), light_of({{0, 0}, {0.05, 0}, {0.3, 2}, {0.8, 10}, {1.4, 40}})});
  scenes.push_back({"narrow peak", nested(waves).hierarchy(), light_of({{0.57, 0}, {0.6, 120}, {0.63, 0}})});
  scenes.push_back({"peak of a thousandth", nested(waves).hierarchy(), light_of({{0.5495, 0}, {0.55, 3000}, {0.5505, 0}})});
  scenes.push_back({"hot cell", MeshBuilder(Vec3i(5)).root(hot).hierarchy(), light_of({{0.1, 0}, {0.5, 10}, {0.9, 40}})});
  scenes.push_back({"random", nested(noise).hierarchy(), light_of({{0.4, 0}, {0.7, 30}, {0.75, 3}, {1, 60}})});
  scenes.push_back({"random with NaN", nested(hole).hierarchy(), light_of({{0.4, 0}, {0.7, 30}, {0.75, 3}, {1, 60}})});
  scenes.push_back({"opaque", nested(waves).hierarchy(), light_of({{0.2, 0}, {0.6, 300}, {1, 2000}})});
  scenes.push_back({"stiff", nested(waves).hierarchy(), light_of({{0.1, 0}, {0.5, 1e3}, {0.9, 1e6}})});
  scenes.push_back({"log", nested(decades).hierarchy(), light_of({{1e-30, 0}, {1, 5}, {1e20, 40}, {1e30, 10}}, true)});
  scenes.push_back({"deep mesh", deep_mesh(spike), light_of({{0.05, 0}, {0.2, 4}, {0.9, 200}}), close_view(Vec3d(0.28))});
  scenes.push_back({"shell", nested(shell).hierarchy(), light_of({{0.38, 0}, {0.4, 60}, {0.42, 0}})});
  return scenes;
}

Scene scene_of(const AskedScene& asked, double tolerance, int pixels) {
  Scene scene;
  scene.view = asked.view;
  scene.transfer_function = asked.light;
  scene.settings.integrator = Integrator::tolerance;
  scene.settings.sampling = Sampling::adaptive;
  scene.settings.tolerance = tolerance;
  scene.settings.width = scene.settings.height = pixels;
  return scene;
}

/// Errors of the pixels that are not empty in both pictures, ascending.
std::vector<double> seen_errors(const Picture& picture, const Picture& reference) {
  std::vector<double> errors;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double *a = picture.pixel(x, y), *b = reference.pixel(x, y);
      double error = 0;
      for (int channel = 0; channel < 4; ++channel) error = std::max(error, std::abs(a[channel] - b[channel]));
      if (a[3] != 0 || b[3] != 0) errors.push_back(error);
    }
  std::sort(errors.begin(), errors.end());
  return errors;
}

struct Share {
  double tolerance;
  double within;  ///< of the seen pixels
};
constexpr std::array kAsked{Share{1e-2, 0.99}, Share{1e-3, 0.99}, Share{1e-4, 0.95}};

/// No pixel is off by more: the bounds of its intervals come to 1.5 tolerances, and what lies behind the ray's end is a tenth.
constexpr double kWorst = 1.6;

/// `rounding`: what floats may do to a pixel beside.
void expect_kept(const Picture& picture, const Picture& reference, const Share& asked, double rounding) {
  const std::vector<double> errors = seen_errors(picture, reference);
  ASSERT_GT(errors.size(), 20U) << "nothing is seen";
  EXPECT_GE(share_within(errors, asked.tolerance), asked.within) << "asked " << asked.tolerance;
  EXPECT_LE(errors.back(), kWorst * asked.tolerance + rounding) << "asked " << asked.tolerance;
}

constexpr int kPixels = 32;

class Kept : public testing::TestWithParam<std::size_t> {
 public:
  static const std::vector<AskedScene>& scenes() {
    static const std::vector<AskedScene> all = asked_scenes();
    return all;
  }
  const AskedScene& scene() const { return scenes()[GetParam()]; }
  /// Once for each field that filters and page sizes define.
  struct Judge {
    Picture picture;
    /// Largest difference that rounding of values in float may make: the seven roundings of a trilinear value come to eight times
    /// 2^-24 of it, and light that hangs on them (a ray that grazes a thin peak) on no integrator.
    double rounding;
  };
  const Judge& judge(const FilterDefinition& definition) {
    const auto key = std::tuple(definition.filter, definition.page_size, definition.page_level);
    auto it = judges_.find(key);
    if (it != judges_.end()) return it->second;
    const HierarchyReference reference(scene().mesh, 0, definition);
    const Scene plain = scene_of(scene(), 1, kPixels);
    Judge judge{reference.render(plain), 5e-6};  // of light and positions, in any scene
    for (const double factor : {1 - 0x1p-21, 1 + 0x1p-21}) {
      Scene moved = plain;
      for (auto& p : moved.transfer_function.extinction) p.value *= factor;
      judge.rounding = std::max(judge.rounding, difference(reference.render(moved), judge.picture));
    }
    return judges_.emplace(key, std::move(judge)).first->second;
  }
  /// Is the case asked?
  bool takes(const EncodingCase& c) const { return interpolates(c.filter) && accepted(scene().mesh, c); }

 private:
  std::map<std::tuple<Filter, int, int>, Judge> judges_;
};

TEST_P(Kept, WithEveryEncodingAndFilterInDouble) {
  for_each_filter([&](const EncodingCase& c) {
    if (!takes(c) || !accepted(scene().mesh, c, {.storage = Storage::r64f})) return;
    const EncodedField field = build(scene().mesh, c, {.storage = Storage::r64f});
    for (const Share& asked : kAsked)
      expect_kept(render_on_cpu(scene().mesh, field, scene_of(scene(), asked.tolerance, kPixels), true),
                  judge(field.definition).picture, asked, 1e-7);
  });
}

TEST_P(Kept, WithEveryEncodingAndFilterInFloat) {
  for_each_filter([&](const EncodingCase& c) {
    if (!takes(c)) return;
    const EncodedField field = build(scene().mesh, c);
    const Judge& by = judge(field.definition);
    for (const Share& asked : kAsked)
      expect_kept(render_on_cpu(scene().mesh, field, scene_of(scene(), asked.tolerance, kPixels), false), by.picture, asked,
                  by.rounding);
  });
}

TEST_P(Kept, OnGl) {
  int drawn = 0;
  GlPairs(1, [&](const EncodingCase& c) { return takes(c); }).for_each([&](const EncodingCase& c) {
    ++drawn;
    const EncodedField field = build(scene().mesh, c);
    const Judge& by = judge(field.definition);
    for (const Share& asked : kAsked)
      expect_kept(draw(context(ContextKind::egl), scene().mesh, field, scene_of(scene(), asked.tolerance, kPixels)), by.picture,
                  asked, by.rounding);
  });
  EXPECT_GT(drawn, 0);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Kept, testing::Range(std::size_t{0}, std::size_t{12}), [](const auto& parameter) {
  std::string name = Kept::scenes()[parameter.param].name;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
});

// ---- a picture made by another program ----

TEST(HotCell, IsDrawnAsAnIndependentReaderIntegratesIt) {
  AMRTEX_NEEDS(kFailingInputs, "hot_cell.json");
  const Experiment experiment = read_scene(kFailingInputs / "hot_cell.json");
  const BuildPoint& build = experiment.builds.front();
  const AmrHierarchy mesh(read_mesh(*experiment.datasets.front().file));
  const Picture expected = read_npy(kFailingInputs / "hot_cell.expected.npy");
  Scene scene = amrtex::scene_of(experiment, experiment.renders.front());
  const EncodingCase c{&find_encoding(build.encoding), build.filter, build.parameters};
  for (const Share& asked : kAsked) {
    scene.settings.tolerance = asked.tolerance;
    const Picture picture = render_on_cpu(mesh, test::build(mesh, c), scene, false);
    EXPECT_LE(difference(picture, expected), asked.tolerance);
    EXPECT_LE(difference(draw(context(ContextKind::egl), mesh, test::build(mesh, c), scene), expected), asked.tolerance);
  }
}

}  // namespace
}  // namespace amrtex
