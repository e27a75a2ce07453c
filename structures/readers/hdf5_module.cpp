// The formats over HDF5 as the program finds them: in its module, or linked into a test.
#include "structures/readers/amrex_hdf5/amrex_hdf5.hpp"
#include "structures/readers/chombo_hdf5/chombo_hdf5.hpp"
#include "structures/readers/enzo/enzo.hpp"
#include "structures/readers/flash_hdf5/flash_hdf5.hpp"
#include "structures/readers/hdf5_formats.hpp"
#include "structures/readers/vtkhdf/vtkhdf_reader.hpp"
#include "structures/readers/vtkhdf/vtkhdf_writer.hpp"

const amrtex::Hdf5Formats* amrtex_hdf5_formats() {
  using namespace amrtex;
  /// One line a format; the first whose probe says yes reads.
  static constexpr MeshFormat read[] = {
      {"AMReX-HDF5 (`plotfile_type`)", is_amrex_hdf5, read_amrex_hdf5},
      {"Chombo (`Chombo_global`)", is_chombo_hdf5, read_chombo_hdf5},
      {"Enzo (`NAME.hierarchy`)", is_enzo, read_enzo},
      {"FLASH (`sim info`)", is_flash_hdf5, read_flash_hdf5},
      {"VTKHDF (group `VTKHDF`)", is_vtkhdf, read_vtkhdf},
  };
  static constexpr Hdf5Formats formats{hdf5_module_layout(), read, write_vtkhdf};
  return &formats;
}
