// Consumers that draw box by box: the boxes and their order, and their pictures against the raycaster's and the reference's.
#include <gtest/gtest.h>

#include <set>

#include "renderers/consumers/make_consumer.hpp"
#include "renderers/consumers/screen_polygons.hpp"
#include "structures/generators/random_mesh.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

// ---- boxes and their order ----

std::optional<EncodedField> try_boxes(const AmrHierarchy& h, const EncodingCase& c) {
  try {
    EncodedField field = build(h, c, {.draw_boxes = true});
    if (field.draw_tree.empty()) return std::nullopt;
    return field;
  } catch (const UnsupportedError&) {
    return std::nullopt;
  }
}

/// Calls f(mesh, field) for random meshes and every case that gives boxes.
template <class F>
void for_each_tree(F&& f) {
  std::set<std::string_view> encodings;
  for (std::uint64_t seed = 300; seed < 316; ++seed) {
    RandomMeshOptions options;
    options.max_finest_cells = 1 << 15;
    const AmrHierarchy h(random_mesh(seed, options));
    for (const EncodingCase& c : encoding_cases()) {
      const auto field = try_boxes(h, c);
      if (!field) continue;
      SCOPED_TRACE(fmt::format("seed {}: {}", seed, c.name()));
      encodings.insert(c.encoding->name());
      f(h, *field);
    }
  }
  for (const char* name : {"uniform", "page_table", "kd_tree"}) EXPECT_TRUE(encodings.contains(name)) << name;
}

TEST(DrawTree, EachPlaceWithAValueLiesInOneBoxOfItsLevelAndTheOthersInOneAtMost) {
  for_each_tree([](const AmrHierarchy& h, const EncodedField& field) {
    const auto positions = probe_positions(h, 8);
    const auto found = probe_on_cpu(h, field, Precision::single_precision, positions);
    for (const DrawBox& b : field.draw_tree.boxes) EXPECT_FALSE(b.cells.empty());
    for (std::size_t i = 0; i < positions.size(); ++i) {
      std::vector<int> levels;
      for (const DrawBox& b : field.draw_tree.boxes)
        if (b.cells.contains(positions[i].cell)) levels.push_back(b.level);
      EXPECT_LE(levels.size(), 1u);
      if (found[i].found) {
        EXPECT_EQ(levels, std::vector<int>{found[i].level});
      }
    }
  });
}

/// Where a ray is in a box, or nothing.
std::optional<std::array<double, 2>> interval(const Box& box, const Vec3d& origin, const Vec3d& direction) {
  double from = 0;
  double to = kInf;
  for (int a = 0; a < 3; ++a) {
    const double t0 = (box.lower[a] - origin[a]) / direction[a];
    const double t1 = (box.upper[a] - origin[a]) / direction[a];
    from = std::max(from, std::min(t0, t1));
    to = std::min(to, std::max(t0, t1));
  }
  if (!(to > from)) return std::nullopt;
  return std::array{from, to};
}

// Along any ray the boxes come one after the other: where the next begins, the one before has ended.
TEST(DrawTree, EveryRayMeetsTheBoxesInTheirOrder) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto vector = [&] { return Vec3d(unit(random), unit(random), unit(random)); };
  std::int64_t pairs = 0;
  for_each_tree([&](const AmrHierarchy& h, const EncodedField& field) {
    const Vec3d middle = Vec3d(h.cells(h.finest_level())) * 0.5;
    for (int view = 0; view < 8; ++view) {  // eyes inside and outside, and parallel rays
      Viewpoint v;
      v.parallel = view % 2 == 1;
      v.eye = middle + vector() * middle * (view < 4 ? 0.9 : 4.0);
      v.direction = vector();
      const std::vector<int> order = front_to_back(field.draw_tree, v);
      EXPECT_EQ(std::set<int>(order.begin(), order.end()).size(), field.draw_tree.boxes.size());
      for (int ray = 0; ray < 20; ++ray) {
        const Vec3d through = middle + vector() * middle;
        const Vec3d direction = v.parallel ? v.direction : through - v.eye;
        const Vec3d origin = v.parallel ? through - v.direction * 1e4 : v.eye;
        double end = 0;
        for (const int i : order) {
          const auto in = interval(field.draw_tree.boxes[static_cast<std::size_t>(i)].cells, origin, direction);
          if (!in) continue;
          EXPECT_GE((*in)[0], end - 1e-9 * (1 + end));
          pairs += end > 0 ? 1 : 0;
          end = (*in)[1];
        }
      }
    }
  });
  EXPECT_GT(pairs, 10000);
}

