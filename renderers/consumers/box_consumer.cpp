#include "renderers/consumers/box_consumer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "renderers/bindings/picture_units.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Stencil values of slices: 1 to this, then from 1 again on a cleared buffer.
constexpr int kStencilValues = 255;
/// Corners of a frame's polygons; beyond, slices are too many to be drawn one by one.
constexpr std::size_t kMostVertices = std::size_t{1} << 26;
/// Slices are counted in floats.
constexpr double kMostSlices = 1 << 23;
/// What `mip` starts from: no sample.
constexpr float kNoMaximum = -std::numeric_limits<float>::infinity();

[[noreturn]] void refuse(const RenderSettings& s, std::string_view reason) {
  throw UnsupportedError(fmt::format("consumer {}: {}", consumer_name(s.consumer), reason));
}

/// The scene again, where these consumers can draw it.
const Scene& require_drawable(const Scene& scene, const EncodedField& field) {
  const RenderSettings& s = scene.settings;
  require_consumer(scene);
  if (s.slice_target == SliceTarget::rgba8 && !s.draws_slices()) refuse(s, "slice_target rgba8 belongs to slices");
  if (field.draw_tree.empty()) refuse(s, fmt::format("encoding {} gives no boxes to draw one by one", field.encoding));
  return scene;
}

DrawTarget make_target(Context& context, const RenderSettings& s, bool counting) {
  const bool eight_bits = s.slice_target == SliceTarget::rgba8 && !counting;
  return {context,
          s.width,
          s.height,
          false,
          eight_bits ? ColorFormat::rgba8 : ColorFormat::rgba32f,
          s.consumer == ConsumerKind::stencil_slices};
}

}  // namespace

BoxConsumer::BoxConsumer(Context& context, const DomainGeometry& geometry, const Structure& structure, const Scene& scene)
    : context_(&context),
      tree_(&structure.field.draw_tree),
      gpu_(&structure.gpu),
      scene_(require_drawable(scene, structure.field)),
      resources_(context, geometry, structure.field, scene),
      camera_(finest_camera(geometry, scene)),
      polygons_(camera_, scene.settings.width, scene.settings.height),
      level_widths_(geometry.level_widths),
      program_(make_program(false)),
      target_(make_target(context, scene.settings, false)),
      timer_(context),
      vertex_array_(make_vertex_array(context)),
      vertices_(make_buffer(context)) {
  const GladGLContext& gl = context.gl();
  // half a step off the middle, where faces of cells are: planes along an axis keep off them
  const Vec3d middle = (camera_.lower + camera_.upper) * 0.5;
  first_slice_ = glm::dot((middle - camera_.eye) / camera_.cells_per_unit, camera_.forward) + 0.5 * scene.settings.step;
  const double slices = glm::length((camera_.upper - camera_.lower) / camera_.cells_per_unit) / scene.settings.step;
  if (scene.settings.draws_slices() && slices > kMostSlices)
    refuse(scene.settings, fmt::format("{:.0f} slices; at most {:.0f} are supported", slices, kMostSlices));

  const GLuint array = vertex_array_.id();
  gl.VertexArrayVertexBuffer(array, 0, vertices_.id(), 0, sizeof(Vertex));
  for (GLuint attribute = 0; attribute < 2; ++attribute) {
    gl.EnableVertexArrayAttrib(array, attribute);
    gl.VertexArrayAttribBinding(array, attribute, 0);
  }
  gl.VertexArrayAttribFormat(array, 0, 3, GL_FLOAT, GL_FALSE, offsetof(Vertex, corner_and_slice));
  gl.VertexArrayAttribIFormat(array, 1, 3, GL_INT, offsetof(Vertex, cell));
  context.check("preparing boxes");
}

Program BoxConsumer::make_program(bool counting) const {
  GLint most = 0;
  context_->make_current();
  context_->gl().GetIntegerv(GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS, &most);
  if (resources_.buffer_count() > most)
    refuse(scene_.settings, fmt::format("a vertex shader of this context reads at most {} storage buffers, the field has {}",
                                        most, resources_.buffer_count()));
  const auto shader = [&](const char* entry) {
    ShaderKey key = resources_.shader_key(entry, counting);
    key.define("AMRTEX_SLICES", scene_.settings.draws_slices() ? 1 : 0);
    key.define("AMRTEX_CLAIM", scene_.settings.consumer == ConsumerKind::stencil_slices ? 1 : 0);
    return assemble_shader(key);
  };
  return {*context_, shader("box.vert"), shader("box.frag")};
}

void BoxConsumer::bind(Program& program) const {
  program.set_optional(UniformValue{"u_first_slice", std::vector<double>{first_slice_}, true});
  resources_.bind(program, *gpu_);
}

// ---- polygons ----

std::vector<int> BoxConsumer::visiting_order() const {
  return front_to_back(*tree_, {camera_.orthographic, camera_.eye, camera_.forward});
}

