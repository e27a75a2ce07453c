#include "structures/generators/random_mesh.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  write_amrex_plotfile(AmrHierarchy(random_mesh(3)), folder / "plt");
  return folder / "plt";
}

}  // namespace amrtex::fuzz
