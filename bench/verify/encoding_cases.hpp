// Every registered encoding with every filter that it lists. Nothing here names an encoding or a
// parameter of one. Tests use it too.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "bench/verify/meshes.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex::verify {

struct EncodingCase {
  const Encoding* encoding;
  Filter filter;
  Json parameters;
  ContextInfo limits = {};  ///< of the context that it is for

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
  std::optional<ContextInfo> limits = {};  ///< of another context than the case's
  bool draw_boxes = false;
  bool level_of_detail = false;
  bool everything = false;
  bool validity = false;
  bool border = false;
  bool gradients = false;
  bool variation = false;
  std::vector<std::array<double, 2>> invisible = {};
  std::int64_t memory_limit = std::numeric_limits<std::int64_t>::max();  ///< bytes
};

/// What a context says of handles of textures, and no other limit of it.
inline ContextInfo handle_limits(const ContextInfo& info) {
  ContextInfo limits;
  limits.bindless_texture = info.bindless_texture;
  limits.shader_ballot = info.shader_ballot;
  limits.handles_may_differ = info.handles_may_differ;
  limits.max_resident_handles = info.max_resident_handles;
  return limits;
}

inline BuildRequest build_request(const EncodingCase& c, const BuildOptions& options) {
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
  request.needs.validity = options.validity;
  request.needs.border = options.border;
  request.needs.gradients = options.gradients;
  request.needs.variation = options.variation;
  request.needs.invisible = options.invisible;
  request.parameters = c.parameters;
  request.memory_limit = options.memory_limit;
  request.context = options.limits.value_or(c.limits);
  return request;
}

/// Throws UnsupportedError for a mesh or combination that the encoding refuses.
inline EncodedField build(const AmrHierarchy& h, const EncodingCase& c, const BuildOptions& options = {}) {
  return c.encoding->build(h, build_request(c, options));
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
  if (interpolates(filter) && accepted(*this, {.filtering = Filtering::hardware})) all.push_back(Filtering::hardware);
  return all;
}

/// Names and numbers among what a parameter tells that it takes. What is switched on or off makes no case of its own.
inline std::vector<Json> declared_values(const ParameterInfo& p) {
  std::vector<Json> values = p.accepted.examples();
  std::erase_if(values, [](const Json& value) { return !value.is_string() && !value.is_number(); });
  return values;
}

/// The defaults where they take the filter, else the first declared value of a parameter that does.
inline EncodingCase default_case(const Encoding& encoding, Filter filter, const ContextInfo& limits = {}) {
  EncodingCase c{&encoding, filter, Json::object(), limits};
  if (accepted(c)) return c;
  for (const ParameterInfo& p : encoding.parameters())
    for (const Json& value : declared_values(p)) {
      const EncodingCase other{&encoding, filter, Json{{p.name, value}}, limits};
      if (accepted(other)) return other;
    }
  throw Error(fmt::format("encoding {}: lists the filter {} and no parameter takes it", encoding.name(), filter_name(filter)));
}

/// What shaders read of a case on small meshes of every kind: a parameter that changes none of it makes no other case.
inline std::string content_of(const EncodingCase& c) {
  static const std::array<AmrHierarchy, 4> meshes{nested(waves).hierarchy(), single_level(waves).hierarchy(),
                                                  jump_of_two(waves).hierarchy(), holes_and_missing(waves).hierarchy()};
  std::string content;
  for (const AmrHierarchy& h : meshes) {
    if (!accepted(h, c)) continue;
    const EncodedField field = build(h, c);
    content += field.content_hash();
    for (const auto& [name, value] : field.shader.defines) content += fmt::format(" {}={}", name, value);
  }
  return content;
}

/// The default case, and with it every name and the first two numbers of each parameter, where they change
/// anything.
inline std::vector<EncodingCase> variants(const Encoding& encoding, Filter filter, const ContextInfo& limits = {}) {
  const EncodingCase base = default_case(encoding, filter, limits);
  std::vector<EncodingCase> cases{base};
  std::set<std::string> contents{content_of(base)};
  for (const ParameterInfo& p : encoding.parameters()) {
    int numbers = 0;
    for (const Json& value : declared_values(p)) {
      if (value.is_number() && ++numbers > 2) continue;
      EncodingCase c = base;
      c.parameters[p.name] = value;
      if (value != p.default_value && c.parameters != base.parameters && accepted(c) && contents.insert(content_of(c)).second)
        cases.push_back(std::move(c));
    }
  }
  return cases;
}

/// Those whose name, of encoding, filter and parameters, holds a word.
inline std::vector<EncodingCase> cases_named(std::vector<EncodingCase> cases, std::string_view word) {
  std::erase_if(cases, [&](const EncodingCase& c) { return c.name().find(word) == std::string::npos; });
  return cases;
}

/// All cases of a context.
inline std::vector<EncodingCase> make_encoding_cases(const ContextInfo& limits) {
  std::vector<EncodingCase> all;
  for (const Encoding* e : all_encodings())
    for (const Filter filter : e->filters())
      for (EncodingCase& c : variants(*e, filter, limits)) all.push_back(std::move(c));
  return all;
}

/// The same texels as the values' own floats: what r32f was before fields had units.
inline EncodedField as_plain_floats(EncodedField field) {
  for (HostTexture& t : field.textures) {
    if (!t.holds_values) continue;
    for (std::int64_t i = 0; i < t.texels(); ++i) t.as<float>()[i] = static_cast<float>(field.scale.value(t.as<float>()[i]));
  }
  field.scale = {};
  return field;
}

}  // namespace amrtex::verify
