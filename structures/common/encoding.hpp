// The C++ side of the sampler contract: what an encoding is to everybody else.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "structures/common/draw_tree.hpp"
#include "structures/common/host_texture.hpp"
#include "structures/common/leap_grid.hpp"
#include "structures/common/parameter.hpp"
#include "structures/common/part.hpp"
#include "structures/common/variation_grid.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/filter.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

/// Fields that one built structure may hold (AMRTEX_MOST_FIELDS in shaders/contract.glsl).
inline constexpr int kMostFields = 4;

/// Who does the linear interpolation: the texture unit or the shader.
enum class Filtering { hardware, manual };
std::string_view filtering_name(Filtering filtering);
Filtering parse_filtering(std::string_view name);

/// What a GL context offers, as far as encodings care. The defaults are "no limit known".
struct ContextInfo {
  std::string renderer, version, vendor;
  int max_3d_texture_size = 2048;                                             ///< texels along an axis
  std::int64_t max_texture_bytes = std::numeric_limits<std::int64_t>::max();  ///< of one 3D texture
  std::int64_t max_buffer_bytes = std::int64_t{1} << 27;                      ///< of one shader storage block
  bool bindless_texture = true;  ///< textures by handles; without a context they are fetched on the CPU
  bool shader_ballot = true;
  bool handles_may_differ = false;  ///< in one fetch, between invocations that run together; else each is served in turn
  std::int64_t max_resident_handles = std::numeric_limits<std::int64_t>::max();  ///< textures reached by handles at a time
  std::vector<std::string> extensions;
  bool has_texture_limit() const { return max_texture_bytes != std::numeric_limits<std::int64_t>::max(); }
  bool has_handle_limit() const { return max_resident_handles != std::numeric_limits<std::int64_t>::max(); }
};

struct Support {
  bool ok = true;
  std::string reason;  ///< why not
};

/// The one switch for what builders and shaders leave out (computed from the scene).
struct SceneNeeds {
  Filter filter = Filter::nearest;
  Filtering filtering = Filtering::manual;
  bool value_ranges = true;         ///< regions are skipped by their value range
  bool gradients = false;           ///< surfaces are lit: stored gradients are of use where an encoding has room for them
  bool analytic_gradients = false;  ///< surfaces are lit by the derivative of f, which the encoding itself computes
  bool level_of_detail = false;     ///< refined cells may be drawn in place of what lies below them
  bool draw_boxes = false;          ///< the consumer draws box by box: EncodedField::draw_tree, where the encoding can give one
  bool everything = false;          ///< nothing is left out for want of need: what leaving out saves is measured against this
  bool validity = false;            ///< bits are kept though every cell has a value
  bool border = false;              ///< a border is kept though the filter reads none
  bool variation = false;           ///< steps are chosen by how much the field varies: EncodedField::variation
  bool field_ranges = false;        ///< several fields are drawn: those beside the first have value ranges as well
  /// First and last value of intervals without extinction, ascending (renderers/bindings/scene_bindings.hpp): parts of the
  /// structure whose values lie in one of them are left out. Empty: all are kept.
  std::vector<std::array<double, 2>> invisible = {};
  bool operator==(const SceneNeeds&) const = default;
  bool keeps_validity() const { return everything || validity; }
  bool keeps_border() const { return everything || border; }
};
/// The same needs, and what brings a part back although nothing reads it. The needs themselves for Need::none.
SceneNeeds with_need(SceneNeeds needs, Need need);

/// A value of a parameter that a context cannot take.
struct UnsupportedValue {
  std::string parameter;
  Json value;
  std::string reason;
};

/// The shader's view of one built field: the file with its locate() and
/// fetch_value(), and every define that the file requires.
struct ShaderPart {
  std::string file;                                  ///< as known to the shader library, "page_table/page_table.glsl"
  std::vector<std::pair<std::string, int>> defines;  ///< name, value
  std::vector<std::string> extensions = {};          ///< of GLSL, required
};

/// Built data: plain, independent of GL and of any consumer. One field of the mesh, or several
/// over one structure; constants are those of the first, the drawn one, and so are ranges unless the scene needs all fields'.
struct EncodedField {
  std::string encoding;
  Json build_parameters;        ///< complete, with defaults filled in
  FilterDefinition definition;  ///< the mathematics that this field reproduces
  Filtering filtering = Filtering::manual;
  Storage storage = Storage::r32f;
  int field_count = 1;
  StorageScale scale;                      ///< of the first field
  std::vector<StorageScale> more_scales;   ///< of the others
  std::vector<FieldStatistics> values;     ///< of each field
  double range_origin = 0;                 ///< what coded value ranges are relative to (build_tools.hpp)
  std::vector<double> more_range_origins;  ///< of the other fields, where they have ranges (SceneNeeds::field_ranges)
  /// What was asked to be left out where nothing is to be seen (SceneNeeds::invisible): such a field shows no scene that sees any
  /// of it.
  std::vector<std::array<double, 2>> invisible;
  ShaderPart shader;
  std::vector<HostTexture> textures;
  std::vector<std::pair<std::string, Vec3i>> integer_uniforms;  ///< ivec3 uniforms of the encoding's GLSL
  LeapGrid leaps;      ///< empty where regions have no ranges, or where the encoding tells none: then rays pass region by region
  VariationGrid variation;  ///< of the first field; empty where no scene asks for it (SceneNeeds::variation)
  DrawTree draw_tree;  ///< empty where no consumer needs it, or where the encoding has no such boxes
  std::vector<LeftOut> left_out;
  Json statistics;                   ///< counts of the structure: pages, nodes, fill, ...
  std::int64_t host_peak_bytes = 0;  ///< arrays that the build itself allocated at once, the result included
  std::vector<Part> parts;           ///< that the encoding declared, absent ones too; `textures` are those that are present

