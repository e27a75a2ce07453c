#include "structures/generators/random_mesh.hpp"
#include "structures/readers/npz_mesh/npz_mesh.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  write_npz_mesh(AmrHierarchy(random_mesh(3)), folder / "m.npz");
  return folder / "m.npz";
}

}  // namespace amrtex::fuzz
