#include "structures/mesh/shared_library.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdlib>

#include "structures/mesh/error.hpp"

namespace amrtex {

SharedLibrary::SharedLibrary(std::span<const std::string> names) {
  std::vector<std::string> reasons;
  for (const std::string& name : names) {
    handle_ = ::dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (handle_ != nullptr) {
      name_ = name;
      return;
    }
    const char* reason = ::dlerror();
    reasons.emplace_back(reason != nullptr ? reason : name + " cannot be opened");
  }
  throw Error(fmt::format("{}", fmt::join(reasons, "; ")));
}

void* SharedLibrary::address(const char* function) const { return ::dlsym(handle_, function); }

void* SharedLibrary::required_address(const char* function) const {
  void* found = address(function);
  if (found == nullptr) throw Error(fmt::format("{} has no function {}", name_, function));
  return found;
}

std::vector<std::string> library_names(const char* variable, std::vector<std::string> names) {
  const char* chosen = std::getenv(variable);
  if (chosen != nullptr && *chosen != '\0') return {chosen};
  return names;
}

}  // namespace amrtex
