// A key of a scene or an experiment, said once: the values that it accepts, its default, what it goes with, whether a reference
// picture depends on it, and how it stands in records and tables. Parsers, checks, the names of records and of cached references,
// tables and the documentation all follow from these rows.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "structures/mesh/error.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

struct Key;

enum class Kind { boolean, integer, number, text, choice, object };

/// The values that a key accepts. A list that lies deeper than `depth` is an axis.
struct ValueType {
  Kind kind = Kind::text;
  int depth = 0;          ///< lists around an element that belong to one value
  std::size_t width = 0;  ///< elements of the innermost list; 0: any number of them
  std::size_t most = 0;   ///< elements of the outermost list; 0: any number of them
  double min = std::numeric_limits<double>::lowest();
  double max = std::numeric_limits<double>::max();
  bool above = false;  ///< `min` itself is not accepted
  bool below = false;  ///< nor `max`
  std::vector<std::string> choices = {};
  std::vector<std::pair<std::string, std::string>> aliases = {};  ///< another name of a choice, and the choice
  std::string form = {};                                          ///< of a list: "three numbers [x, y, z]"
  std::vector<Key> members = {};                                  ///< of an object
  bool nullable = false;
  bool may_be_empty = false;  ///< the outermost list

  ValueType or_null() const;
};

ValueType boolean_type();
ValueType integer_type(std::int64_t min, std::int64_t max);
ValueType number_type();
ValueType number_type(double min, double max);
ValueType number_above(double min, double max = std::numeric_limits<double>::max());
ValueType text_type();
ValueType choice_type(std::vector<std::string> choices);
ValueType object_type(std::vector<Key> members);
/// Lists of `width` elements each; "three numbers [x, y, z]". A width of 0 takes any number of elements.
ValueType list_of(ValueType element, std::size_t width, std::string form);
/// Lists of lists.
ValueType lists_of(ValueType element, std::size_t width, std::string form);

/// "a number above 0", "dvr, projection, mip"; how messages and documentation tell what is accepted.
std::string accepted_text(const ValueType& type);
/// Lists around the first element.
int list_depth(const Json& json);

/// What is wrong with a value, and where in it: "[0][2]", ".radius", "" for the value itself.
struct Problem {
  std::string place;
  std::string text;
};
std::optional<Problem> value_problem(const Json& value, const ValueType& type);

/// What happens to a key where a condition of it does not hold.
enum class Otherwise {
  idle,        ///< it means nothing there and is not looked at
  belongs,     ///< the same, and a file that says it there is refused
  refused,     ///< settings that use it there are refused
  unsupported  ///< a point of it becomes a record `unsupported`
};

/// What a key goes with.
struct Condition {
  std::string with;            ///< another key of the same table
  std::vector<Json> accepted;  ///< values of that key; empty: any but its default
  Otherwise otherwise;
  std::string why = {};         ///< why it goes with no others
  std::vector<Json> when = {};  ///< own values that ask for it; empty: any but the default
};

/// What only some encodings can do; which ones, they say themselves.
enum class Capability { any, level_of_detail, pruning };

/// Does a picture of the double reference depend on the key? Every key must say so: there is no default.
class AffectsReference {
 public:
  enum Answer { no, yes };
  constexpr AffectsReference(Answer answer) : yes_(answer == yes) {}
  constexpr explicit operator bool() const { return yes_; }

 private:
  bool yes_;
};

/// When a key stands in a record. One that has no use in the settings is null, or absent, there.
enum class Recorded { always, where_it_applies, where_given, never };

/// A column of the tables; without a label there is none.
struct KeyColumn {
  std::string label = {};  ///< with its unit in brackets
  bool numeric = false;
  bool only_where_given = false;  ///< no value where the key has its default
};

struct Key {
  std::string name;
  ValueType type;
  AffectsReference reference;
  std::string help = {};
  std::string unit = {};
  Json default_value = nullptr;
  std::string default_text = {};  ///< of the documentation, where no value says it: "the first field"
  bool required = false;          ///< where it applies
  bool label = false;             ///< a name for people: it tells no two measurements apart
  bool derived = false;           ///< follows from others: records hold it and files do not
  std::string record_name = {};   ///< where it stands in a record, if not under its own name
  Recorded recorded = Recorded::always;
  KeyColumn column = {};
  std::vector<Condition> takes = {};
  Capability capability = Capability::any;
  /// Another key and the value that it has where this one is given and that is not.
  std::pair<std::string, Json> stands_for = {};

