// Changes of the input that must leave the picture alone, or change it in a known way.
#include "bench/verify/pictures.hpp"
#include "bench/verify/verify.hpp"

namespace amrtex::verify {
namespace {

constexpr int kPixels = 14;

/// Two levels, nothing symmetric; `place` takes a point of the mesh to where f is asked.
AmrHierarchy mesh(const Vec3i& axes, const std::array<bool, 3>& mirrored, double edge, const Function& f) {
  const auto place = [=](const Vec3d& p) {
    Vec3d q;
    for (int a = 0; a < 3; ++a) q[axes[a]] = mirrored[static_cast<std::size_t>(a)] ? 1 - p[a] / edge : p[a] / edge;
    return f(q);
  };
  const Box box{{2, 3, 4}, {6, 5, 7}};  // of 8 cells, along the axes of f
  Box own;
  for (int a = 0; a < 3; ++a) {
    const bool turned = mirrored[static_cast<std::size_t>(a)];
    own.lower[a] = turned ? 8 - box.upper[axes[a]] : box.lower[axes[a]];
    own.upper[a] = turned ? 8 - box.lower[axes[a]] : box.upper[axes[a]];
  }
  return MeshBuilder(Vec3i(8), {2}, Vec3d(0), Vec3d(edge)).root(place).patch(1, own.refined(2), place).hierarchy();
}

constexpr Vec3i kAxes(0, 1, 2);
constexpr std::array<bool, 3> kPlain{false, false, false};

Scene scene_of(const View& view, Mode mode = Mode::dvr) {
  Scene s = small_scene(mode, view, Sampling::adaptive, kPixels);
  s.transfer_function = peaks();
  s.settings.step = 0.5;
  return s;
}

View moved(const View& view, const Vec3i& axes, const std::array<bool, 3>& mirrored, double edge) {
  View other = view;
  for (int a = 0; a < 3; ++a) {
    const bool turned = mirrored[static_cast<std::size_t>(a)];
    const auto put = [&](double q) { return (turned ? 1 - q : q) * edge; };
    other.eye[a] = put(view.eye[axes[a]]);
    other.at[a] = put(view.at[axes[a]]);
    other.up[a] = turned ? -view.up[axes[a]] : view.up[axes[a]];
  }
  return other;
}

Picture flipped(const Picture& p) {
  Picture q = p;
  for (int y = 0; y < p.height; ++y)
    for (int x = 0; x < p.width; ++x) std::copy_n(p.pixel(p.width - 1 - x, y), p.channels, q.pixel(x, y));
  return q;
}

/// The difference that an ulp of a ray makes: with nearest, one sample in the next cell.
double tolerance(const EncodingCase& c) { return interpolates(c.filter) ? 1e-6 : 0.05; }

void placements(VerifyContext& v) {
  const AmrHierarchy h = mesh(kAxes, kPlain, 1, waves);
  const View view = perspective({2.1, -1.6, 1.3}, {0.47, 0.52, 0.5});
  const auto compare = [&](const std::string& name, const Vec3i& axes, const std::array<bool, 3>& mirrored, double edge,
                           bool turns) {
    const AmrHierarchy other = mesh(axes, mirrored, edge, waves);
    const View other_view = moved(view, axes, mirrored, edge);
    v.for_each_filter("23 " + name + ": the same picture, double", [&](const EncodingCase& c) {
      Scene s = scene_of(view);
      // trees divide the axes in their order: only the lattice's positions do not depend on regions. It
      // rounds down along each axis, which a mirror turns round.
      if (axes != kAxes) s.settings.sampling = Sampling::lattice;
      Scene other_scene = s;
      other_scene.view = other_view;
      const Picture expected = render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true);
      const Picture got = render_on_cpu(other, v.build(other, c, {.storage = Storage::r64f}), other_scene, true);
      return at_most(difference(turns ? flipped(got) : got, expected), tolerance(c));
    });
  };
  // an odd permutation or one mirror turns a right-handed picture into its mirror image
  compare("axes in the order y z x", {1, 2, 0}, kPlain, 1, false);
  compare("axes in the order y x z", {1, 0, 2}, kPlain, 1, true);
  compare("mirrored along x", kAxes, {true, false, false}, 1, true);
  compare("mirrored along y and z", kAxes, {false, true, true}, 1, false);
  compare("twice as large", kAxes, kPlain, 2, false);
  v.for_each_filter("23 control: mirrored along x, seen unmirrored", [&](const EncodingCase& c) {
    const AmrHierarchy other = mesh(kAxes, {true, false, false}, 1, waves);
    const Picture expected = render_on_cpu(h, v.build(h, c), scene_of(view), true);
    return above(difference(render_on_cpu(other, v.build(other, c), scene_of(view), true), expected), 0.01);
  });
}

void transfer_functions(VerifyContext& v) {
  const View view = perspective({2.1, -1.6, 1.3}, {0.47, 0.52, 0.5});
  const AmrHierarchy h = mesh(kAxes, kPlain, 1, waves);
  const AmrHierarchy doubled = mesh(kAxes, kPlain, 1, [](const Vec3d& p) { return 2 * waves(p); });
  v.for_each_filter("23 values and the transfer function's axis times 2, double", [&](const EncodingCase& c) {
    Scene s = scene_of(view);
    const Picture expected = render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true);
    for (auto& p : s.transfer_function.extinction) p.value *= 2;
    for (auto& p : s.transfer_function.color) p.value *= 2;
    return at_most(difference(render_on_cpu(doubled, v.build(doubled, c, {.storage = Storage::r64f}), s, true), expected), 1e-12);
  });
  const AmrHierarchy large = mesh(kAxes, kPlain, 4, waves);
  v.for_each_filter("23 4 times as large, extinction a world length a quarter, double", [&](const EncodingCase& c) {
    Scene s = scene_of(view);
    const Picture expected = render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true);
    Scene far = scene_of(moved(view, kAxes, kPlain, 4));
    far.transfer_function.length_unit = TransferFunction::LengthUnit::world;
    for (auto& p : far.transfer_function.extinction) p.extinction /= 4;
    return at_most(difference(render_on_cpu(large, v.build(large, c, {.storage = Storage::r64f}), far, true), expected),
                   tolerance(c));
  });
}

