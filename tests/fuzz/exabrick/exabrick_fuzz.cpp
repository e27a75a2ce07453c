#include "structures/generators/random_mesh.hpp"
#include "structures/readers/exabrick/exabrick.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  RandomMeshOptions options;
  options.power_of_two_ratios = true;
  write_exabrick(AmrHierarchy(random_mesh(3, options)), folder / "m.cells");
  return folder / "m.cells";
}

}  // namespace amrtex::fuzz
