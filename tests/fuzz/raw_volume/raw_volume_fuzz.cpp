#include <fstream>

#include "tests/fuzz/reader_fuzz.hpp"

namespace amrtex::fuzz {

std::filesystem::path write_seed(const std::filesystem::path& folder) {
  std::string values(6 * 5 * 4 * 2, char{7});
  std::ofstream(folder / "m.nrrd", std::ios::binary) << "NRRD0005\ntype: ushort\ndimension: 3\nsizes: 6 5 4\nencoding: "
                                                        "raw\nendian: little\nspacings: 1 1 2\nspace origin: (0,1,2)\n"
                                                        "sample units: \"K\"\n\n"
                                                     << values;
  return folder / "m.nrrd";
}

}  // namespace amrtex::fuzz
