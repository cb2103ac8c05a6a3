// The two kinds of error: Error for bad input, device or environment (thrown where the fact is known, caught
// once in main), and RBVH_CHECK for a bug of our own.
#pragma once

#include <stdexcept>
#include <string>

namespace rbvh {

/// What kind of thing went wrong, for callers that react to it.
enum class ErrorKind {
  kFailure,  ///< an output that cannot be written, a full disk
  kUsage,    ///< something was asked for that makes no sense for this input
  kInput,    ///< an input is missing, cut, malformed or unsupported
  kBudget,   ///< over a memory or error budget
  kDevice,   ///< no usable OpenCL device
};

/// One line: what is wrong, where (byte, line, element), what to do. `file` may be empty. The stage's name is
/// put in front by main.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& file, const std::string& what)
      : std::runtime_error(file.empty() ? what : file + ": " + what), kind_(kind) {}
  ErrorKind kind() const { return kind_; }

 private:
  ErrorKind kind_;
};

[[noreturn]] void check_failed(const char* expression, const char* file, int line);

}  // namespace rbvh

#define RBVH_CHECK(expression) \
  ((expression) ? static_cast<void>(0) : ::rbvh::check_failed(#expression, __FILE__, __LINE__))