TEST(DrawTree, IsNotThereWhereNobodyAsksAndNoPartOfTheFieldsBytes) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const EncodingCase& c : encoding_cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField without = build(h, c, {.value_ranges = false});
    EXPECT_TRUE(without.draw_tree.empty());
    EXPECT_EQ(build(h, c, {.value_ranges = false, .draw_boxes = true}).content_hash(), without.content_hash());
  }
}

// ---- pictures ----

TransferFunction cloud() {
  TransferFunction tf;
  tf.extinction = {{0.3, 0}, {0.45, 3}, {1, 12}};
  tf.color = {{0, {1, 0.2, 0}}, {1, {0, 0.5, 1}}};
  return tf;
}

struct NamedView {
  const char* name;
  View view;
};

/// Relative to the domain [0, 1]^3.
std::vector<NamedView> views() {
  View behind = perspective({0.45, 0.6, 0.55}, {1.5, 0.9, 0.7});  // from inside: boxes lie behind the eye and around it
  behind.fov_y = 80;
  View far = perspective({30.1, -41.2, 21.7}, {0.5, 0.5, 0.5});  // beyond 16 diagonals: rays are held in double
  far.fov_y = 2.2;
  return {{"askew", perspective({2.1, -1.2, 1.7}, {0.5, 0.5, 0.5})},
          {"inside", behind},
          {"far", far},
          {"parallel", orthographic({0.5, 0.5, 0.5}, {1, -0.7, 0.4}, 1.8)},
          {"parallel from inside",
           [] {
             View v = orthographic({0.5, 0.5, 0.5}, {0.9, 0.5, -0.4}, 1.2);
             v.eye = {0.5, 0.55, 0.45};
             v.at = {1.4, 1.05, 0.05};
             return v;
           }()},
          {"along an axis", orthographic({0.5, 0.5, 0.5}, {0, 1, 0}, 1.1)},
          {"along an axis, perspective", perspective({0.5, 0.5, 2.5}, {0.5, 0.5, 0.5})}};
}

Scene cloud_scene(const View& view, ConsumerKind consumer, Sampling sampling = Sampling::lattice, Mode mode = Mode::dvr) {
  Scene scene;
  scene.view = view;
  if (view.at.x == view.eye.x && view.at.y == view.eye.y) scene.view.up = {0, 1, 0};
  scene.transfer_function = cloud();
  scene.settings.consumer = consumer;
  scene.settings.sampling = sampling;
  scene.settings.mode = mode;
  scene.settings.step = 0.6;
  scene.settings.width = 40;
  scene.settings.height = 32;
  return scene;
}

Picture draw_scene(const AmrHierarchy& h, const EncodingCase& c, const Scene& scene, WorkCounts* counts = nullptr) {
  Context& gl = context(ContextKind::egl);
  const EncodedField field = build(h, c, {.draw_boxes = scene.settings.consumer != ConsumerKind::raycast});
  const Structure structure(gl, field);
  const auto consumer = make_consumer(gl, h, structure, scene);
  consumer->draw();
  Picture picture = consumer->read();
  if (counts != nullptr) *counts = consumer->count();
  return picture;
}

EncodingCase kd_case(Filter filter) { return {&find_encoding("kd_tree"), filter, Json::object()}; }

/// Differs by the association of sums and products alone: some units in the last place a box.
constexpr double kAssociation = 2e-6;

