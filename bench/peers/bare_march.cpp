// Google Benchmark program: frames of `uniform` beside a bare march through the same
// dense texture, on the scene of an experiment file (default experiments/limits).
//   build/release/bare_march [experiment.json] [--benchmark_...]
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <optional>

#include "bench/measure/scene_data.hpp"
#include "bench/measure/stopwatch.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/raycaster.hpp"
#include "renderers/gpu/draw_target.hpp"
#include "renderers/gpu/gpu_timer.hpp"

namespace amrtex {
namespace {

/// The scene's transfer function as a texture of evenly spaced entries, and the bare program.
class BareMarch {
 public:
  BareMarch(Context& context, const DomainGeometry& geometry, const EncodedField& field, const Scene& scene)
      : context_(context),
        bindings_(bind_scene(geometry, field, scene)),
        program_(context, assemble_shader(vertex_key()), assemble_shader(fragment_key())),
        target_(context, scene.settings.width, scene.settings.height),
        timer_(context) {
    upload_dense(*field.find("tex_dense"));
    upload_transfer(scene.transfer_function, geometry);
    program_.use();
    for (const UniformValue& u : bindings_.uniforms)
      if (u.name != "u_transfer_axis") program_.set_optional(u);
    program_.set("u_transfer_axis", glm::vec2(axis_));
  }

  FrameTime draw() {
    program_.use();
    program_.bind_texture("tex_dense", dense_.id());
    program_.bind_texture("tex_transfer", transfer_.id());
    context_.gl().Finish();
    const Stopwatch watch;
    timer_.begin();
    target_.draw(program_);
    timer_.end();
    context_.gl().Finish();
    const double wall_ms = watch.seconds() * 1000;
    return {wall_ms, timer_.milliseconds()};
  }

 private:
  static ShaderKey vertex_key() {
    ShaderKey key;
    key.entry = "fullscreen.vert";
    return key;
  }
  static ShaderKey fragment_key() {
    ShaderKey key;
    key.entry = "bare_march.frag";
    key.define("AMRTEX_RAY_DOUBLE", 0);
    for (const char* off : {"AMRTEX_CLIP_PLANES", "AMRTEX_RAY_OFFSET", "AMRTEX_MIRROR", "AMRTEX_OCCLUSION"}) key.define(off, 0);
    return key;
  }

  void filter(GLuint id) {
    context_.gl().TextureParameteri(id, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    context_.gl().TextureParameteri(id, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    for (GLenum axis : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R})
      context_.gl().TextureParameteri(id, axis, GL_CLAMP_TO_EDGE);
  }

  void upload_dense(const HostTexture& host) {
    dense_ = make_texture(context_, GL_TEXTURE_3D);
    context_.gl().TextureStorage3D(dense_.id(), 1, GL_R32F, host.size.x, host.size.y, host.size.z);
    const int slab = host.size.z / 4 + 1;
    for (int z = 0; z < host.size.z; z += slab)
      context_.gl().TextureSubImage3D(dense_.id(), 0, 0, 0, z, host.size.x, host.size.y, std::min(slab, host.size.z - z), GL_RED,
                                      GL_FLOAT, host.as<float>() + Box{Vec3i(0), host.size}.offset({0, 0, z}));
    filter(dense_.id());
  }

  void upload_transfer(const TransferFunction& tf, const DomainGeometry& geometry) {
    constexpr int kEntries = 256;
    const double lower = tf.extinction.front().value;
    const double upper = tf.extinction.back().value;
    const Vec3d size = geometry.size();
    const double unit = geometry.spacing.x / std::max({size.x, size.y, size.z});
    std::vector<glm::vec4> entries;
    for (int i = 0; i < kEntries; ++i) {
      const double v = lower + (upper - lower) * i / (kEntries - 1);
      entries.emplace_back(Vec3f(tf.color_at(v)), static_cast<float>(tf.extinction_at(v) * unit));
    }
    transfer_ = make_texture(context_, GL_TEXTURE_2D);
    context_.gl().TextureStorage2D(transfer_.id(), 1, GL_RGBA32F, kEntries, 1);
    context_.gl().TextureSubImage2D(transfer_.id(), 0, 0, 0, kEntries, 1, GL_RGBA, GL_FLOAT, entries.data());
    filter(transfer_.id());
    const double scale = (kEntries - 1) / (upper - lower) / kEntries;
    axis_ = {0.5 / kEntries - lower * scale, scale};
  }

  Context& context_;
  SceneBindings bindings_;
  Program program_;
  DrawTarget target_;
  GpuTimer timer_;
  GlTexture dense_, transfer_;
  glm::dvec2 axis_{0};
};

struct Bench {
  explicit Bench(const std::string& path) {
    const Experiment experiment = read_experiment(path);
    mesh.emplace(load_dataset(experiment, experiment.datasets.front()));
    context = make_context(parse_context(experiment.context));
    RenderPoint render = experiment.renders.front();
    render.settings.sampling = Sampling::lattice;
    render.settings.skip = false;
    const Scene scene = scene_of(experiment, render);
    BuildRequest request;
    request.needs = scene_needs(scene, Filter::linear_page, Filtering::hardware);
    request.context = context->info();
    structure.emplace(*context, find_encoding("uniform").build(*mesh, request), request);
    raycaster.emplace(*context, *mesh, *structure, scene);
    bare.emplace(*context, *mesh, structure->field, scene);
  }
  std::optional<AmrHierarchy> mesh;
  std::unique_ptr<Context> context;
  std::optional<Structure> structure;
  std::optional<Raycaster> raycaster;
  std::optional<BareMarch> bare;
};

template <class Drawer>
void frames(benchmark::State& state, Drawer& drawer) {
  for (auto _ : state) state.SetIterationTime(drawer.draw().wall_ms / 1000);
}

}  // namespace
}  // namespace amrtex

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const std::string path = argc > 1 ? argv[1] : std::string(AMRTEX_SOURCE_DIR "/experiments/limits/experiment.json");
  try {
    amrtex::Bench bench(path);
    const auto add = [](const char* name, auto& drawer) {
      benchmark::RegisterBenchmark(name, [&](benchmark::State& state) { amrtex::frames(state, drawer); })
          ->UseManualTime()
          ->Iterations(1)
          ->Repetitions(9)
          ->Unit(benchmark::kMillisecond)
          ->ReportAggregatesOnly();
    };
    // before and after, since other work on the machine must show
    add("bare_march", *bench.bare);
    add("uniform", *bench.raycaster);
    add("bare_march_again", *bench.bare);
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& error) {
    fmt::print(stderr, "bare_march: {}\n", error.what());
    return 1;
  }
  return 0;
}
