// Where the values of a volume come from: they need not all be in memory at once.
#pragma once

#include <cstddef>
#include <span>

namespace amrtex {

class VolumeSource {
 public:
  VolumeSource() = default;
  virtual ~VolumeSource() = default;
  VolumeSource(const VolumeSource&) = delete;
  VolumeSource& operator=(const VolumeSource&) = delete;

  /// Values from the one with number `first` on, x fastest, then y; from any thread. Throws Error where they cannot be read.
  virtual void read(std::size_t first, std::span<double> out) const = 0;
  /// Do the values lie in memory until they are given back?
  virtual bool holds_values() const { return false; }
  /// Nobody asks for the values in front of the one with number `end` any more.
  virtual void give_back_before(std::size_t end) { static_cast<void>(end); }
};

}  // namespace amrtex
