#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>

#include "bench/cli/render_arguments.hpp"
#include "renderers/scene/framing.hpp"

namespace amrtex {

void add_scene_arguments(CLI::App& c, SceneArguments& a) {
  c.add_option("--field", a.field, "field to draw; the first otherwise");
  c.add_option(
      "--colormap", a.color_map,
      fmt::format("{}; or a file: ParaView JSON or XML, .xf, VisIt .ct, Gaussians (docs/color_maps.md); FILE#NAME of several",
                  fmt::join(color_map_names(), ", ")));
  c.add_option("--range", a.range, "first and last value of the colours; percentiles otherwise")->expected(2);
  c.add_flag("--log", a.logarithmic, "colours over log10(value); where positive values span three decades otherwise");
  c.add_option(
       "--opacity-length", a.opacity_length,
       "world length over which an imported opacity is meant; the domain's diagonal by the cube root of its cells otherwise")
      ->check(CLI::PositiveNumber);
  c.add_option("--mode", a.mode, "dvr, projection, mip, iso or dvr_iso; dvr otherwise, or iso with --isovalue");
  c.add_option("--encoding", a.encoding, "encoding; the first that can draw it otherwise");
  c.add_option("--filter", a.filter, "filter of the encoding");
  c.add_option("--size", a.size, "width and height, pixels; 768 768 otherwise")->expected(2)->check(CLI::Range(1, 16384));
  CLI::Option* view = c.add_option("--view", a.view, fmt::format("{}; corner otherwise", fmt::join(framing_names(), ", ")));
  CLI::Option* camera = c.add_option("--camera", a.camera,
                                     "ex ey ez ax ay az ux uy uz: eye, a point it looks at, up, as other programs print them");
  camera->expected(9)->excludes(view);
  c.add_option("--fovy", a.fov_y, "of the camera, degrees; may be written -fovy")->needs(camera);
  c.add_option("--isovalue", a.isovalues, "isosurfaces at these values, as 0.5 or 0.2,0.5")
      ->allow_extra_args(false)
      ->delimiter(',');
}

}  // namespace amrtex
