// The older ways to draw AMR volumes, on the same contract: box by box instead of ray by ray. They differ in what a pixel's ray
// takes from a box and in which order boxes are blended; the field, its samples and its light are the raycaster's text.
//   multipass       one pass a box, front to back; the ray is marched inside of it (the raycaster that Kähler and Abel 2013
//                   compare with)
//   slices          box by box from back to front, each as planes perpendicular to the direction of view, whose distance is
//                   `step` cell widths of the box's level (Kähler and Hege 2002, section 7)
//   stencil_slices  the same planes one after the other through the whole domain, on each the finest level first; the stencil
//                   buffer keeps coarser ones out of its pixels (section 5 there: the baseline)
#pragma once

#include <span>

#include "renderers/consumers/consumer.hpp"
#include "renderers/consumers/scene_resources.hpp"
#include "renderers/consumers/screen_polygons.hpp"
#include "renderers/gpu/draw_target.hpp"
#include "renderers/gpu/gpu_timer.hpp"
#include "renderers/gpu/structure.hpp"

namespace amrtex {

class BoxConsumer final : public Consumer {
 public:
  /// Throws UnsupportedError for surfaces, early_end, eight bits of anything but colour, an encoding without boxes, and a context
  /// whose vertex shaders cannot read the field's buffers. The structure and the context must outlive the object.
  BoxConsumer(Context& context, const DomainGeometry& geometry, const Structure& structure, const Scene& scene);

  /// The host's part is done anew each frame, as if the view had moved: order, polygons, upload.
  FrameTime draw() override;
  double gpu_ms_a_draw(int draws) override;
  Picture read() const override;
  WorkCounts count() override;
  std::vector<PixelWork> count_pixels() override;
  const std::string& shader_hash() const override { return program_.hash(); }
  bool transfer_exact() const override { return resources_.transfer_exact(); }

 private:
  struct Vertex {
    Vec3f corner_and_slice;  ///< corner on screen; the number of the slice, which is whole
    Vec3i cell;              ///< lower cell of the box
  };
  /// Polygons of one draw.
  struct Pass {
    std::size_t first;
    std::size_t count;
    int slice;  ///< of stencil_slices
  };
  struct Frame {
    std::vector<Vertex> vertices;
    std::vector<GLint> first;    ///< vertex of a polygon
    std::vector<GLsizei> count;  ///< vertices of a polygon
    std::vector<Pass> passes;
  };
  /// Numbers of the planes that may meet a box, a multiple of `every` each.
  struct SliceRange {
    int first, last;
    int every;
  };

  Program make_program(bool counting) const;
  void bind(Program& program) const;
  SliceRange slices_of(const DrawBox& box) const;
  Frame make_frame() const;
  void add_boxes(Frame& frame) const;
  void add_slices(Frame& frame) const;
  void add_slices_one_by_one(Frame& frame) const;
  void add_polygon(Frame& frame, const ScreenPolygon& polygon, const DrawBox& box, int slice) const;
  void end_pass(Frame& frame, std::size_t first, int slice) const;
  void upload(const Frame& frame) const;
  void draw_frame(const Frame& frame) const;
  void draw_passes(const Frame& frame, const DrawTarget& target) const;
  void set_blending(bool counting) const;
  void reset_state() const;
  std::vector<int> visiting_order() const;

  Context* context_;
  const DrawTree* tree_;
  const GpuField* gpu_;
  Scene scene_;
  SceneResources resources_;
  FinestCamera camera_;
  ScreenPolygons polygons_;
  std::vector<int> level_widths_;  ///< finest cells
  double first_slice_ = 0;         ///< units: depth of slice 0
  Program program_;
  DrawTarget target_;
  GpuTimer timer_;
  GlVertexArray vertex_array_;
  GlBuffer vertices_;
};

}  // namespace amrtex
