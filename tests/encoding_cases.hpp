// Every registered encoding with every filter that it lists, and the checks that all of them
// must pass. Nothing here names an encoding or a parameter of one.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <optional>
#include <ostream>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "renderers/context.hpp"
#include "renderers/hierarchy_reference.hpp"
#include "renderers/probe.hpp"
#include "structures/encoding.hpp"
#include "structures/level_values.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex::test {

// ---- cases ----

struct EncodingCase {
  const Encoding* encoding;
  Filter filter;
  Json parameters;

  std::string name() const { return fmt::format("{} {} {}", encoding->name(), filter_name(filter), parameters.dump()); }
  /// Filterings that make a difference and that the encoding has.
  std::vector<Filtering> filterings() const;
};

struct BuildOptions {
  Storage storage = Storage::r32f;
  Filtering filtering = Filtering::manual;
  bool value_ranges = true;
  int field = 0;
  std::vector<int> more_fields = {};
  ContextKind context = ContextKind::egl;  ///< whose handles a structure may use
  bool draw_boxes = false;
  bool level_of_detail = false;
  bool everything = false;
  std::vector<std::array<double, 2>> invisible = {};
};

/// Made once a process; never destroyed, since the drivers' libraries may be gone by then.
inline Context& context(ContextKind kind) {
  static Context* const egl = make_context(ContextKind::egl).release();
  if (kind == ContextKind::egl) return *egl;
  static Context* const osmesa = make_context(ContextKind::osmesa).release();
  return *osmesa;
}
inline constexpr std::array kContexts{ContextKind::egl, ContextKind::osmesa};

/// A request's context with what the context says of handles of textures, and no other limit.
inline ContextInfo handle_limits(ContextKind kind) {
  const GlContextInfo& info = context(kind).info();
  ContextInfo limits;
  limits.bindless_texture = info.bindless_texture;
  limits.shader_ballot = info.shader_ballot;
  limits.handles_may_differ = info.handles_may_differ;
  limits.max_resident_handles = info.max_resident_handles;
  return limits;
}

/// Throws UnsupportedError for a mesh or combination that the encoding refuses.
inline EncodedField build(const AmrHierarchy& h, const EncodingCase& c, const BuildOptions& options = {}) {
  BuildRequest request;
  request.field = options.field;
  request.more_fields = options.more_fields;
  request.storage = options.storage;
  request.needs.filter = c.filter;
  request.needs.filtering = options.filtering;
  request.needs.value_ranges = options.value_ranges;
  request.needs.draw_boxes = options.draw_boxes;
  request.needs.level_of_detail = options.level_of_detail;
  request.needs.everything = options.everything;
  request.needs.invisible = options.invisible;
  request.parameters = c.parameters;
  request.context = handle_limits(options.context);
  return c.encoding->build(h, request);
}

/// Does the encoding take this mesh? What it refuses is a record `unsupported` and no failure.
inline bool accepted(const AmrHierarchy& h, const EncodingCase& c, const BuildOptions& options = {}) {
  try {
    build(h, c, options);
    return true;
  } catch (const UnsupportedError&) {
    return false;
  }
}

inline bool accepted(const EncodingCase& c, const BuildOptions& options = {}) {
  static const AmrHierarchy mesh = nested(waves).hierarchy();
  return accepted(mesh, c, options);
}

inline std::vector<Filtering> EncodingCase::filterings() const {
  std::vector<Filtering> all{Filtering::manual};
  if (filter != Filter::nearest && accepted(*this, {.filtering = Filtering::hardware})) all.push_back(Filtering::hardware);
  return all;
}

/// The values that a parameter's description spells out: its numbers and its quoted names.
inline std::vector<Json> declared_values(const ParameterInfo& p) {
  std::vector<Json> values;
  const std::string& text = p.accepted;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (std::isdigit(static_cast<unsigned char>(text[i])) != 0) {
      std::size_t digits = 0;
      values.emplace_back(std::stoi(text.substr(i), &digits));
      i += digits;
    } else if (text[i] == '"') {
      const std::size_t end = text.find('"', i + 1);
      if (end == std::string::npos) break;
      values.emplace_back(text.substr(i + 1, end - i - 1));
      i = end;
    }
  }
  return values;
}

