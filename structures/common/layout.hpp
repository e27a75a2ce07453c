// The layout of a structure: its parts, and what follows from them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "structures/common/encoding.hpp"
#include "structures/mesh/checked.hpp"

namespace amrtex {

/// All parts of a structure, in the order in which the shader's inputs are bound. Nothing is allocated before allocate().
class Layout {
 public:
  Layout(const Encoding& encoding, const BuildRequest& request);

  void add(Part part);
  /// A texture of one field's values, stored and filtered as the request says.
  Part values(std::string_view name, int number, const Vec3i& size) const;
  /// Coded ranges of the fields beside the first, side by side of each region (MoreRanges).
  Part more_ranges(std::string name, std::int64_t regions) const;
  /// Bytes of so many values of every field.
  std::int64_t value_bytes(std::int64_t values) const;

  /// A share of present parts that is left out: a border, a channel, what is hidden. Entries of one name are added up.
  void leave_out(const LeftOut& entry);
  /// Bytes of an array that the build holds beside the parts.
  void add_working(std::int64_t bytes) { working_ += bytes; }
  /// Told at the end of refusals: counts, and what would make them smaller.
  void set_remedy(std::string text) { remedy_ = std::move(text); }

  /// Of all parts.
  std::int64_t bytes() const;
  /// Throws UnsupportedError naming the largest part that no texture or buffer of the context holds.
  void require_limits() const;
  /// Throws BudgetError with the bytes needed and the largest part, where they pass the request's limit.
  void require_budget() const;

  /// Gives the field its parts, zeroed and to be filled by name, what is left out, and the bytes of the build.
  void allocate(EncodedField& field) const;

 private:
  const Encoding& encoding_;
  const BuildRequest& request_;
  std::vector<Part> parts_;
  std::vector<LeftOut> left_out_;
  CheckedSize working_;
  std::string remedy_;
};

/// A field's boxes for consumers that draw box by box; the host holds them.
void set_draw_tree(EncodedField& field, DrawTree tree);

}  // namespace amrtex
