// The one exception of the libraries, and the two kinds of it that callers treat specially.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace amrtex {

/// Bad input, a failed GL call, a shader log. The message names the file, the
/// encoding or the parameter, and what would be accepted.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A name, key or option that does not exist: the command ends with exit code 2 before any work.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// A known thing that this encoding or this context cannot do; a record `unsupported`.
class UnsupportedError : public Error {
 public:
  using Error::Error;
};

/// More bytes than `--memory-limit` allows, found before anything was allocated; a record `over_budget`.
class BudgetError : public Error {
 public:
  explicit BudgetError(const std::string& what, std::int64_t needed_bytes = 0) : Error(what), needed_bytes_(needed_bytes) {}
  std::int64_t needed_bytes() const { return needed_bytes_; }  ///< 0 where they are not known

 private:
  std::int64_t needed_bytes_;
};

}  // namespace amrtex
