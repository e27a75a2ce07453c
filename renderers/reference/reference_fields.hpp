// Light of several fields along a ray, each with its own transfer function, in double precision. Private to the reference.
#pragma once

#include <vector>

#include "renderers/reference/ray_integral.hpp"

namespace amrtex {

/// Gathers the pieces of each field of one ray, then adds the light of all of them to an integral: extinctions add, and the
/// emitted colour is their mean weighted by extinction.
class FieldsLight {
 public:
  /// One transfer function a field; they outlive the object.
  explicit FieldsLight(std::vector<const TransferTable*> tables) : tables_(std::move(tables)), pieces_(tables_.size()) {}

  /// A piece of a field between two places of the ray (world length), behind those before.
  void add(std::size_t field, const PieceFunction& f, double from, double to) { pieces_[field].push_back({f, {from, to}}); }

  /// Adds what was gathered until nothing behind is seen, and forgets it.
  void drain(LightIntegral& light);

 private:
  struct Piece {
    PieceFunction f;
    RaySpan span;
    double at(double t) const { return (t - span.from) / span.length(); }
  };
  /// A field that can be seen in a part of a stretch.
  struct Emitter {
    const Piece* piece;
    const TransferTable* table;
    const TransferTable::Segment* segment;
  };
  class SumStretch;
  using Pieces = std::vector<const Piece*>;  // of one stretch, one a field; null where it has no value

  void add_stretch(LightIntegral& light, const Pieces& pieces, double from, double to);

  std::vector<const TransferTable*> tables_;
  std::vector<std::vector<Piece>> pieces_;
  std::vector<double> places_, breaks_;
  std::vector<Emitter> emitters_;
};

}  // namespace amrtex
