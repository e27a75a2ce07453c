#include "structures/common/encoding.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <xxhash.h>

#include <algorithm>

#include "structures/mesh/quoted.hpp"
namespace amrtex {
namespace {

template <class Range, class Name>
std::string join_names(const Range& range, Name&& name) {
  std::vector<std::string> names;
  for (const auto& item : range) names.emplace_back(name(item));
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

std::string_view filtering_name(Filtering filtering) { return filtering == Filtering::hardware ? "hardware" : "manual"; }

Filtering parse_filtering(std::string_view name) {
  for (Filtering f : {Filtering::hardware, Filtering::manual})
    if (filtering_name(f) == name) return f;
  throw UsageError(fmt::format("no filtering {}; accepted: hardware, manual", quote(name)));
}

StorageScale EncodedField::scale_of(int number) const {
  if (number < 0 || number >= field_count)
    throw UsageError(fmt::format("encoding {}: no field number {}; the structure holds {}", encoding, number, field_count));
  return number == 0 ? scale : more_scales[static_cast<std::size_t>(number - 1)];
}

MemoryByRole EncodedField::memory() const {
  MemoryByRole sum;
  for (const HostTexture& t : textures) sum += t.roles;
  return sum;
}

std::int64_t EncodedField::value_texels() const {
  std::int64_t n = 0;
  for (const HostTexture& t : textures)
    if (t.holds_values) n += t.texels();
  return n;
}

std::string EncodedField::content_hash() const {
  XXH3_state_t* state = XXH3_createState();
  XXH3_128bits_reset(state);
  const auto add = [&](const void* bytes, std::size_t n) { XXH3_128bits_update(state, bytes, n); };
  const auto add_text = [&](std::string_view text) { add(text.data(), text.size() + 0); };
  add_text(shader.file);
  for (const auto& [name, value] : shader.defines) {
    add_text(name);
    add(&value, sizeof value);
  }
  for (const auto& [name, value] : integer_uniforms) {
    add_text(name);
    add(&value, sizeof value);
  }
  for (const HostTexture& t : textures) {
    add_text(t.name);
    add_text(format_name(t.format));
    add(&t.size, sizeof t.size);
    add(t.data.data(), t.data.size());
  }
  const XXH128_hash_t h = XXH3_128bits_digest(state);
  XXH3_freeState(state);
  return fmt::format("{:016x}{:016x}", h.high64, h.low64);
}

const HostTexture* EncodedField::find(std::string_view name) const {
  for (const HostTexture& t : textures)
    if (t.name == name) return &t;
  return nullptr;
}

HostTexture* EncodedField::find(std::string_view name) {
  return const_cast<HostTexture*>(std::as_const(*this).find(name));  // its own
}

const Encoding& find_encoding(std::string_view name) {
  for (const Encoding* e : all_encodings())
    if (e->name() == name) return *e;
  throw UsageError(fmt::format("no encoding {}; accepted: {}", quote(name),
                               join_names(all_encodings(), [](const Encoding* e) { return e->name(); })));
}

SceneNeeds with_need(SceneNeeds needs, Need need) {
  switch (need) {
    case Need::none:
      break;
    case Need::validity:
      needs.validity = true;
      break;
    case Need::border:
      needs.border = true;
      break;
    case Need::value_ranges:
      needs.value_ranges = true;
      break;
    case Need::gradients:
      needs.gradients = true;
      break;
    case Need::hidden:
      needs.invisible.clear();
      break;
  }
  return needs;
}

Json complete_parameters(const Encoding& encoding, const Json& given) {
  const std::vector<ParameterInfo> known = encoding.parameters();
  for (const auto& [key, value] : given.items())
    if (std::none_of(known.begin(), known.end(), [&](const ParameterInfo& p) { return p.name == key; }))
      throw UsageError(fmt::format("encoding {}: no parameter {}; accepted: {}", encoding.name(), quote(key),
                                   known.empty() ? "none" : join_names(known, [](const ParameterInfo& p) { return p.name; })));
  Json complete = Json::object();
  for (const ParameterInfo& p : known) {
    const Json& value = complete[p.name] = given.contains(p.name) ? given[p.name] : p.default_value;
    if (!p.accepted.has(value))
      throw UsageError(
          fmt::format("encoding {}: parameter {} is {}; accepted: {}", encoding.name(), p.name, shown(value), p.accepted.text()));
  }
  encoding.check_parameters(complete);
  return complete;
}

void require_filter(const Encoding& encoding, Filter filter) {
  const auto has = encoding.filters();
  if (std::find(has.begin(), has.end(), filter) == has.end())
    throw UnsupportedError(
        fmt::format("encoding {}: no filter {}; it has {}", encoding.name(), filter_name(filter), join_names(has, filter_name)));
}

void require_level_of_detail(const Encoding& encoding, const SceneNeeds& needs) {
  const Support support = encoding.level_of_detail();
  if (!needs.level_of_detail || support.ok) return;
  std::vector<std::string_view> others;
  for (const Encoding* e : all_encodings())
    if (e->level_of_detail().ok) others.push_back(e->name());
  throw UnsupportedError(
      fmt::format("encoding {}: no level of detail (level_of_detail, max_level): {}; encodings that have it: {}", encoding.name(),
                  support.reason, fmt::join(others, ", ")));
}

void require_analytic_gradients(const Encoding& encoding, const SceneNeeds& needs) {
  const Support support = encoding.analytic_gradients(needs.filter);
  if (!needs.analytic_gradients || support.ok) return;
  std::vector<std::string> others;
  for (const Encoding* e : all_encodings())
    for (const Filter filter : e->filters())
      if (e->analytic_gradients(filter).ok) others.push_back(fmt::format("{} with {}", e->name(), filter_name(filter)));
  throw UnsupportedError(fmt::format("encoding {}: no analytic gradient of {} (shading analytic): {}; there is one of {}",
                                     encoding.name(), filter_name(needs.filter), support.reason, fmt::join(others, ", ")));
}

void require_fields(const Encoding& encoding, const AmrHierarchy& hierarchy, const BuildRequest& request) {
  if (!request.needs.invisible.empty() && !encoding.prunes()) {
    std::vector<std::string_view> names;
    for (const Encoding* e : all_encodings())
      if (e->prunes()) names.push_back(e->name());
    throw UnsupportedError(
        fmt::format("encoding {}: prune: it has no parts that are left out where nothing is to be seen; accepted: {}",
                    encoding.name(), fmt::join(names, ", ")));
  }
  if (request.field_count() > kMostFields)
    throw UsageError(fmt::format("encoding {}: {} fields in one structure; at most {} are supported", encoding.name(),
                                 request.field_count(), kMostFields));
  const int known = static_cast<int>(hierarchy.fields().size());
  for (int i = 0; i < request.field_count(); ++i)
    if (request.field_at(i) < 0 || request.field_at(i) >= known)
      throw UsageError(fmt::format("encoding {}: no field with index {}; {} has {}", encoding.name(), request.field_at(i),
                                   clipped(hierarchy.name()), known));
}

}  // namespace amrtex
