// Sizes that files and specifications ask for, which may be anything.
#pragma once

#include <cstdint>
#include <limits>

namespace amrtex {

/// A count of cells or bytes, at least 0. Products and sums that leave 63 bits stay at the most instead of wrapping round,
/// so that a comparison with any limit still says what it should.
class CheckedSize {
 public:
  static constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();

  /// A negative count is a mistake in what it was read from and is taken for too many.
  constexpr CheckedSize(std::int64_t value = 0) : value_(value < 0 ? kMost : value) {}
  static constexpr CheckedSize of(std::uint64_t value) {
    return value > static_cast<std::uint64_t>(kMost) ? CheckedSize(kMost) : CheckedSize(static_cast<std::int64_t>(value));
  }

  /// Does the exact result take at most 63 bits?
  constexpr bool fits() const { return value_ < kMost; }
  /// The result; INT64_MAX where it does not fit.
  constexpr std::int64_t or_most() const { return value_; }

  friend constexpr CheckedSize operator*(CheckedSize a, CheckedSize b) {
    std::int64_t product = 0;
    return {__builtin_mul_overflow(a.value_, b.value_, &product) ? kMost : product};
  }
  friend constexpr CheckedSize operator+(CheckedSize a, CheckedSize b) {
    std::int64_t sum = 0;
    return {__builtin_add_overflow(a.value_, b.value_, &sum) ? kMost : sum};
  }
  constexpr CheckedSize& operator*=(CheckedSize b) { return *this = *this * b; }
  constexpr CheckedSize& operator+=(CheckedSize b) { return *this = *this + b; }

 private:
  std::int64_t value_;
};

}  // namespace amrtex
