#include "structures/mesh/exact_hash.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <memory>
#include <type_traits>

namespace amrtex {
namespace {

class Hasher {
 public:
  Hasher() { XXH3_128bits_reset(state_.get()); }

  template <class T>
  void add(std::span<const T> numbers) {
    static_assert(std::is_arithmetic_v<T>);
    XXH3_128bits_update(state_.get(), numbers.data(), numbers.size_bytes());
  }
  void add(std::int64_t number) { add(std::span<const std::int64_t>(&number, 1)); }
  void add(const Vec3i& v) {
    for (int axis = 0; axis < 3; ++axis) add(std::int64_t{v[axis]});
  }
  void add(const Vec3d& v) {
    const double corner[] = {v.x, v.y, v.z};
    add(std::span<const double>(corner));
  }

  std::string digits() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(state_.get());
    return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
  }

 private:
  struct Free {
    void operator()(XXH3_state_t* state) const { XXH3_freeState(state); }
  };
  std::unique_ptr<XXH3_state_t, Free> state_{XXH3_createState()};
};

/// As doubles, whatever their type: equal values have one hash.
void add_values(Hasher& hasher, const CellValues& values) {
  std::array<double, 4096> some;
  for (std::size_t at = 0; at < values.size(); at += some.size()) {
    const std::span<double> part(some.data(), std::min(some.size(), values.size() - at));
    values.copy(at, part);
    hasher.add(std::span<const double>(part));
  }
}

}  // namespace

std::string exact_hash(const AmrHierarchy& mesh, std::span<const int> fields) {
  Hasher hasher;
  hasher.add(mesh.domain_lower());
  hasher.add(mesh.domain_upper());
  hasher.add(std::int64_t{mesh.level_count()});
  hasher.add(static_cast<std::int64_t>(fields.size()));
  for (int level = 0; level < mesh.level_count(); ++level) {
    hasher.add(mesh.cells(level));
    hasher.add(static_cast<std::int64_t>(mesh.patches(level).size()));
    for (const Patch& patch : mesh.patches(level)) {
      hasher.add(patch.box.lower);
      hasher.add(patch.box.upper);
      for (const int field : fields) add_values(hasher, patch.values[static_cast<std::size_t>(field)]);
    }
  }
  return hasher.digits();
}

}  // namespace amrtex