int differing_pixels(const Picture& a, const Picture& b, double tolerance) {
  int pixels = 0;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      bool differ = false;
      for (int i = 0; i < a.channels; ++i) differ = differ || !(std::abs(a.pixel(x, y)[i] - b.pixel(x, y)[i]) <= tolerance);
      pixels += differ ? 1 : 0;
    }
  return pixels;
}

/// `adaptive` positions start where the ray enters a region, which the raycaster sums up and multi-pass computes: the same to
/// rounding. f of `nearest` jumps, and of a ray that crosses a box of n cells in an odd number of intervals, n even, the middle
/// sample lies on a face between two cells: there rounding decides, in either picture.
void expect_multipass(const AmrHierarchy& h, const EncodingCase& c, Scene scene, double tolerance = kAssociation) {
  scene.settings.consumer = ConsumerKind::raycast;
  const Picture expected = draw_scene(h, c, scene);
  EXPECT_GT(largest(expected), 0.05);
  scene.settings.consumer = ConsumerKind::multipass;
  const Picture picture = draw_scene(h, c, scene);
  if (!interpolating(c) && scene.settings.sampling == Sampling::adaptive)
    EXPECT_LE(differing_pixels(picture, expected, tolerance), expected.width * expected.height / 50);
  else
    EXPECT_LE(difference(picture, expected), tolerance * std::max(1.0, largest(expected)));
}

TEST(Multipass, IsTheRaycastersPictureForEveryEncodingAndFilter) {
  const AmrHierarchy h = nested(waves).hierarchy();
  std::size_t drawn = 0;
  for_each_filter([&](const EncodingCase& c) {
    if (!try_boxes(h, c)) return;
    ++drawn;
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      if (!in_turn(sampling == Sampling::lattice ? 0 : 1, drawn, 2)) continue;
      SCOPED_TRACE(sampling_name(sampling));
      expect_multipass(h, c, cloud_scene(views()[0].view, ConsumerKind::multipass, sampling));
    }
  });
  EXPECT_GE(drawn, 8u);
}

TEST(Multipass, IsTheRaycastersPictureFromEveryView) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const NamedView& v : views())
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      SCOPED_TRACE(fmt::format("{}, {}", v.name, sampling_name(sampling)));
      expect_multipass(h, kd_case(Filter::linear_lod), cloud_scene(v.view, ConsumerKind::multipass, sampling));
    }
}

TEST(Multipass, IsTheRaycastersPictureOnEveryMesh) {
  const std::vector<NamedMesh> meshes = conformance_meshes();
  for (std::size_t number = 0; number < meshes.size(); ++number)
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      if (!in_turn(sampling == Sampling::lattice ? 0 : 1, number, 2)) continue;  // both on the view's own mesh above
      const NamedMesh& mesh = meshes[number];
      SCOPED_TRACE(fmt::format("{}, {}", mesh.name, sampling_name(sampling)));
      const AmrHierarchy& h = mesh.hierarchy;
      const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
      const View view = perspective(middle + (h.domain_upper() - h.domain_lower()) * Vec3d(1.1, -1.7, 0.8), middle);
      expect_multipass(h, kd_case(Filter::linear_vertex), cloud_scene(view, ConsumerKind::multipass, sampling));
    }
}

TEST(Multipass, DrawsLineIntegralsMaximaAndPartsOfTheDomain) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const Mode mode : {Mode::projection, Mode::mip}) {
    SCOPED_TRACE(mode_name(mode));
    const Scene scene = cloud_scene(views()[0].view, ConsumerKind::multipass, Sampling::lattice, mode);
    expect_multipass(h, kd_case(Filter::linear_lod), scene, mode == Mode::mip ? 0 : kAssociation);
  }
  Scene part = cloud_scene(views()[0].view, ConsumerKind::multipass);
  part.region = {Vec3d(0.21, 0.3, 0.13), Vec3d(0.77, 0.84, 0.9)};
  expect_multipass(h, kd_case(Filter::linear_lod), part);
}

