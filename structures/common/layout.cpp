#include "structures/common/layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "structures/common/build_tools.hpp"

namespace amrtex {
namespace {

double mebibytes(std::int64_t bytes) { return static_cast<double>(bytes) / 1048576.0; }

/// Of a buffer: what the context takes, and as many elements as HostTexture::size counts.
std::int64_t most_bytes(const Part& buffer, const ContextInfo& context) {
  return std::min(context.max_buffer_bytes, std::int64_t{std::numeric_limits<int>::max()} * texel_bytes(buffer.format));
}

}  // namespace

std::int64_t Part::texels() const {
  return kind == HostTexture::Kind::buffer ? elements : (CheckedSize(size.x) * size.y * size.z).or_most();
}

std::int64_t Part::bytes() const {
  const std::int64_t least = kind == HostTexture::Kind::buffer ? 1 : 0;
  return (CheckedSize(std::max(texels(), least)) * texel_bytes(format)).or_most();
}

HostTexture Part::allocate() const {
  HostTexture t = kind == HostTexture::Kind::buffer ? make_buffer(name, format, elements) : make_texture(name, format, size);
  t.hardware_linear = hardware_linear;
  t.holds_values = holds_values;
  t.handles = handles;
  t.handle_index = handle_index;
  t.roles = {0, 0, t.bytes(), 0};
  if (!roles) return t;
  const int bytes = texel_bytes(format);
  t.roles = {roles->payload * bytes, roles->duplicated * bytes, roles->topology * bytes, 0};
  t.roles.padding = t.bytes() - t.roles.total();
  return t;
}

Part Part::when(bool is_present, std::string why, Need brought_back_by) && {
  present = is_present;
  why_absent = std::move(why);
  need = brought_back_by;
  return std::move(*this);
}

Part Part::holding(const MemoryByRole& texels) && {
  roles = texels;
  return std::move(*this);
}

Part buffer_part(std::string name, std::string what, TexelFormat format, std::int64_t elements) {
  Part part;
  part.name = std::move(name);
  part.what = std::move(what);
  part.format = format;
  part.elements = elements;
  return part;
}

Part texture_part(std::string name, std::string what, TexelFormat format, const Vec3i& size) {
  Part part = buffer_part(std::move(name), std::move(what), format, 0);
  part.kind = HostTexture::Kind::texture_3d;
  part.size = size;
  return part;
}

Layout::Layout(const Encoding& encoding, const BuildRequest& request) : encoding_(encoding), request_(request) {}

void Layout::add(Part part) {
  if (!part.present && !part.why_absent.empty())
    leave_out({part.what, part.why_absent,
               part.saved_bytes.value_or((CheckedSize(part.texels()) * texel_bytes(part.format)).or_most()), part.need});
  parts_.push_back(std::move(part));
}

Part Layout::values(std::string_view name, int number, const Vec3i& size) const {
  Part part = texture_part(element_name(name, number), "values", request_.storage, size);
  part.hardware_linear = stored_filtering(request_) == Filtering::hardware;
  part.holds_values = true;
  return part;
}

Part Layout::more_ranges(std::string name, std::int64_t regions) const {
  const int others = request_.field_count() - 1;
  return buffer_part(std::move(name), "value ranges of further fields", TexelFormat::r32ui,
                     (CheckedSize(std::max<std::int64_t>(regions, 1)) * others).or_most())
      .when(request_.needs.field_ranges && others > 0);
}

std::int64_t Layout::value_bytes(std::int64_t values) const {
  return (CheckedSize(values) * request_.field_count() * texel_bytes(request_.storage)).or_most();
}

void Layout::leave_out(const LeftOut& entry) {
  const auto known = std::find_if(left_out_.begin(), left_out_.end(), [&](const LeftOut& l) { return l.what == entry.what; });
  if (known == left_out_.end())
    left_out_.push_back(entry);
  else
    known->bytes = (CheckedSize(known->bytes) + entry.bytes).or_most();
}

std::int64_t Layout::bytes() const {
  CheckedSize all;
  for (const Part& p : parts_)
    if (p.present) all += p.bytes();
  return all.or_most();
}

void Layout::require_limits() const {
  const ContextInfo& context = request_.context;
  const auto passes = [&](const Part& p) {
    if (p.kind == HostTexture::Kind::buffer) return p.bytes() > most_bytes(p, context);
    return std::max({p.size.x, p.size.y, p.size.z}) > context.max_3d_texture_size || p.bytes() > context.max_texture_bytes;
  };
  const Part* worst = nullptr;
  for (const Part& p : parts_)
    if (p.present && passes(p) && (worst == nullptr || p.bytes() > worst->bytes())) worst = &p;
  if (worst == nullptr) return;
  const std::string sizes =
      worst->kind == HostTexture::Kind::buffer
          ? fmt::format("{} bytes; accepted by this context: a buffer of at most {}", worst->bytes(), most_bytes(*worst, context))
          : fmt::format("{} x {} x {} texels ({} bytes); accepted by this context: a 3D texture of at most {} along an axis{}",
                        worst->size.x, worst->size.y, worst->size.z, worst->bytes(), context.max_3d_texture_size,
                        context.has_texture_limit() ? fmt::format(" and {} bytes", context.max_texture_bytes) : "");
  throw UnsupportedError(
      fmt::format("encoding {} with {}: {}: {}{}", encoding_.name(), request_.parameters.dump(), worst->what, sizes, remedy_));
}

void Layout::require_budget() const {
  const std::int64_t needed = bytes();
  if (needed <= request_.memory_limit) return;
  const auto present_bytes = [](const Part& p) { return p.present ? p.bytes() : -1; };
  const auto smaller = [&](const Part& a, const Part& b) { return present_bytes(a) < present_bytes(b); };
  const Part& largest = *std::max_element(parts_.begin(), parts_.end(), smaller);
  throw BudgetError(fmt::format("encoding {} with {}: needs {} bytes ({:.1f} MiB), the memory limit is {} bytes ({:.1f} MiB); "
                                "most of it: {}, {} bytes{}",
                                encoding_.name(), request_.parameters.dump(), needed, mebibytes(needed), request_.memory_limit,
                                mebibytes(request_.memory_limit), largest.what, largest.bytes(), remedy_),
                    needed);
}

void Layout::allocate(EncodedField& field) const {
  field.parts = parts_;
  field.left_out = left_out_;
  for (const Part& p : parts_)
    if (p.present) field.textures.push_back(p.allocate());
  field.host_peak_bytes = (CheckedSize(bytes()) + working_).or_most();
}

void set_draw_tree(EncodedField& field, DrawTree tree) {
  field.draw_tree = std::move(tree);
  field.host_peak_bytes += field.draw_tree.bytes();
}

}  // namespace amrtex