/// The defaults where they take the filter, else the first declared value of a parameter that does.
inline EncodingCase default_case(const Encoding& encoding, Filter filter) {
  EncodingCase c{&encoding, filter, Json::object()};
  if (accepted(c)) return c;
  for (const ParameterInfo& p : encoding.parameters())
    for (const Json& value : declared_values(p)) {
      const EncodingCase other{&encoding, filter, Json{{p.name, value}}};
      if (accepted(other)) return other;
    }
  throw Error(fmt::format("encoding {}: lists the filter {} and no parameter takes it", encoding.name(), filter_name(filter)));
}

/// The default case, and with it every declared name and the two smallest declared numbers of each parameter.
inline std::vector<EncodingCase> variants(const Encoding& encoding, Filter filter) {
  const EncodingCase base = default_case(encoding, filter);
  std::vector<EncodingCase> cases{base};
  for (const ParameterInfo& p : encoding.parameters()) {
    int numbers = 0;
    for (const Json& value : declared_values(p)) {
      if (value.is_number() && ++numbers > 2) continue;
      EncodingCase c = base;
      c.parameters[p.name] = value;
      if (value != p.default_value && c.parameters != base.parameters && accepted(c)) cases.push_back(std::move(c));
    }
  }
  return cases;
}

/// A word that the parameters of all cases must hold (environment AMRTEX_CASES): a slice for another driver.
inline std::string case_slice() {
  const char* word = std::getenv("AMRTEX_CASES");
  return word == nullptr ? "" : word;
}

inline const std::vector<EncodingCase>& encoding_cases() {
  static const std::vector<EncodingCase> cases = [] {
    std::vector<EncodingCase> all;
    for (const Encoding* e : all_encodings())
      for (const Filter filter : e->filters())
        for (EncodingCase& c : variants(*e, filter))
          if (c.parameters.dump().find(case_slice()) != std::string::npos) all.push_back(std::move(c));
    if (all.empty()) throw Error(fmt::format("AMRTEX_CASES={}: no case on this context", case_slice()));
    return all;
  }();
  return cases;
}

// ---- positions ----

/// Largest fraction that a float holds: one ulp below an upper face.
inline constexpr double kBelowOne = 0x1.fffffep-1;
/// One ulp of 1 above a lower face.
inline constexpr double kAboveZero = 0x1p-24;

/// Every leaf, or `most` of each level taken at random.
inline std::vector<LeafCell> some_leaves(const AmrHierarchy& h, std::size_t most, std::mt19937_64& random) {
  std::vector<LeafCell> all;
  for (int level = 0; level < h.level_count(); ++level) {
    std::vector<LeafCell> leaves;
    for (std::size_t k = 0; k < h.patches(level).size(); ++k) {
      const Box& box = h.patches(level)[k].box;
      const auto mask = h.leaf_mask(level, static_cast<int>(k));
      for_each_cell(box, [&](const Vec3i& c) {
        if (mask[box.offset(c)] != 0) leaves.push_back({level, static_cast<int>(k), c});
      });
    }
    std::shuffle(leaves.begin(), leaves.end(), random);
    leaves.resize(std::min(leaves.size(), most));
    all.insert(all.end(), leaves.begin(), leaves.end());
  }
  return all;
}

/// Centres of leaves, their faces and corners and the floats next to these on either side,
/// random places in them and anywhere in the domain, and the domain's last face.
inline std::vector<FinestPosition> probe_positions(const AmrHierarchy& h, std::size_t leaves_a_level, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const Box domain = h.domain(h.finest_level());
  const auto fraction = [&] { return std::min(static_cast<double>(static_cast<float>(unit(random))), kBelowOne); };
  std::vector<FinestPosition> positions;
  const auto add = [&](const FinestPosition& p) {
    if (domain.contains(p.cell)) positions.push_back(p);
  };
  const auto inside = [&](const Vec3i& lower, int width) {
    FinestPosition p{lower, Vec3d(fraction(), fraction(), fraction())};
    for (int a = 0; a < 3; ++a) p.cell[a] += std::uniform_int_distribution<int>(0, width - 1)(random);
    return p;
  };
  for (const LeafCell& leaf : some_leaves(h, leaves_a_level, random)) {
    const int w = h.cell_width(leaf.level);
    const Vec3i lower = leaf.cell * w;
    const Vec3i last = lower + Vec3i(w - 1);
    add({lower + Vec3i(w / 2), Vec3d(w % 2 == 0 ? 0 : 0.5)});
    for (int a = 0; a < 3; ++a) {
      FinestPosition p = inside(lower, w);
      const auto along_axis = [&](int cell, double f) {
        p.cell[a] = cell;
        p.fraction[a] = f;
        add(p);
      };
      along_axis(lower[a], 0);
      along_axis(lower[a], kAboveZero);
      along_axis(lower[a] - 1, kBelowOne);
      along_axis(last[a], kBelowOne);
    }
    add({lower, Vec3d(0)});
    add({lower, Vec3d(kAboveZero)});
    add({lower - Vec3i(1), Vec3d(kBelowOne)});
    add({last, Vec3d(kBelowOne)});
    add({{lower.x, last.y, lower.z - 1}, {0, kBelowOne, kBelowOne}});
    for (int i = 0; i < 3; ++i) add(inside(lower, w));
  }
  for (int i = 0; i < 200; ++i) {
    FinestPosition p{Vec3i(0), Vec3d(fraction(), fraction(), fraction())};
    for (int a = 0; a < 3; ++a) p.cell[a] = std::uniform_int_distribution<int>(0, domain.upper[a] - 1)(random);
    add(p);
  }
  add({domain.upper - Vec3i(1), Vec3d(kBelowOne)});
  return positions;
}

