#include "structures/mesh/patch_index.hpp"

#include <algorithm>
#include <cmath>

namespace amrtex {
namespace {

constexpr int kWidestBin = 1 << 30;  // eight of them hold any mesh of 31 bits

}  // namespace

PatchIndex::PatchIndex(std::span<const Patch> patches) {
  if (patches.empty()) return;
  bounds_ = patches[0].box;
  double edges = 0;
  for (const Patch& p : patches) {
    bounds_ = {glm::min(bounds_.lower, p.box.lower), glm::max(bounds_.upper, p.box.upper)};
    edges += std::cbrt(static_cast<double>(p.box.cells()));
  }
  bin_ = static_cast<int>(std::clamp(edges / static_cast<double>(patches.size()), 1.0, static_cast<double>(kWidestBin)));
  while (too_many_bins(patches)) bin_ *= 2;
  fill(patches);
}

bool PatchIndex::too_many_bins(std::span<const Patch> patches) {
  bins_ = ceil_div(bounds_.size(), bin_);
  if (Box{Vec3i(0), bins_}.cells() > (std::int64_t{1} << 22)) return true;
  CheckedSize entries;
  for (const Patch& p : patches) entries += bins_of(p.box).cells();
  return entries.or_most() > 16 * std::ssize(patches) + 4096;
}

void PatchIndex::fill(std::span<const Patch> patches) {
  const Box all{Vec3i(0), bins_};
  first_.assign(static_cast<std::size_t>(all.cells()) + 1, 0);
  for (const Patch& p : patches) for_each_cell(bins_of(p.box), [&](const Vec3i& b) { ++first_[all.offset(b) + 1]; });
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  patch_.resize(first_.back());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::size_t k = 0; k < patches.size(); ++k)
    for_each_cell(bins_of(patches[k].box), [&](const Vec3i& b) { patch_[next[all.offset(b)]++] = static_cast<int>(k); });
}

int PatchIndex::find(std::span<const Patch> patches, const Vec3i& cell) const {
  if (!bounds_.contains(cell)) return -1;
  const std::size_t i = Box{Vec3i(0), bins_}.offset((cell - bounds_.lower) / bin_);
  for (std::uint32_t k = first_[i]; k < first_[i + 1]; ++k)
    if (patches[static_cast<std::size_t>(patch_[k])].box.contains(cell)) return patch_[k];
  return -1;
}

}  // namespace amrtex
