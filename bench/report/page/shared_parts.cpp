#include "bench/report/page/shared_parts.hpp"

#include <string>
#include <unordered_map>

namespace amrtex {
namespace {

/// What is shorter is no longer than what would stand for it.
constexpr std::size_t kLeastBytes = 32;

std::string text_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

class Sharing {
 public:
  /// Parts of what is counted already are not counted again: they occur where it does.
  void count(const Json& json) {
    if (!json.is_structured()) return;
    const std::string text = text_of(json);
    if (text.size() < kLeastBytes) return;
    if (++parts_[text].times > 1) return;
    for (const Json& child : json) count(child);
  }

  Json shared(const Json& json) {
    if (!json.is_structured()) return json;
    const std::string text = text_of(json);
    const auto part = parts_.find(text);
    if (part == parts_.end() || part->second.times < 2) return with_shared_children(json);
    if (part->second.number < 0) {
      Json own = with_shared_children(json);  // before it has a number itself
      part->second.number = static_cast<int>(list_.size());
      list_.push_back(std::move(own));
    }
    return {{kSharedPart, part->second.number}};
  }

  Json list() { return std::move(list_); }

 private:
  struct Part {
    int times = 0;
    int number = -1;
  };

  Json with_shared_children(const Json& json) {
    Json copy = json.is_object() ? Json::object() : Json::array();
    if (json.is_object())
      for (const auto& [key, value] : json.items()) copy[key] = shared(value);
    else
      for (const Json& value : json) copy.push_back(shared(value));
    return copy;
  }

  std::unordered_map<std::string, Part> parts_;
  Json list_ = Json::array();
};

}  // namespace

Json share_parts(std::span<const Json* const> records) {
  Sharing sharing;
  for (const Json* record : records) sharing.count(*record);
  Json shared = Json::array();
  for (const Json* record : records) shared.push_back(sharing.shared(*record));
  return {{"parts", sharing.list()}, {"records", std::move(shared)}};
}

}  // namespace amrtex
