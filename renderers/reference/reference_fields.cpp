#include "renderers/reference/reference_fields.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace amrtex {
namespace {

/// Where f passes a knot of its transfer function, as places of the ray.
void add_breaks(const PieceFunction& f, double from, double to, const TransferTable& table, std::vector<double>& breaks) {
  const std::size_t last = table.segment_of(f.upper);
  for (std::size_t k = table.segment_of(f.lower); k < last; ++k) {
    std::array<double, 3> roots{};
    const int n = roots_in_unit(f.minus(table.knots()[k]), roots);
    for (int i = 0; i < n; ++i) breaks.push_back(from + roots[static_cast<std::size_t>(i)] * (to - from));
  }
}

void sort_places(std::vector<double>& places) {
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
}

}  // namespace

/// Inside of one piece of each field: between the places where any passes a knot all curves are smooth.
void FieldsLight::add_stretch(LightIntegral& light, const Pieces& pieces, double from, double to, double max_part) {
  breaks_.assign({from, to});
  for (std::size_t i = 0; i < pieces.size(); ++i)
    if (pieces[i] != nullptr) add_breaks(pieces[i]->f, pieces[i]->from, pieces[i]->to, *tables_[i], breaks_);
  std::erase_if(breaks_, [&](double t) { return t < from || t > to; });
  sort_places(breaks_);
  for (std::size_t b = 0; b + 1 < breaks_.size(); ++b) {
    const double start = breaks_[b];
    const double length = breaks_[b + 1] - start;
    emitters_.clear();
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (pieces[i] == nullptr) continue;
      const auto& segment = tables_[i]->segment(tables_[i]->segment_of(pieces[i]->f(pieces[i]->at(start + length / 2))));
      if (segment.visible) emitters_.push_back({pieces[i], tables_[i], &segment});
    }
    if (emitters_.empty()) continue;
    const auto at = [&](double s) {
      TransferTable::Light all{0, Vec3d(0)};
      for (const Emitter& e : emitters_) {
        const TransferTable::Light one = e.table->light(*e.segment, e.piece->f(e.piece->at(start + s * length)));
        if (!(one.extinction > 0)) continue;
        all.extinction += one.extinction;
        const double part = std::isinf(one.extinction) ? 1 : one.extinction / all.extinction;
        all.rgb += part * (one.rgb - all.rgb);
      }
      return all;
    };
    light.add_smooth(at, length, max_part, 0, 1);
  }
}

void FieldsLight::drain(LightIntegral& light, double max_part) {
  places_.clear();
  for (const auto& pieces : pieces_)
    for (const Piece& p : pieces) places_.insert(places_.end(), {p.from, p.to});
  sort_places(places_);
  std::vector<std::size_t> next(pieces_.size());  // of each field, the first piece that does not end before the stretch
  for (std::size_t k = 0; k + 1 < places_.size() && light.transmittance() >= LightIntegral::kOpaque; ++k) {
    const double from = places_[k];
    const double to = places_[k + 1];
    Pieces here(pieces_.size());
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
      while (next[i] < pieces_[i].size() && pieces_[i][next[i]].to <= from) ++next[i];
      if (next[i] < pieces_[i].size() && pieces_[i][next[i]].from <= from) here[i] = &pieces_[i][next[i]];
    }
    add_stretch(light, here, from, to, max_part);
  }
  for (auto& pieces : pieces_) pieces.clear();
}

}  // namespace amrtex
