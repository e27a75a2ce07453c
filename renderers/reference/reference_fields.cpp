#include "renderers/reference/reference_fields.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace amrtex {
namespace {

/// Where f passes a knot of its transfer function, or has an extremum on a logarithmic axis, as places of the ray.
void add_breaks(const PieceFunction& f, const RaySpan& span, const TransferTable& table, std::vector<double>& breaks) {
  const auto break_at = [&](std::span<const double> places) {
    for (const double place : places) breaks.push_back(span.from + place * span.length());
  };
  const auto first = [](const auto& places, int n) { return std::span<const double>(places.data(), static_cast<std::size_t>(n)); };
  const std::size_t last = table.segment_of(f.upper);
  for (std::size_t k = table.segment_of(f.lower); k < last; ++k) {
    std::array<double, 3> roots{};
    const int n = roots_in_unit(f.minus(table.knots()[k]), roots);
    break_at(first(roots, n));
  }
  if (!table.logarithmic()) return;
  std::array<double, 2> extrema{};
  const int n = extrema_in_unit(f.numerator, extrema);
  break_at(first(extrema, n));
}

void sort_places(std::vector<double>& places) {
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
}

}  // namespace

/// Extinctions add, and the colour is their mean weighted by extinction.
class FieldsLight::SumStretch final : public Stretch {
 public:
  SumStretch(const RaySpan& span, const std::vector<Emitter>& emitters) : Stretch(span), emitters_(emitters) {}

  TransferTable::Light light(double s) const override {
    TransferTable::Light all{0, Vec3d(0)};
    for (const Emitter& e : emitters_) {
      const TransferTable::Light one = e.table->light(*e.segment, e.piece->f, place(e, s));
      if (!(one.extinction > 0)) continue;
      all.extinction += one.extinction;
      const double part = std::isinf(one.extinction) ? 1 : one.extinction / all.extinction;
      all.rgb += part * (one.rgb - all.rgb);
    }
    return all;
  }
  double most() const override {
    double most = 0;
    for (const Emitter& e : emitters_) most += e.segment->most();
    return most;
  }
  double color_range() const override { return 1; }
  double growth(double a, double b) const override {
    double steepest = 1;
    for (const Emitter& e : emitters_) {
      if (!e.table->logarithmic() || e.segment->constant) continue;
      const double growth =
          std::max(e.piece->f(place(e, b)), e.segment->value_lower) / std::max(e.piece->f(place(e, a)), e.segment->value_lower);
      if (std::abs(std::log(growth)) > std::abs(std::log(steepest))) steepest = growth;
    }
    return steepest;
  }

 private:
  double place(const Emitter& e, double s) const { return e.piece->at(span().from + s * span().length()); }

  const std::vector<Emitter>& emitters_;
};

/// Inside of one piece of each field: between the places where any passes a knot all curves are smooth.
void FieldsLight::add_stretch(LightIntegral& light, const Pieces& pieces, double from, double to) {
  breaks_.assign({from, to});
  for (std::size_t i = 0; i < pieces.size(); ++i)
    if (pieces[i] != nullptr) add_breaks(pieces[i]->f, pieces[i]->span, *tables_[i], breaks_);
  std::erase_if(breaks_, [&](double t) { return t < from || t > to; });
  sort_places(breaks_);
  for (std::size_t b = 0; b + 1 < breaks_.size(); ++b) {
    const RaySpan span{breaks_[b], breaks_[b + 1]};
    emitters_.clear();
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (pieces[i] == nullptr) continue;
      const double middle = pieces[i]->at(span.from + span.length() / 2);
      const auto& segment = tables_[i]->segment(tables_[i]->segment_of(pieces[i]->f(middle)));
      if (segment.visible) emitters_.push_back({pieces[i], tables_[i], &segment});
    }
    if (!emitters_.empty()) light.add_smooth(SumStretch(span, emitters_));
  }
}

void FieldsLight::drain(LightIntegral& light) {
  places_.clear();
  for (const auto& pieces : pieces_)
    for (const Piece& p : pieces) places_.insert(places_.end(), {p.span.from, p.span.to});
  sort_places(places_);
  std::vector<std::size_t> next(pieces_.size());  // of each field, the first piece that does not end before the stretch
  for (std::size_t k = 0; k + 1 < places_.size() && !light.opaque(); ++k) {
    const double from = places_[k];
    const double to = places_[k + 1];
    Pieces here(pieces_.size());
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
      while (next[i] < pieces_[i].size() && pieces_[i][next[i]].span.to <= from) ++next[i];
      if (next[i] < pieces_[i].size() && pieces_[i][next[i]].span.from <= from) here[i] = &pieces_[i][next[i]];
    }
    add_stretch(light, here, from, to);
  }
  for (auto& pieces : pieces_) pieces.clear();
}

}  // namespace amrtex
