// Changes the bytes of a target's files, always in the same order, and reads what comes of it.
//   fuzz_TARGET [CHANGES] [RANDOM SEED]
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <random>

#include "tests/fuzz/reader_fuzz.hpp"

namespace {

constexpr long kChanges = 300;  ///< what an ordinary test has time for

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  std::size_t below(std::size_t n) { return static_cast<std::size_t>(random_() % std::max<std::size_t>(1, n)); }

  std::string change(std::string bytes) {
    for (std::size_t n = 1 + below(4); n > 0; --n) change_once(bytes);
    return bytes;
  }

 private:
  void change_once(std::string& bytes) {
    const std::size_t at = below(bytes.size());
    if (bytes.empty()) return;
    switch (below(8)) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        return;
      case 1:
        bytes[at] = static_cast<char>(below(256));
        return;
      case 2:
        return bytes.resize(at);
      case 3:
        bytes.erase(at, 1 + below(16));
        return;
      case 4:
        bytes.insert(at, bytes.substr(below(bytes.size()), 1 + below(64)));
        return;
      case 5:
        return replace_number(bytes, at);
      case 6:
        return replace_digits(bytes, at);
      default:
        bytes.replace(at, std::min<std::size_t>(8, bytes.size() - at), 8, static_cast<char>(below(2) == 0 ? 0 : 0xff));
    }
  }
  /// Four or eight bytes become a number that limits like to be.
  void replace_number(std::string& bytes, std::size_t at) {
    constexpr std::array<std::int64_t, 10> kNumbers = {
        0, 1, -1, 127, 255, 65535, 0x7fffffff, -0x80000000LL, 0x7fffffffffffffff, 1000000};
    const std::int64_t number = kNumbers[below(kNumbers.size())];
    const std::size_t length = std::min<std::size_t>(below(2) == 0 ? 4 : 8, bytes.size() - at);
    bytes.replace(at, length, reinterpret_cast<const char*>(&number), length);
  }
  /// A number in a text becomes another one.
  void replace_digits(std::string& bytes, std::size_t at) {
    constexpr std::array<std::string_view, 8> kNumbers = {"0",     "-1",  "2147483647", "2147483648", "9223372036854775807",
                                                          "1e308", "nan", "3"};
    const std::size_t first = bytes.find_first_of("0123456789", at);
    if (first == std::string::npos) return;
    const std::size_t end = std::min(bytes.find_first_not_of("0123456789.", first), bytes.size());
    bytes.replace(first, end - first, kNumbers[below(kNumbers.size())]);
  }

  std::mt19937_64 random_;
};

}  // namespace

int main(int argc, char** argv) {
  const long changes = argc > 1 ? std::atol(argv[1]) : kChanges;
  Mutator mutator(argc > 2 ? static_cast<std::uint64_t>(std::atol(argv[2])) : 1);
  const amrtex::fuzz::Seed seed;
  for (std::size_t file = 0; file < seed.files().size(); ++file)
    if (!seed.read_with(file, seed.files()[file].bytes)) {
      fmt::print(stderr, "the seed itself is refused\n");
      return 1;
    }
  long meshes = 0;
  for (long i = 0; i < changes; ++i) {
    const std::size_t file = mutator.below(seed.files().size());
    meshes += seed.read_with(file, mutator.change(seed.files()[file].bytes)) ? 1 : 0;
  }
  fmt::print("{} changes: {} were meshes still, {} were refused\n", changes, meshes, changes - meshes);
  return 0;
}