// Lattice samples belong to the ray, so both take the same ones, and skip the same ones.
TEST(Multipass, TakesTheRaycastersSamples) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const std::size_t view : {0, 1, 2, 5})
    for (const bool skip : {true, false}) {
      if (view != 0 && !skip) continue;
      const NamedView v = views()[view];
      SCOPED_TRACE(fmt::format("{}, skip {}", v.name, skip));
      Scene scene = cloud_scene(v.view, ConsumerKind::multipass);
      scene.settings.skip = skip;
      WorkCounts one, many;
      draw_scene(h, kd_case(Filter::nearest), scene, &many);
      scene.settings.consumer = ConsumerKind::raycast;
      draw_scene(h, kd_case(Filter::nearest), scene, &one);
      EXPECT_EQ(many.samples, one.samples);
      EXPECT_GT(many.samples, 0);
      EXPECT_EQ(one.passes, 1);
      EXPECT_GT(many.passes, 1);
    }
}

// ---- slices ----

// Per pixel they are the same fragments in the same order.
TEST(Slices, OneByOneWithTheStencilBufferAreTheSameBits) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const NamedView& v : views()) {
    SCOPED_TRACE(v.name);
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      WorkCounts by_box, by_slice;
      const bool counted = v.view.orthographic && sampling == Sampling::adaptive;
      const Picture boxes = draw_scene(h, kd_case(Filter::linear_vertex), cloud_scene(v.view, ConsumerKind::slices, sampling),
                                       counted ? &by_box : nullptr);
      const Picture slices =
          draw_scene(h, kd_case(Filter::linear_vertex), cloud_scene(v.view, ConsumerKind::stencil_slices, sampling),
                     counted ? &by_slice : nullptr);
      EXPECT_GT(largest(boxes), 0.05);
      EXPECT_EQ(boxes.values, slices.values);
      if (!counted) continue;
      EXPECT_EQ(by_box.samples, by_slice.samples);
      EXPECT_GT(by_box.samples, 0);
      EXPECT_GT(by_slice.passes, by_box.passes);
    }
  }
}

// Boxes that overlap are what the stencil buffer is for: whatever is drawn twice on a slice, a pixel takes it once.
TEST(Slices, OneByOneTakeAPixelOnceWhereBoxesOverlap) {
  Context& gl = context(ContextKind::egl);
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const ConsumerKind consumer : {ConsumerKind::slices, ConsumerKind::stencil_slices}) {
    const Scene scene = cloud_scene(views()[0].view, consumer, Sampling::adaptive);
    Structure structure(gl, build(h, kd_case(Filter::linear_lod), {.draw_boxes = true}));
    EncodedField& field = structure.field;
    const auto drawn = [&] {
      const auto c = make_consumer(gl, h, structure, scene);
      c->draw();
      return c->read().values;
    };
    const auto once = drawn();
    // each leaf becomes two that draw the same box
    const std::size_t leaves = field.draw_tree.nodes.size();
    for (std::size_t i = 0; i < leaves; ++i) {
      const DrawNode leaf = field.draw_tree.nodes[i];
      if (leaf.box < 0) continue;
      const DrawBox box = field.draw_tree.boxes[static_cast<std::size_t>(leaf.box)];
      const std::size_t child = field.draw_tree.split(i, 0, box.cells.lower.x);
      field.draw_tree.nodes[child].box = leaf.box;
      field.draw_tree.set_box(child + 1, box.cells, box.level);
    }
    EXPECT_EQ(drawn() == once, consumer == ConsumerKind::stencil_slices);
  }
}

