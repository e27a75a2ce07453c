#include "structures/readers/enzo/enzo_test_tools.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  test::write_enzo(folder, test::mesh_of_blocks({"Density"}));
  return folder;
}

}  // namespace amrtex::fuzz