  const std::string& in_record() const { return record_name.empty() ? name : record_name; }
};

/// Why `value` of a key is refused beside the other keys, whose values `other` tells; nothing where it is not.
std::optional<std::string> condition_problem(const Key& key, const Json& value, Otherwise otherwise,
                                             const std::function<Json(const std::string&)>& other,
                                             const std::function<Json(const std::string&)>& default_of);
/// That a required key is not there.
Problem missing(const Key& key);
/// The value without the members of objects that are not kept.
Json kept_members(Json value, const ValueType& type, const std::function<bool(const Key&)>& keep);
/// Throws a UsageError "what: 'key': problem".
[[noreturn]] void throw_problem(std::string_view what, std::string_view key, const Problem& problem);
/// Throws UsageErrors that start with `what`: no object, a key that there is not, one that is missing.
void require_keys(const Json& json, std::span<const Key* const> keys, std::string_view what);

/// A key and the variable that it stands for.
template <class T>
struct Setting {
  Key key;
  Json (*get)(const T&);
  void (*set)(T&, const Json&);  ///< a value of the right type; takes the default too
  /// What no type can say: values that do not fit each other. Empty where all is well.
  std::string (*problem)(const T&) = nullptr;
};

/// What is wrong with settings: the key, and what value_problem says.
struct Complaint {
  const Key* key;
  Problem problem;
};

/// The keys of one object of a file.
template <class T>
class SettingTable {
 public:
  /// Defaults are those of `T{}`: each is said there and nowhere else.
  SettingTable(std::string section, std::vector<Setting<T>> rows) : section_(std::move(section)), rows_(std::move(rows)) {
    for (Setting<T>& row : rows_) row.key.default_value = row.get(T{});
  }

  const std::string& section() const { return section_; }
  std::span<const Setting<T>> rows() const { return rows_; }
  std::vector<const Key*> keys() const {
    std::vector<const Key*> keys;
    for (const Setting<T>& row : rows_) keys.push_back(&row.key);
    return keys;
  }
  const Setting<T>* find(std::string_view name) const {
    for (const Setting<T>& row : rows_)
      if (row.key.name == name) return &row;
    return nullptr;
  }

  /// Has the key a meaning beside the others?
  bool applies(const Setting<T>& row, const T& settings) const {
    return !problem_of(row, settings, Otherwise::idle, nullptr) && !problem_of(row, settings, Otherwise::belongs, nullptr);
  }
  /// The value, or the default where it has no meaning.
  Json value(const Setting<T>& row, const T& settings) const {
    return applies(row, settings) ? row.get(settings) : row.key.default_value;
  }

  /// The first thing that is wrong with one key, or with any.
  std::optional<Complaint> complaint(const Setting<T>& row, const T& settings) const;
  std::optional<Complaint> complaint(const T& settings) const {
    for (const Setting<T>& row : rows_)
      if (auto found = complaint(row, settings)) return found;
    return std::nullopt;
  }
  /// Why nothing but a record `unsupported` comes of these settings.
  std::optional<Complaint> unsupported(const T& settings) const {
    for (const Setting<T>& row : rows_)
      if (auto why =
              !applies(row, settings) ? std::nullopt : problem_of(row, settings, Otherwise::unsupported, &row.key.default_value))
        return Complaint{&row.key, {"", *why}};
    return std::nullopt;
  }

  /// Gives keys that have no use in the settings their default, so that settings which differ in them alone are equal.
  void reset_idle(T& settings) const {
    for (const Setting<T>& row : rows_)
      if (!applies(row, settings)) row.set(settings, row.key.default_value);
  }