BoxConsumer::SliceRange BoxConsumer::slices_of(const DrawBox& box) const {
  const double step = scene_.settings.step;
  // of the finest level everywhere, or in proportion to the box's cells; either way multiples of the finest distance
  const int every = scene_.settings.sampling == Sampling::lattice ? 1 : level_widths_[static_cast<std::size_t>(box.level)];
  const auto [nearest, farthest] = polygons_.depths(box.cells);
  if (nearest > farthest || !(farthest > 0)) return {0, -1, every};
  const double margin = 1.0 / 64;
  const auto first = static_cast<int>(std::floor((std::max(nearest, 0.0) - first_slice_) / step - margin));
  const auto last = static_cast<int>(std::ceil((farthest - first_slice_) / step + margin));
  return {ceil_div(first, every) * every, floor_div(last, every) * every, every};
}

void BoxConsumer::add_polygon(Frame& frame, const ScreenPolygon& polygon, const DrawBox& box, int slice) const {
  if (polygon.size() < 3) return;
  if (frame.vertices.size() > kMostVertices)
    refuse(scene_.settings, fmt::format("more than {} corners of polygons in one frame", kMostVertices));
  frame.first.push_back(static_cast<GLint>(frame.vertices.size()));
  frame.count.push_back(static_cast<GLsizei>(polygon.size()));
  for (const glm::dvec2& corner : polygon)
    frame.vertices.push_back({Vec3f(corner.x, corner.y, static_cast<float>(slice)), box.cells.lower});
}

void BoxConsumer::end_pass(Frame& frame, std::size_t first, int slice) const {
  if (frame.first.size() > first) frame.passes.push_back({first, frame.first.size() - first, slice});
}

void BoxConsumer::add_boxes(Frame& frame) const {
  ScreenPolygon polygon;
  for (const int i : visiting_order()) {
    const DrawBox& box = tree_->boxes[static_cast<std::size_t>(i)];
    const std::size_t first = frame.first.size();
    polygons_.cover_box(box.cells, polygon);
    add_polygon(frame, polygon, box, 0);
    end_pass(frame, first, 0);
  }
}

void BoxConsumer::add_slices(Frame& frame) const {
  const std::vector<int> order = visiting_order();
  ScreenPolygon polygon;
  for (auto i = order.rbegin(); i != order.rend(); ++i) {
    const DrawBox& box = tree_->boxes[static_cast<std::size_t>(*i)];
    const std::size_t first = frame.first.size();
    const SliceRange range = slices_of(box);
    for (int n = range.last; n >= range.first; n -= range.every) {
      const double depth = first_slice_ + n * scene_.settings.step;
      if (depth > 0) polygons_.cover_slice(box.cells, depth, polygon);
      if (depth > 0) add_polygon(frame, polygon, box, n);
    }
    end_pass(frame, first, 0);
  }
}

/// Needs no order of boxes, and none of them to be apart from the others: the stencil buffer keeps a pixel of a slice for the
/// finest.
void BoxConsumer::add_slices_one_by_one(Frame& frame) const {
  std::vector<std::vector<std::pair<const DrawBox*, SliceRange>>> levels(level_widths_.size());
  int nearest = std::numeric_limits<int>::max();
  int farthest = std::numeric_limits<int>::min();
  for (const DrawBox& box : tree_->boxes) {
    const SliceRange range = slices_of(box);
    if (range.last < range.first) continue;
    nearest = std::min(nearest, range.first);
    farthest = std::max(farthest, range.last);
    levels[static_cast<std::size_t>(box.level)].emplace_back(&box, range);
  }
  ScreenPolygon polygon;
  for (int n = farthest; n >= nearest; --n) {
    const double depth = first_slice_ + n * scene_.settings.step;
    if (!(depth > 0)) break;
    for (auto level = levels.rbegin(); level != levels.rend(); ++level) {
      const std::size_t first = frame.first.size();
      for (const auto& [box, range] : *level) {
        if (n < range.first || n > range.last || n % range.every != 0) continue;
        polygons_.cover_slice(box->cells, depth, polygon);
        add_polygon(frame, polygon, *box, n);
      }
      end_pass(frame, first, n);
    }
  }
}

BoxConsumer::Frame BoxConsumer::make_frame() const {
  Frame frame;
  if (scene_.settings.consumer == ConsumerKind::multipass)
    add_boxes(frame);
  else if (scene_.settings.consumer == ConsumerKind::slices)
    add_slices(frame);
  else
    add_slices_one_by_one(frame);
  return frame;
}

// ---- drawing ----

void BoxConsumer::upload(const Frame& frame) const {
  context_->gl().NamedBufferData(vertices_.id(), static_cast<GLsizeiptr>(frame.vertices.size() * sizeof(Vertex)),
                                 frame.vertices.data(), GL_STREAM_DRAW);
}

