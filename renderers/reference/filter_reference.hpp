// What one filter's reference is: f at a place, and where a ray must be split so that f is smooth on each piece. Each filter has
// one file in filters/, found there by CMake; nothing else of the reference knows one by name. Private to the reference.
#pragma once

#include <memory>
#include <optional>

#include "renderers/reference/ray_front.hpp"
#include "renderers/reference/reference_field.hpp"
#include "structures/mesh/filter.hpp"
#include "structures/mesh/finest_position.hpp"

namespace amrtex {

/// f at places whose leaf has a value. May keep what it looks up, so one object serves one thread.
class FilterPoints {
 public:
  explicit FilterPoints(const ReferenceField& field) : field_(field) {}
  virtual ~FilterPoints() = default;

  virtual double value(const ReferenceLeaf& leaf, const FinestPosition& p) = 0;
  /// Per finest cell; nullopt where f is constant between its jumps and has no derivative of use.
  virtual std::optional<Vec3d> derivative(const ReferenceLeaf& leaf, const FinestPosition& p) = 0;

  /// To either side of a place, by which a gradient is the difference of f.
  struct Reach {
    double cells;  // of the finest level
    Vec3d world;
  };
  /// One cell width of the leaf.
  virtual Reach reach(const ReferenceLeaf& leaf, const FinestPosition& p) const;

 protected:
  const ReferenceField& field() const { return field_; }
  Reach reach_of(int level) const;

 private:
  const ReferenceField& field_;
};

/// f along a ray, piece after piece. Keeps what it looks up, so one object serves one thread; what is found does not depend on
/// what was asked before.
class FilterPieces {
 public:
  explicit FilterPieces(const ReferenceField& field) : field_(field) {}
  virtual ~FilterPieces() = default;

  /// A new ray begins.
  virtual void start() {}
  /// Clips the front's piece to where f is one function; has it a value?
  virtual bool locate(RayFront& front) = 0;
  /// f on the piece located last, between two places of the ray (world length).
  virtual PieceFunction function(const RayFront& front, double from, double to) const = 0;

 protected:
  const ReferenceField& field() const { return field_; }

 private:
  const ReferenceField& field_;
};

/// One filter over one field of a mesh, which must outlive it. Immutable; safe to use from several threads.
class FilterReference {
 public:
  FilterReference(const AmrHierarchy& hierarchy, int field, const FilterDefinition& definition)
      : field_(hierarchy, field), definition_(definition) {}
  virtual ~FilterReference() = default;

  const ReferenceField& field() const { return field_; }
  const AmrHierarchy& hierarchy() const { return field_.hierarchy(); }
  const FilterDefinition& definition() const { return definition_; }
  virtual std::unique_ptr<FilterPoints> points() const = 0;
  virtual std::unique_ptr<FilterPieces> pieces() const = 0;

 private:
  ReferenceField field_;
  FilterDefinition definition_;
};

/// For filters without anything of their own to keep.
template <class Points, class Pieces>
class PlainFilterReference final : public FilterReference {
 public:
  using FilterReference::FilterReference;
  std::unique_ptr<FilterPoints> points() const override { return std::make_unique<Points>(field()); }
  std::unique_ptr<FilterPieces> pieces() const override { return std::make_unique<Pieces>(field()); }
};

/// The definition's filter. Throws Error where its parameters contradict the mesh, and for a filter without a reference.
std::unique_ptr<FilterReference> make_filter_reference(const AmrHierarchy& hierarchy, int field,
                                                       const FilterDefinition& definition);

}  // namespace amrtex