  /// What a record holds.
  Json record(const T& settings) const {
    Json json = Json::object();
    for (const Setting<T>& row : rows_) {
      const Recorded recorded = row.key.recorded;
      const bool applies_here = applies(row, settings);
      if (recorded == Recorded::always) json[row.key.in_record()] = applies_here ? row.get(settings) : Json();
      if (recorded == Recorded::where_it_applies && applies_here) json[row.key.in_record()] = row.get(settings);
      if (recorded == Recorded::where_given && applies_here && row.get(settings) != row.key.default_value)
        json[row.key.in_record()] = row.get(settings);
    }
    return json;
  }
  /// What tells two settings apart: without names, and without keys at their default, so that a new key renames nothing.
  Json configuration(const T& settings) const {
    return different(settings, [](const Key& key) { return !key.label; });
  }
  /// The same of all that a reference picture depends on.
  Json reference(const T& settings) const {
    return different(settings, [](const Key& key) { return !key.label && key.reference; });
  }

  /// The settings of a JSON object. Throws UsageErrors that start with `what` and name the key.
  T parse(const Json& json, std::string_view what) const {
    require_keys(json, keys(), what);
    T settings;
    for (const Setting<T>& row : rows_) {
      const auto given = json.find(row.key.name);
      if (given == json.end() || (given->is_null() && row.key.type.nullable)) continue;
      if (const auto problem = value_problem(*given, row.key.type)) throw_problem(what, row.key.name, *problem);
      row.set(settings, *given);
    }
    for (const Setting<T>& row : rows_)
      if (const auto problem = misplaced(row, settings, json.contains(row.key.name))) throw_problem(what, row.key.name, *problem);
    reset_idle(settings);
    if (const auto found = complaint(settings)) throw_problem(what, found->key->name, found->problem);
    return settings;
  }
  /// A key that is given where it belongs to others, or that is missing.
  std::optional<Problem> misplaced(const Setting<T>& row, const T& settings, bool given) const {
    if (given) {
      if (const auto why = problem_of(row, settings, Otherwise::belongs, nullptr)) return Problem{"", *why};
    } else if (row.key.required && applies(row, settings)) {
      return missing(row.key);
    }
    return std::nullopt;
  }

 private:
  /// `unused`: the value at which the key asks for nothing; null where conditions hold for all values.
  std::optional<std::string> problem_of(const Setting<T>& row, const T& settings, Otherwise otherwise, const Json* unused) const {
    bool any = false;
    for (const Condition& c : row.key.takes) any = any || c.otherwise == otherwise;
    if (!any) return std::nullopt;
    const Json own = row.get(settings);
    if (unused != nullptr && own == *unused) return std::nullopt;
    return condition_problem(
        row.key, own, otherwise, [&](const std::string& name) { return value(*find(name), settings); },
        [&](const std::string& name) { return find(name)->key.default_value; });
  }

  template <class Keep>
  Json different(const T& settings, Keep keep) const {
    Json json = Json::object();
    for (const Setting<T>& row : rows_) {
      if (!keep(row.key) || !applies(row, settings)) continue;
      Json own = row.get(settings);
      if (own != row.key.default_value || row.key.required)
        json[row.key.in_record()] = kept_members(std::move(own), row.key.type, keep);
    }
    return json;
  }

  std::string section_;
  std::vector<Setting<T>> rows_;
};

template <class T>
std::optional<Complaint> SettingTable<T>::complaint(const Setting<T>& row, const T& settings) const {
  if (!applies(row, settings)) return std::nullopt;
  const Json own = row.get(settings);
  if (row.key.required && (own.is_null() || (own.is_array() && own.empty()))) return Complaint{&row.key, missing(row.key)};
  if (own == row.key.default_value && !row.key.required) return std::nullopt;
  const Json given = kept_members(own, row.key.type, [](const Key& member) { return !member.derived; });
  if (auto problem = value_problem(given, row.key.type)) return Complaint{&row.key, *problem};
  if (auto why = problem_of(row, settings, Otherwise::refused, &row.key.default_value)) return Complaint{&row.key, {"", *why}};
  if (row.problem == nullptr) return std::nullopt;
  const std::string text = row.problem(settings);
  return text.empty() ? std::nullopt : std::optional(Complaint{&row.key, {"", text}});
}

}  // namespace amrtex
