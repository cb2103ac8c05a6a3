// The two kinds of error: Error for bad input, device or environment (thrown where the fact is known, caught
// once in main), and RBVH_CHECK for a bug of our own.
#pragma once

#include <stdexcept>
#include <string>

namespace rbvh {

/// Process exit codes of the command line.
enum class ExitCode : int {
  kOk = 0,
  kFailure = 1,  ///< an output that cannot be written, a full disk
  kUsage = 2,    ///< wrong words on the command line
  kInput = 3,    ///< input missing, cut, malformed, unsupported
  kBatch = 4,    ///< part of a batch failed
  kBudget = 5,   ///< over a memory or error budget
  kDevice = 6,   ///< no usable OpenCL device
  kInterrupted = 130,
};

/// One line: what is wrong, where (byte, line, element), what to do. `file` may be empty. The stage's name is
/// put in front by main.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& file, const std::string& what)
      : std::runtime_error(file.empty() ? what : file + ": " + what), code_(code) {}
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

[[noreturn]] void check_failed(const char* expression, const char* file, int line);

}  // namespace rbvh

#define RBVH_CHECK(expression) \
  ((expression) ? static_cast<void>(0) : ::rbvh::check_failed(#expression, __FILE__, __LINE__))
