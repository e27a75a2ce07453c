#include "renderers/cpu/cpu_inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <string>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

class Inputs {
 public:
  Inputs(portable::Bindings& bindings, const ShaderKey& key) : bindings_(bindings), key_(key), text_(assemble_shader(key)) {}

  void set_defines() {
    for (const auto& [name, place] : bindings_.ints)
      if (name.starts_with("AMRTEX_")) *place.first = 0;  // as a part of the text that the scene leaves out
    for (const auto& [name, text] : key_.defines)
      if (const auto it = bindings_.ints.find(name); it != bindings_.ints.end()) *it->second.first = number(name, text);
  }

  void set_uniforms(const UniformValues& uniforms) {
    for (const UniformValue& u : uniforms) set_uniform(u);
    for (const ShaderInput& input : text_.uniforms) {
      const auto given = given_.find(input.name);
      if (given == given_.end()) fail("uniform", input, "is not set");
      if (given->second.numbers != given->second.components * input.count)
        fail("uniform", input,
             fmt::format("has {} numbers; {} are expected", given->second.numbers, given->second.components * input.count));
    }
  }

  void bind(const std::vector<const HostTexture*>& textures) {
    for (const HostTexture* t : textures)
      if (const auto it = bindings_.resources.find(t->name); it != bindings_.resources.end()) it->second->bind(*t);
    for (const ShaderInput& input : text_.resources)
      if (std::none_of(textures.begin(), textures.end(), [&](const HostTexture* t) { return t->name == input.name; }))
        fail("texture or buffer", input, "is not bound");
  }

 private:
  struct Given {
    int numbers = 0;
    int components = 1;  ///< of each element
  };

  [[noreturn]] void fail(std::string_view what, const ShaderInput& input, std::string_view problem) const {
    throw Error(fmt::format("{} of {}: {} {}, declared at {}, {}", key_.entry, key_.encoding_file, what, input.name, input.place,
                            problem));
  }

  int number(const std::string& name, const std::string& text) const {
    int value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      throw Error(fmt::format("{} of {}: {} is '{}'; accepted: a whole number", key_.entry, key_.encoding_file, name, text));
    return value;
  }

  /// Copies numbers into the member of that name, as many as it has room for.
  template <class From, class To>
  void copy(const std::string& name, const std::vector<From>& numbers, std::map<std::string, portable::Numbers<To>>& members) {
    const auto it = members.find(name);
    if (it == members.end()) return;
    const portable::Numbers<To>& member = it->second;
    const auto room = static_cast<std::size_t>(member.components) * static_cast<std::size_t>(member.most);
    std::transform(numbers.begin(), numbers.begin() + std::ptrdiff_t(std::min(numbers.size(), room)), member.first,
                   [](From v) { return static_cast<To>(v); });
    given_[name] = {static_cast<int>(numbers.size()), member.components};
  }

  void set_uniform(const UniformValue& u) {
    if (const auto* ints = std::get_if<std::vector<int>>(&u.numbers)) {
      copy(u.name, *ints, bindings_.ints);
      return;
    }
    const auto& reals = std::get<std::vector<double>>(u.numbers);
    copy(u.name, reals, bindings_.floats);
    copy(u.name, reals, bindings_.doubles);
  }

  portable::Bindings& bindings_;
  const ShaderKey& key_;
  AssembledShader text_;
  std::map<std::string, Given> given_;
};

}  // namespace

void set_inputs(portable::Bindings& bindings, const ShaderKey& key, const UniformValues& uniforms,
                const std::vector<const HostTexture*>& textures) {
  Inputs inputs(bindings, key);
  inputs.set_defines();
  inputs.set_uniforms(uniforms);
  inputs.bind(textures);
}

}  // namespace amrtex
