#include "structures/mesh/cell_memory.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <new>

namespace amrtex {
namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20;

std::size_t with_alignment(std::size_t bytes) {
  if (bytes > std::numeric_limits<std::size_t>::max() - 2 * kHugePage) throw std::bad_alloc();
  return (bytes + kHugePage - 1) / kHugePage * kHugePage + kHugePage;
}

}  // namespace

CellMemory::CellMemory(std::size_t bytes) : mapped_bytes_(with_alignment(bytes)), bytes_(bytes) {
  void* mapped = ::mmap(nullptr, mapped_bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED) throw std::bad_alloc();
  mapped_ = static_cast<std::byte*>(mapped);
  const auto past = reinterpret_cast<std::uintptr_t>(mapped_) % kHugePage;
  begin_ = mapped_ + (past == 0 ? 0 : kHugePage - past);
#ifdef MADV_HUGEPAGE
  ::madvise(begin_, bytes_, MADV_HUGEPAGE);  // a wish: without huge pages the memory is as good, and slower
#endif
}

CellMemory::~CellMemory() { ::munmap(mapped_, mapped_bytes_); }

std::shared_ptr<CellMemory> CellMemory::for_arrays(std::size_t bytes) {
  constexpr std::size_t kLeast = std::size_t{4} << 20;
  return bytes < kLeast ? nullptr : std::make_shared<CellMemory>(bytes);
}

void* CellMemory::take(std::size_t bytes) noexcept {
  if (bytes == 0 || bytes > bytes_) return nullptr;
  const std::size_t count = taken(bytes);
  std::size_t used = used_.load(std::memory_order_relaxed);
  do {
    if (bytes > bytes_ - used) return nullptr;
  } while (!used_.compare_exchange_weak(used, std::min(used + count, bytes_), std::memory_order_relaxed));
  return begin_ + used;
}

bool CellMemory::holds(const void* array) const noexcept {
  const auto* at = static_cast<const std::byte*>(array);
  return !std::less<>()(at, begin_) && std::less<>()(at, begin_ + bytes_);
}

}  // namespace amrtex
