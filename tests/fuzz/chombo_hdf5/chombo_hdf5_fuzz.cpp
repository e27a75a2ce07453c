#include "structures/readers/chombo_hdf5/chombo_test_tools.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  test::write_chombo(folder / "m.hdf5", test::mesh_of_blocks({"a", "b"}));
  return folder / "m.hdf5";
}

}  // namespace amrtex::fuzz