void BoxConsumer::set_blending(bool counting) const {
  const GladGLContext& gl = context_->gl();
  const RenderSettings& s = scene_.settings;
  gl.Enable(GL_BLEND);
  if (counting) {  // sums, and in the last component the largest
    gl.BlendEquationSeparate(GL_FUNC_ADD, GL_MAX);
    gl.BlendFunc(GL_ONE, GL_ONE);
  } else if (s.mode == Mode::mip) {
    gl.BlendEquation(GL_MAX);
  } else {
    gl.BlendEquation(GL_FUNC_ADD);
    if (s.mode == Mode::projection)
      gl.BlendFunc(GL_ONE, GL_ONE);
    else if (s.consumer == ConsumerKind::multipass)
      gl.BlendFunc(GL_ONE_MINUS_DST_ALPHA, GL_ONE);  // under what is there: front to back
    else
      gl.BlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);  // over what is there: back to front
  }
  if (s.consumer == ConsumerKind::stencil_slices) {
    gl.Enable(GL_STENCIL_TEST);
    gl.StencilOp(GL_KEEP, GL_KEEP, GL_REPLACE);
  }
}

/// Other consumers draw with the context's defaults.
void BoxConsumer::reset_state() const {
  const GladGLContext& gl = context_->gl();
  gl.Disable(GL_BLEND);
  gl.BlendEquation(GL_FUNC_ADD);
  gl.Disable(GL_STENCIL_TEST);
  gl.BindVertexArray(0);
}

void BoxConsumer::draw_passes(const Frame& frame, const DrawTarget& target) const {
  const GladGLContext& gl = context_->gl();
  gl.BindVertexArray(vertex_array_.id());
  const bool stencil = scene_.settings.consumer == ConsumerKind::stencil_slices;
  int value = kStencilValues;
  const Pass* before = nullptr;
  for (const Pass& pass : frame.passes) {
    if (stencil && (before == nullptr || pass.slice != before->slice)) {
      if (value == kStencilValues) {
        target.clear_stencil();
        value = 0;
      }
      // a pixel that has this slice's value is taken by a finer level
      gl.StencilFunc(GL_NOTEQUAL, ++value, 0xff);
    }
    gl.MultiDrawArrays(GL_TRIANGLE_FAN, &frame.first[pass.first], &frame.count[pass.first], static_cast<GLsizei>(pass.count));
    before = &pass;
  }
}

FrameTime BoxConsumer::draw() {
  context_->make_current();
  bind(program_);
  context_->gl().Finish();
  const auto start = std::chrono::steady_clock::now();
  const Frame frame = make_frame();
  upload(frame);
  timer_.begin();
  draw_frame(frame);
  timer_.end();
  context_->gl().Finish();
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
  reset_state();
  context_->check("drawing a frame");
  return {wall.count(), timer_.milliseconds()};
}

/// All that the GPU does for a picture.
void BoxConsumer::draw_frame(const Frame& frame) const {
  target_.bind();
  target_.clear(scene_.settings.mode == Mode::mip ? glm::vec4(kNoMaximum) : glm::vec4(0));
  set_blending(false);
  draw_passes(frame, target_);
}

double BoxConsumer::gpu_ms_a_draw(int draws) {
  context_->make_current();
  bind(program_);
  const Frame frame = make_frame();
  upload(frame);
  context_->gl().Finish();
  timer_.begin();
  for (int i = 0; i < draws; ++i) draw_frame(frame);
  timer_.end();
  const double all = timer_.milliseconds();
  reset_state();
  context_->check("timing frames");
  return all / draws;
}

Picture BoxConsumer::read() const {
  const PictureUnits& units = resources_.picture_units();
  Picture picture = target_.read_picture(drawn_channels(units, scene_.settings.picture_channels()));
  if (scene_.settings.mode == Mode::mip && units.offset == 0)
    for (double& v : picture.values)
      if (v <= kNoMaximum) v = 0;
  return in_picture_units(std::move(picture), units);
}

std::vector<PixelWork> BoxConsumer::count_pixels() {
  refuse(scene_.settings, "work is counted by pixels where one ray draws each; accepted: raycast");
}

WorkCounts BoxConsumer::count() {
  Program counting = make_program(true);
  const DrawTarget target = make_target(*context_, scene_.settings, true);
  bind(counting);
  const Frame frame = make_frame();
  upload(frame);
  target.bind();
  target.clear();
  set_blending(true);
  draw_passes(frame, target);
  const Picture counted = target.read_picture(4);
  reset_state();
  context_->check("counting samples");
  WorkCounts counts;
  counts.passes = std::ssize(frame.passes);
  for (std::size_t i = 0; i < counted.values.size(); i += 4) {
    counts.samples += static_cast<std::int64_t>(counted.values[i]);
    counts.regions += static_cast<std::int64_t>(counted.values[i + 1]);
    counts.rays += static_cast<std::int64_t>(counted.values[i + 3]);
  }
  return counts;
}

}  // namespace amrtex