// ---- comparing ----

using Values = std::vector<std::optional<double>>;

inline Values reference_values(const AmrHierarchy& h, const FilterDefinition& definition,
                               std::span<const FinestPosition> positions) {
  const HierarchyReference reference(h, 0, definition);
  Values values;
  for (const FinestPosition& p : positions) values.push_back(reference.sample(p));
  return values;
}

/// Difference of the largest and smallest value; 1 for a constant.
inline double value_range(const AmrHierarchy& h) {
  const FieldStatistics& s = h.statistics(0);
  return s.max > s.min ? s.max - s.min : 1;
}

/// Of the level values and fills within two cells: what a linear filter can see, and more.
inline double local_range(const AmrHierarchy& h, int level, const FinestPosition& p) {
  const Vec3i cell = p.cell / h.cell_width(level);
  const Box box{cell - Vec3i(2), cell + Vec3i(3)};
  std::array<double, 125> values{};
  filled_level_values(h, 0, level, box, values);
  double low = kInf;
  double high = -kInf;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  return std::max(high - low, 0.0);
}

struct Comparison {
  std::size_t compared = 0;
  std::size_t failed = 0;
  double worst = 0;   ///< difference
  std::string first;  ///< failure
  explicit operator bool() const { return compared > 0 && failed == 0; }
};
inline std::ostream& operator<<(std::ostream& out, const Comparison& c) {
  return out << c.failed << " of " << c.compared << " differ, by " << c.worst << " at most; " << c.first;
}

/// The one check of all tests of fields: `tolerance(i)` is asked where values differ.
template <class Tolerance>
Comparison compare(std::span<const FinestPosition> positions, const Values& expected, std::span<const ProbeResult> got,
                   Tolerance&& tolerance) {
  Comparison result;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    ++result.compared;
    const bool has = expected[i].has_value();
    bool good = has == got[i].found;
    if (good && has && *expected[i] != got[i].value) {
      const double difference = std::abs(*expected[i] - got[i].value);
      good = difference <= tolerance(i);
      result.worst = std::max(result.worst, std::isnan(difference) ? kInf : difference);
    }
    if (good) continue;
    if (result.failed++ == 0) {
      const FinestPosition& p = positions[i];
      const auto text = [](bool found, double value) { return found ? fmt::format("{:.17g}", value) : std::string("no value"); };
      result.first =
          fmt::format("first at cell ({}, {}, {}) + ({}, {}, {}): {} instead of {}", p.cell.x, p.cell.y, p.cell.z, p.fraction.x,
                      p.fraction.y, p.fraction.z, text(got[i].found, got[i].value), text(has, has ? *expected[i] : 0));
    }
  }
  return result;
}

inline Comparison compare(std::span<const FinestPosition> positions, const Values& expected, std::span<const ProbeResult> got,
                          double tolerance) {
  return compare(positions, expected, got, [tolerance](std::size_t) { return tolerance; });
}

inline Values values_of(std::span<const ProbeResult> results) {
  Values values;
  for (const ProbeResult& r : results) values.push_back(r.found ? std::optional(r.value) : std::nullopt);
  return values;
}

/// The field in double precision against the double reference of its own definition.
inline Comparison compare_double(const AmrHierarchy& h, const EncodedField& field, std::span<const FinestPosition> positions) {
  return compare(positions, reference_values(h, field.definition, positions),
                 probe_on_cpu(h, field, Precision::double_precision, positions), 1e-12 * value_range(h));
}

}  // namespace amrtex::test
