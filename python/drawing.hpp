// Pictures of a mesh that Python holds, and structures built of it.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/cli/render_arguments.hpp"
#include "bench/measure/built.hpp"
#include "bench/settings/experiment.hpp"
#include "python/held_mesh.hpp"
#include "renderers/scene/picture.hpp"

namespace amrtex {

/// GL contexts that were asked for, for the thread that uses them.
class Contexts {
 public:
  /// By the name that `--context` takes. Throws as parse_context() and make_context().
  Context& at(const std::string& name);

 private:
  std::map<std::string, std::unique_ptr<Context>> made_;
};

/// What `amrtex render` is told, of a mesh that is there already.
struct PictureRequest {
  SceneArguments arguments;
  std::string scene;       ///< text of a scene file; empty: everything follows from the data
  std::string scene_name;  ///< for messages
  std::vector<std::string> set;
  std::string context;                       ///< empty: the scene's
  std::optional<std::int64_t> memory_limit;  ///< bytes; absent: the scene's
  std::optional<double> tolerance;           ///< error asked of every channel, of full scale
  bool prune = false;
  bool reference = false;
  std::optional<double> reference_step, reference_tolerance;
};

/// One picture to draw.
struct PlannedPicture {
  Experiment experiment;  ///< of one point
  Scene scene;
  std::shared_ptr<const AmrHierarchy> mesh;  ///< whose first field is the drawn one
  bool free_encoding = false;                ///< nobody said which
};
PlannedPicture plan_picture(HeldMesh& mesh, const PictureRequest& request);
/// Of a scene that names its own data.
PlannedPicture plan_scene(const PictureRequest& request);

struct DrawnPicture {
  Picture picture;
  std::vector<std::string> warnings;
};
/// On a context, or the reference of the picture's filter.
DrawnPicture draw_picture(PlannedPicture planned, const PictureRequest& request, Contexts& contexts);

/// The structure that a caller asked for.
struct StructureRequest {
  std::string field;                                 ///< empty: the first
  std::string encoding, filter, storage, filtering;  ///< empty: the default of experiments
  Json parameters = Json::object();
  std::string context = "egl";
  std::optional<std::int64_t> memory_limit;  ///< bytes
};

class HeldStructure {
 public:
  /// Builds and uploads it.
  HeldStructure(std::shared_ptr<HeldMesh> mesh, const StructureRequest& request, Contexts& contexts);

  const BuildPoint& build() const { return experiment_.builds.front(); }
  const std::string& field() const { return mesh_->fields().front(); }
  const EncodedField& encoded() const { return built_->structure.field; }
  const AmrHierarchy& mesh() const { return *mesh_; }
  double build_seconds() const { return built_->build_seconds; }

  /// Values of the filter at points, world; NaN where there is none.
  std::vector<double> sample(const std::vector<Vec3d>& points, const std::string& column);
  DrawnPicture draw(PictureRequest request, Contexts& contexts);

 private:
  /// Built once more where the scene needs other parts.
  const Structure& structure_for(const PlannedPicture& planned);

  std::shared_ptr<HeldMesh> held_;
  std::shared_ptr<const AmrHierarchy> mesh_;
  Experiment experiment_;  ///< of a scene that asks for no more than the field's values
  Json written_;           ///< `encodings` and what goes with it, as files have it
  Context* context_;
  std::unique_ptr<Built> built_;
  std::unique_ptr<Built> for_scene_;                ///< of the scene drawn last, where it needs other parts
  std::shared_ptr<const AmrHierarchy> scene_mesh_;  ///< that it is of
  std::optional<EncodedField> exact_;               ///< with its payload in double precision
};

/// Values of a filter in double precision, by search in the mesh; NaN where there is none.
std::vector<double> sample_reference(HeldMesh& mesh, const std::string& field, const FilterDefinition& definition,
                                     const std::vector<Vec3d>& points);

}  // namespace amrtex
