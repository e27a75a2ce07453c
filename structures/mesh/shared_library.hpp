// A library opened by its name while the program runs, so that the program starts without it.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace amrtex {

/// Stays open until the process ends: drivers leave threads and exit handlers behind. Copies are the same library.
class SharedLibrary {
 public:
  /// The first of `names`, each a path or what the loader searches for. Throws Error with the loader's reason for every one.
  explicit SharedLibrary(std::span<const std::string> names);

  const std::string& name() const { return name_; }  ///< as it was opened

  /// Null where the library has no such function.
  template <class Function>
  Function* find(const char* function) const {
    return reinterpret_cast<Function*>(address(function));
  }
  /// Throws Error that names library and function.
  template <class Function>
  Function* require(const char* function) const {
    return reinterpret_cast<Function*>(required_address(function));
  }

 private:
  void* address(const char* function) const;
  void* required_address(const char* function) const;

  void* handle_ = nullptr;
  std::string name_;
};

/// The one library that the environment variable names where it is set, else `names`.
std::vector<std::string> library_names(const char* variable, std::vector<std::string> names);

}  // namespace amrtex
