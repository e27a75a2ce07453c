#include "structures/readers/flash_hdf5/flash_test_tools.hpp"
#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  test::write_flash(folder / "m_hdf5_plt_cnt_0000", test::mesh_of_blocks({"dens", "h1"}));
  return folder / "m_hdf5_plt_cnt_0000";
}

}  // namespace amrtex::fuzz
