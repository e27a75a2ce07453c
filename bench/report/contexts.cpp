#include "bench/report/contexts.hpp"

#include <fmt/format.h>

#include <set>
#include <vector>

#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"

namespace amrtex {
namespace {

std::string text_at(const Json& context, const char* pointer) {
  const Json& value = value_at(context, pointer);
  if (value.is_null()) return "none";
  return value.is_string() ? value.get<std::string>() : value.dump();
}

/// What context_key() looks at beside the renderer, and how it is told.
struct Part {
  const char* pointer;
  const char* front;
  const char* back;
};
constexpr Part kParts[] = {{"/device", "device ", ""}, {"/gl_version", "GL ", ""}, {"/cpu", "", ""}, {"/cores", "", " cores"}};

/// Contexts of one renderer: key -> name.
std::map<std::string, std::string> told_apart(const std::string& renderer, const std::map<std::string, const Json*>& contexts) {
  std::map<std::string, std::string> names;
  for (const auto& [key, context] : contexts) names[key] = renderer;
  for (const Part& part : kParts) {
    std::set<std::string> texts;
    for (const auto& [key, context] : contexts) texts.insert(text_at(*context, part.pointer));
    if (texts.size() < 2) continue;
    for (const auto& [key, context] : contexts)
      names[key] += fmt::format(", {}{}{}", part.front, text_at(*context, part.pointer), part.back);
  }
  return names;
}

}  // namespace

ContextNames::ContextNames(std::span<const Json> records) {
  std::map<std::string, std::map<std::string, const Json*>> by_renderer;
  for (const Json& record : records) {
    const Json& context = value_at(record, "/context");
    by_renderer[text_at(context, "/renderer")].try_emplace(context_key(context), &context);
  }
  for (const auto& [renderer, contexts] : by_renderer) by_key_.merge(told_apart(renderer, contexts));
}

const std::string& ContextNames::of(const Json& record) const { return by_key_.at(context_key(value_at(record, "/context"))); }

}  // namespace amrtex