// Every pixel of a slice is one box's: constant light, seen along an axis on slices in the middle of n intervals of length h,
// gives C = c (1 - exp(-kappa n h)) to rounding, whatever the boxes; of the domain, or of the part that is drawn.
TEST(Slices, AlongAnAxisGiveTheSlabsLight) {
  const double kappa = 3;
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  for (const ConsumerKind consumer : {ConsumerKind::slices, ConsumerKind::stencil_slices})
    for (const Vec3d& direction : {Vec3d(1, 0, 0), Vec3d(0, 0, -1)}) {
      Scene scene = cloud_scene(orthographic(Vec3d(0.5), direction, 0.9), consumer);
      scene.view.up = {0, 1, 0};
      scene.transfer_function = constant_light(kappa);
      scene.settings.step = 1;  // 32 finest cells along x and z
      for (const bool part : {false, true}) {
        if (part) scene.region = {Vec3d(0.25, 0, 0.25), Vec3d(0.75, 1, 0.75)};
        const Picture p = draw_scene(h, kd_case(Filter::nearest), scene);
        const double alpha = 1 - std::exp(-kappa * (part ? 0.5 : 1));
        for (int y = 0; y < p.height; ++y) {
          EXPECT_NEAR(p.pixel(20, y)[3], alpha, 2e-6);
          EXPECT_NEAR(p.pixel(20, y)[0], 0.75 * alpha, 2e-6);
        }
        EXPECT_EQ(p.pixel(0, 16)[3], 0);
      }
    }
}

// A ray of length L in the domain meets L / l slices, one more or one less, each of which stands for l = h / cos of it.
TEST(Slices, InPerspectiveAreOffByOneSliceAtMost) {
  const double kappa = 3;
  const double step = 0.75;
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  Scene scene = cloud_scene(views()[0].view, ConsumerKind::slices);
  scene.transfer_function = constant_light(kappa);
  scene.settings.step = step;
  const Picture p = draw_scene(h, kd_case(Filter::linear_lod), scene);
  const RenderSettings& s = scene.settings;
  const CameraFrame camera = camera_frame(scene.view, s.width, s.height);
  const double cell = glm::min(glm::min(h.spacing(2).x, h.spacing(2).y), h.spacing(2).z);
  for (int y = 0; y < s.height; ++y)
    for (int x = 0; x < s.width; ++x) {
      const double length = chord(scene, x, y, Vec3d(0), Vec3d(1));
      const double slice = step * cell / glm::dot(camera_ray(camera, x, y, s.width, s.height).direction, camera.forward);
      EXPECT_LE(p.pixel(x, y)[3], 1 - std::exp(-kappa * (length + slice)) + 1e-6);
      EXPECT_GE(p.pixel(x, y)[3], 1 - std::exp(-kappa * std::max(length - slice, 0.0)) - 1e-6);
    }
}

// Inside of a level a slice is a midpoint of second order; at the ends of the ray and where the level changes, the last slice
// stands for up to half a distance too much or too little, of either sign: the first order remains.
TEST(Slices, ConvergeToTheReferenceWithTheFirstOrder) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodingCase c = kd_case(Filter::linear_vertex);
  const Scene first = cloud_scene(views()[0].view, ConsumerKind::slices);
  const Picture reference = HierarchyReference(h, 0, build(h, c).definition).render(first, 0.0625);
  for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
    SCOPED_TRACE(sampling_name(sampling));
    std::vector<double> errors;
    for (const double step : {1.0, 0.25, 0.0625}) {
      Scene scene = first;
      scene.settings.sampling = sampling;
      scene.settings.step = step;
      errors.push_back(rms_difference(draw_scene(h, c, scene), reference));
    }
    const double order = std::log2(errors.front() / errors.back()) / 4;
    std::cout << fmt::format("slices, {}: rmse {:.2e} {:.2e} {:.2e}, order {:.2f}\n", sampling_name(sampling), errors[0],
                             errors[1], errors[2], order);
    EXPECT_GT(order, 0.8);
    EXPECT_LT(errors.back(), sampling == Sampling::lattice ? 1e-3 : 4e-3);  // level 0 has a quarter of the slices
  }
}