/// Along x, 16 finest cells in steps of a half: both ways and both halves see the same samples.
Scene aligned(double sense) {
  Scene s = scene_of(orthographic({0.5, 0.47, 0.52}, {sense, 0, 0}, 0.7));
  s.settings.sampling = Sampling::lattice;
  return s;
}

void directions(VerifyContext& v) {
  const AmrHierarchy h = mesh(kAxes, kPlain, 1, waves);
  v.for_each_filter("23 front to back and back to front: one opacity, GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    const Picture there = draw(v.gl(), h, field, aligned(1));
    const Picture back = flipped(draw(v.gl(), h, field, aligned(-1)));
    double worst = 0;
    for (int y = 0; y < kPixels; ++y)
      for (int x = 0; x < kPixels; ++x) worst = std::max(worst, std::abs(there.pixel(x, y)[3] - back.pixel(x, y)[3]));
    // positions lie half a quantum of 2^-12 cells to one side: slope of the field times extinction times length
    return at_most(worst, interpolates(c.filter) ? 2e-3 : 1e-6);
  });
  v.for_each_filter("23 two halves of the domain, composited, double", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    Scene s = aligned(1);
    const Picture whole = render_on_cpu(h, field, s, true);
    s.region = {Vec3d(0), Vec3d(0.5, 1, 1)};
    const Picture front = render_on_cpu(h, field, s, true);
    s.region = {Vec3d(0.5, 0, 0), Vec3d(1)};
    const Picture behind = render_on_cpu(h, field, s, true);
    Picture both = front;
    for (int y = 0; y < kPixels; ++y)
      for (int x = 0; x < kPixels; ++x)
        for (int k = 0; k < 4; ++k) both.pixel(x, y)[k] += (1 - front.pixel(x, y)[3]) * behind.pixel(x, y)[k];
    return at_most(difference(both, whole), 1e-6);
  });
}

}  // namespace

void metamorphic_suite(VerifyContext& v) {
  placements(v);
  transfer_functions(v);
  directions(v);
}

}  // namespace amrtex::verify
