#include "bench/measure/cached_reference.hpp"

#include "bench/measure/scene_data.hpp"
#include "bench/records/record.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {

namespace fs = std::filesystem;

Picture cached_reference(const AmrHierarchy& hierarchy, FilterDefinition definition, const Scene& scene, double step,
                         const fs::path& folder, std::string& hash) {
  Json key = {{"scene", scene_reference(scene)}, {"data", exact_data_hash(hierarchy, scene)}};
  key["filter"] = filter_name(definition.filter);
  key["page"] = {definition.page_size, definition.page_level};
  key["step"] = step;
  key["method"] = 1;
  hash = configuration_hash(key);
  const fs::path path = folder / (hash + ".npy");
  if (fs::exists(path)) try {
      return read_npy(path);
    } catch (const Error&) {
      // damaged, by whatever befell the disk: what can be drawn again concerns no point
    }
  const Picture picture = HierarchyReference(hierarchy, 0, definition).render(scene, step);
  make_folder(folder);
  write_npy(picture, path, true);
  return picture;
}

}  // namespace amrtex