// 256 slices of opacity a / 256: in eight bits each is rounded by up to 1/510, and rounding does not average out.
TEST(Slices, InEightBitsLoseWhatFloatsKeep) {
  const AmrHierarchy h = MeshBuilder(Vec3i(64)).root(constant(1)).hierarchy();
  Scene scene = cloud_scene(orthographic(Vec3d(0.5), {1, 0, 0}, 0.9), ConsumerKind::slices);
  scene.transfer_function = constant_light(1);
  scene.settings.step = 0.25;
  const double alpha = 1 - std::exp(-1);
  const auto error = [&](SliceTarget target) {
    scene.settings.slice_target = target;
    return std::abs(draw_scene(h, kd_case(Filter::nearest), scene).pixel(20, 16)[3] - alpha);
  };
  EXPECT_LT(error(SliceTarget::rgba32f), 2e-6);
  const double eight = error(SliceTarget::rgba8);
  std::cout << fmt::format("256 slices in eight bits: off by {:.3f}\n", eight);
  EXPECT_GT(eight, 0.03);
  EXPECT_LT(eight, 0.3);
}

// ---- what is refused ----

std::string refusal(const Scene& scene, const std::string& encoding = "kd_tree") {
  const AmrHierarchy h = nested(waves).hierarchy();
  try {
    draw_scene(h, {&find_encoding(encoding), Filter::linear_lod, Json::object()}, scene);
    return "drawn";
  } catch (const UnsupportedError& e) {
    return e.what();
  }
}

TEST(BoxConsumers, RefuseByNameWhatTheyCannotDraw) {
  const Scene plain = cloud_scene(views()[0].view, ConsumerKind::slices);
  Scene scene = plain;
  EXPECT_EQ(refusal(scene, "octree"), "consumer slices: encoding octree gives no boxes to draw one by one");
  scene.settings.consumer = ConsumerKind::multipass;
  scene.settings.mode = Mode::iso;
  scene.settings.isosurfaces.values = {0.5};
  EXPECT_NE(refusal(scene).find("not iso"), std::string::npos) << refusal(scene);
  scene = plain;
  scene.settings.integrator = Integrator::preintegrated;
  EXPECT_NE(refusal(scene).find("not preintegrated"), std::string::npos) << refusal(scene);
  scene.settings.integrator = Integrator::exponential_midpoint;
  scene.settings.point_light.emplace();
  EXPECT_NE(refusal(scene).find("consumer slices: 'point_light'"), std::string::npos) << refusal(scene);
  scene.settings.point_light.reset();
  scene.settings.early_end = 0.95;
  EXPECT_NE(refusal(scene).find("consumer slices: 'early_end'"), std::string::npos) << refusal(scene);
  scene = plain;
  scene.settings.consumer = ConsumerKind::stencil_slices;
  scene.settings.mode = Mode::mip;
  scene.settings.slice_target = SliceTarget::rgba8;
  EXPECT_NE(refusal(scene).find("consumer stencil_slices: 'slice_target'"), std::string::npos) << refusal(scene);
  scene.settings.slice_target = SliceTarget::rgba32f;
  EXPECT_EQ(refusal(scene), "drawn");
}

// ---- memory of the host ----

TEST(HostArrays, AreGivenBackOnceTheContextHoldsThem) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  Context& gl = context(ContextKind::egl);
  Scene scene = small_scene(Mode::dvr, perspective({1.9, 2.3, 1.7}, Vec3d(0.5)), Sampling::adaptive, 8);
  scene.transfer_function = peaks();
  const auto drawn = [&](const Structure& structure) {
    Raycaster raycaster(gl, h, structure, scene);
    raycaster.draw();
    return raycaster.read().values;
  };
  for_each_encoding([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    const Structure kept(gl, field);
    const Structure given(gl, field, {}, HostArrays::give_back);
    for (const HostTexture& t : kept.field.textures) EXPECT_FALSE(t.data.empty()) << t.name;
    for (const HostTexture& t : given.field.textures) EXPECT_EQ(t.data.capacity(), 0) << t.name;
    EXPECT_EQ(given.field.memory(), field.memory());
    EXPECT_EQ(given.gpu.bytes(), field.memory().total());
    EXPECT_EQ(drawn(given), drawn(kept));
  });
}

}  // namespace
}  // namespace amrtex
