// Times of two contexts never stand in one table: what tables call the contexts, so that each has its own.
#pragma once

#include <map>
#include <span>
#include <string>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// The renderer's name; where several contexts have it, with what tells them apart: device, GL version, processor, cores. "none"
/// for records without a context.
class ContextNames {
 public:
  explicit ContextNames(std::span<const Json> records);
  /// Of one of the records.
  const std::string& of(const Json& record) const;

 private:
  std::map<std::string, std::string> by_key_;
};

}  // namespace amrtex
