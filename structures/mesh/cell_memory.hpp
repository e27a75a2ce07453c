// One piece of memory for the arrays of many patches.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

namespace amrtex {

/// Arrays of a level's patches lie behind one another here. Asked of the system one by one, each is mapped in small pages while
/// other threads wait; one piece in huge pages (where the system has them) takes a fraction of that time. Given back as a whole.
class CellMemory {
 public:
  /// Throws std::bad_alloc.
  explicit CellMemory(std::size_t bytes);
  ~CellMemory();
  /// Of so many bytes; null where that is little, so that arrays are asked of the system. Throws std::bad_alloc.
  static std::shared_ptr<CellMemory> for_arrays(std::size_t bytes);
  CellMemory(const CellMemory&) = delete;
  CellMemory& operator=(const CellMemory&) = delete;

  /// What an array of so many bytes takes of it: they begin at multiples of 64.
  static constexpr std::size_t taken(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }
  /// Place for an array, from any thread; null where the rest is too small.
  void* take(std::size_t bytes) noexcept;
  bool holds(const void* array) const noexcept;

 private:
  static constexpr std::size_t kAlignment = 64;
  std::byte* mapped_;
  std::size_t mapped_bytes_;
  std::byte* begin_;
  std::size_t bytes_;
  std::atomic<std::size_t> used_ = 0;
};

}  // namespace amrtex
