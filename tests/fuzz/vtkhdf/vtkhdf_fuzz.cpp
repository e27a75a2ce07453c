#include "structures/generators/random_mesh.hpp"
#include "structures/readers/vtkhdf/vtkhdf_writer.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  RandomMeshOptions options;
  options.empty_levels = false;
  write_vtkhdf(AmrHierarchy(random_mesh(3, options)), folder / "m.vtkhdf");
  return folder / "m.vtkhdf";
}

}  // namespace amrtex::fuzz
