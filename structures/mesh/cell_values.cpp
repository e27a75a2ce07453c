#include "structures/mesh/cell_values.hpp"

#include <cassert>
#include <limits>

namespace amrtex {

CellSet::CellSet(std::span<const std::uint8_t> mask) : words_((mask.size() + 63) / 64) {
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (mask[i] == 0) words_[i / 64].bits |= std::uint64_t{1} << (i % 64);
  for (Word& word : words_) {
    word.before = count_;
    count_ += static_cast<std::size_t>(std::popcount(word.bits));
  }
}

CellValues::CellValues(RealType type, std::size_t cells, const std::shared_ptr<CellMemory>& memory) {
  if (type == RealType::float32)
    values_ = CellArray<float>(cells, UnsetAllocator<float>(memory));
  else
    values_ = CellArray<double>(cells, UnsetAllocator<double>(memory));
}

void CellValues::set(std::size_t cell, double value) {
  visit_stored([&](auto& stored) { stored[cell] = static_cast<typename std::decay_t<decltype(stored)>::value_type>(value); });
}

void CellValues::hold_means(std::shared_ptr<const CellSet> cells) {
  if (type() == RealType::float64) return;
  means_.values.assign(cells->count(), std::numeric_limits<double>::quiet_NaN());
  means_.cells = std::move(cells);
}

void CellValues::set_mean(std::size_t cell, double mean) {
  if (auto* wide = std::get_if<CellArray<double>>(&values_)) {
    (*wide)[cell] = mean;
    return;
  }
  assert(means_.cells && means_.cells->holds(cell));
  means_.values[means_.cells->rank(cell)] = mean;
}

void CellValues::copy(std::size_t first, std::span<double> out) const {
  visit([&](const auto& view) {
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = view[first + i];
  });
}

std::vector<double> CellValues::doubles() const {
  std::vector<double> all(size());
  copy(0, all);
  return all;
}

}  // namespace amrtex
