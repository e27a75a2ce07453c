#include "bench/measure/picture_look.hpp"

#include <limits>

#include "renderers/scene/framing.hpp"

namespace amrtex {
namespace {

std::string shown_quantity(const Scene& scene, const std::string& field, const std::string& color_field) {
  const Isosurfaces& iso = scene.settings.isosurfaces;
  if (scene.settings.draws_surfaces() && iso.output == Output::depth) return "distance";
  if (scene.settings.mode == Mode::iso && !iso.color_field.empty()) return color_field;
  return field + (scene.settings.mode == Mode::projection ? " x length" : "");
}

}  // namespace

TransferFunction shown_colors(const Scene& scene) {
  const RenderSettings& s = scene.settings;
  if (s.picture_channels() == 1) return {};
  if (s.draws_volume()) return scene.transfer_function;
  return s.draws_surfaces() && s.isosurfaces.output == Output::color ? surface_colors(scene) : TransferFunction{};
}

std::string shown_quantity(const Scene& scene, const std::string& field) {
  return shown_quantity(scene, field, scene.settings.isosurfaces.color_field);
}

std::string shown_quantity(const Scene& scene, const AmrHierarchy& mesh) {
  const auto named = [&](int field) {
    const std::string& unit = mesh.unit(field);
    return mesh.fields()[static_cast<std::size_t>(field)] + (unit.empty() ? "" : " [" + unit + "]");
  };
  const std::string& color_field = scene.settings.isosurfaces.color_field;
  return shown_quantity(scene, named(0), color_field.empty() ? "" : named(mesh.field_index(color_field)));
}

Picture without_outside(const Picture& picture, const Scene& scene, const DomainGeometry& geometry) {
  if (picture.channels != 1 || scene.settings.mirror) return picture;
  Picture inside = picture;
  const CameraFrame camera = camera_frame(scene.view, picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      if (!meets_box(camera_ray(camera, x, y, picture.width, picture.height), geometry.lower, geometry.upper))
        *inside.pixel(x, y) = std::numeric_limits<double>::quiet_NaN();
  return inside;
}

}  // namespace amrtex
