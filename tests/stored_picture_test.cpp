// Pictures beside records: half floats over their own range, in a file that NumPy reads.
#include "bench/records/stored_picture.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <utility>

#include "structures/mesh/error.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kInf = std::numeric_limits<double>::infinity();

Picture noise(double low, double high, int channels = 4) {
  Picture picture(7, 5, channels);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> chance(0, 1);
  for (double& v : picture.values) {
    const double t = chance(random);
    v = low * (1 - t) + high * t;
  }
  return picture;
}

double largest_error(const Picture& a, const Picture& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) most = std::max(most, std::abs(a.values[i] - b.values[i]));
  return most;
}

class StoredPictures : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  StoredPicture there_and_back(const StoredPicture& stored) const {
    write_stored_picture(path_, stored);
    return read_stored_picture(path_);
  }
  fs::path folder_ = fs::temp_directory_path() / fmt::format("amrtex_stored_picture_{}", ::getpid());
  fs::path path_ = folder_ / "a.npz";
};

// A half float has 11 bits: just below 1 two of them are 2^-11 apart, so rounding is off by at most 2^-12 of the scale, which is half the range.
TEST_F(StoredPictures, AreWithinTwoToTheMinusTwelveOfHalfTheirRange) {
  for (const auto& [low, high] : {std::pair{0.0, 1.0}, {1e8, 1e8 + 1}, {-3e-40, 2e-40}, {-1e200, 1e300}, {-1.7e308, 1.7e308}}) {
    const Picture picture = noise(low, high);
    const double half_range = high / 2 - low / 2;
    const double rounding_of_the_offset = std::max(std::abs(low), std::abs(high)) * 1e-15;  // in double
    EXPECT_LE(largest_error(there_and_back({picture, std::nullopt}).picture, picture), half_range / 4096 + rounding_of_the_offset)
        << low << " to " << high;
  }
}

TEST_F(StoredPictures, KeepTheSignOfEachDifference) {
  Picture difference = noise(-1e-6, 3e-6);
  difference.values[4] = 0;
  const StoredPicture stored = there_and_back({noise(0, 1), difference});
  ASSERT_TRUE(stored.difference);
  EXPECT_EQ(stored.difference->values[4], 0) << "equal stays equal";
  for (std::size_t i = 0; i < difference.values.size(); ++i) {
    if (std::abs(difference.values[i]) < 3e-6 / 4096) continue;
    EXPECT_EQ(std::signbit(stored.difference->values[i]), std::signbit(difference.values[i]));
  }
  EXPECT_LE(largest_error(*stored.difference, difference), 3e-6 / 4096);
}

TEST_F(StoredPictures, KeepWhatIsNotFiniteAndFlatOnes) {
  Picture picture = noise(2, 3, 1);
  picture.values[0] = std::nan("");
  picture.values[1] = kInf;
  const Picture back = there_and_back({picture, std::nullopt}).picture;
  EXPECT_TRUE(std::isnan(back.values[0]));
  EXPECT_EQ(back.values[1], kInf);
  EXPECT_EQ(back.channels, 1);
  const Picture flat = noise(0.25, 0.25);
  EXPECT_EQ(there_and_back({flat, std::nullopt}).picture.values, flat.values);
}

TEST_F(StoredPictures, OfEqualArraysAreEqualFiles) {
  const auto bytes = [&] {
    write_stored_picture(path_, {noise(0, 1), noise(-1, 1)});
    std::ifstream in(path_, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_EQ(bytes(), bytes());
}

// Python's own zip reader, and the npy format by hand: no code of ours.
TEST_F(StoredPictures, AreReadByPython) {
  Picture picture(2, 1, 1);
  picture.values = {-1, 3};  // scale 2, offset 1: halves -1 and 1
  write_stored_picture(path_, {picture, std::nullopt});
  std::ofstream(folder_ / "read.py") << R"(
import struct, sys, zipfile
z = zipfile.ZipFile(sys.argv[1])
assert z.testzip() is None
assert sorted(z.namelist()) == ["picture.npy", "picture_scale.npy"], z.namelist()
def values(name, code):
    text = z.read(name)
    assert text[:8] == b"\x93NUMPY\x01\x00"
    start = 10 + struct.unpack("<H", text[8:10])[0]
    assert start % 64 == 0
    return eval(text[10:start])["shape"], [v[0] for v in struct.iter_unpack("<" + code, text[start:])]
assert values("picture.npy", "e") == ((1, 2, 1), [-1.0, 1.0]), values("picture.npy", "e")
assert values("picture_scale.npy", "d") == ((2,), [2.0, 1.0])
)";
  EXPECT_EQ(std::system(fmt::format("python3 '{}' '{}'", (folder_ / "read.py").string(), path_.string()).c_str()), 0);
}

TEST_F(StoredPictures, CutOrDamagedAnywhereAreRefused) {
  write_stored_picture(path_, {noise(0, 1), noise(-1, 1)});
  std::ifstream in(path_, std::ios::binary);
  const std::string whole(std::istreambuf_iterator<char>(in), {});
  const auto refused = [&](const std::string& bytes) {
    std::ofstream(path_, std::ios::binary) << bytes;
    try {
      read_stored_picture(path_);
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(path_.string()));
      return true;
    }
    return false;
  };
  for (std::size_t length = 0; length < whole.size(); length += 7) EXPECT_TRUE(refused(whole.substr(0, length))) << length;
  std::string damaged = whole;
  damaged[100] = static_cast<char>(damaged[100] ^ 0x20);  // inside the first array
  EXPECT_TRUE(refused(damaged));
  EXPECT_TRUE(refused("no zip file"));
}

TEST_F(StoredPictures, ThatCannotBeWrittenNameTheFile) {
  try {
    write_stored_picture(folder_ / "absent" / "a.npz", {noise(0, 1), std::nullopt});
    ADD_FAILURE() << "there is no such folder";
  } catch (const OutputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("a.npz"));
  }
}

}  // namespace
}  // namespace amrtex
