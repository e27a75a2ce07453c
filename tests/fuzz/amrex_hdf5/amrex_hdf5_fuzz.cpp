#include "structures/readers/chombo_hdf5/chombo_test_tools.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  test::ChomboOptions options;
  options.amrex = true;
  test::write_chombo(folder / "m.h5", test::mesh_of_blocks({"a", "b"}), options);
  return folder / "m.h5";
}

}  // namespace amrtex::fuzz