  /// How field number `number` is stored. Throws UsageError naming how many fields there are.
  StorageScale scale_of(int number) const;
  MemoryByRole memory() const;
  /// Texels of the textures that hold values, of all fields.
  std::int64_t value_texels() const;
  /// Hash over names, formats, sizes and contents of everything the shader reads.
  std::string content_hash() const;
  const HostTexture* find(std::string_view name) const;
  HostTexture* find(std::string_view name);
};

struct BuildRequest {
  int field = 0;
  std::vector<int> more_fields;  ///< fetched beside `field`, at the same places
  Storage storage = Storage::r32f;
  SceneNeeds needs;
  Json parameters = Json::object();                                      ///< unknown keys are an error
  ContextInfo context;                                                   ///< limits to keep
  std::int64_t memory_limit = std::numeric_limits<std::int64_t>::max();  ///< bytes of all textures and buffers

  int field_count() const { return 1 + static_cast<int>(more_fields.size()); }
  /// Index in the mesh of field number `number`.
  int field_at(int number) const { return number == 0 ? field : more_fields[static_cast<std::size_t>(number - 1)]; }
};

/// One GPU data structure for an AMR field. Stateless; one object a registry line.
class Encoding {
 public:
  virtual ~Encoding() = default;
  virtual std::string_view name() const = 0;
  /// The filters of this encoding under some parameters (for tables and messages).
  virtual std::span<const Filter> filters() const = 0;
  virtual std::vector<ParameterInfo> parameters() const { return {}; }
  /// Rules across parameters: throws UsageError for what no mesh would make acceptable. `parameters` is complete, and each value
  /// is one that ParameterInfo::accepted has.
  virtual void check_parameters(const Json& /*parameters*/) const {}
  /// Can it be drawn in a context under any parameters? Else why not.
  virtual Support supported(const ContextInfo& /*context*/) const { return {}; }
  /// Values of parameters that build() refuses for want of something in the context, for tables and messages.
  virtual std::vector<UnsupportedValue> unsupported_values(const ContextInfo& /*context*/) const { return {}; }
  /// Can its GLSL give the derivative of f under a filter (SceneNeeds::analytic_gradients)? Else why not.
  virtual Support analytic_gradients(Filter /*filter*/) const { return {false, "its GLSL has differences of values alone"}; }
  /// Can refined cells be drawn in place of what lies below them (SceneNeeds::level_of_detail)? Else why not.
  virtual Support level_of_detail() const { return {false, "it stores no values of refined cells"}; }
  /// Can parts that the transfer function hides be left out (SceneNeeds::invisible)? Others refuse to be asked.
  virtual bool prunes() const { return false; }
  /// The mathematics that a field built from the request reproduces. Throws UsageError for a bad parameter.
  virtual FilterDefinition definition(const AmrHierarchy& /*hierarchy*/, const BuildRequest& request) const {
    return {.filter = request.needs.filter};
  }
  /// Builds the field. Throws UsageError for a bad parameter, UnsupportedError for
  /// a filter or a size that this encoding cannot take (naming what it can), and
  /// BudgetError before allocation when the result would pass the limits.
  virtual EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const = 0;
};

/// All encodings, in the order of the lines in structures/CMakeLists.txt.
std::span<const Encoding* const> all_encodings();
/// Throws a UsageError that names the known ones.
const Encoding& find_encoding(std::string_view name);

/// Checks keys and values and fills in defaults. Throws UsageError.
Json complete_parameters(const Encoding& encoding, const Json& given);
/// Throws UnsupportedError naming the filters that the encoding has.
void require_filter(const Encoding& encoding, Filter filter);
/// Throws UnsupportedError with the reason and the encodings that have it when a level of detail is needed and not there.
void require_level_of_detail(const Encoding& encoding, const SceneNeeds& needs);
/// The same of analytic gradients.
void require_analytic_gradients(const Encoding& encoding, const SceneNeeds& needs);
/// Throws UsageError that says how many fields are supported, or which index the mesh does not have, and
/// UnsupportedError where parts are to be left out and the encoding has none that could be.
void require_fields(const Encoding& encoding, const AmrHierarchy& hierarchy, const BuildRequest& request);

}  // namespace amrtex
