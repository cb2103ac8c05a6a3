// What the process exits with, and which kind of error becomes which code.
#pragma once

#include <stdexcept>

#include "pipeline/base/error.h"

namespace rbvh {

enum class ExitCode : int {
  kOk = 0,
  kFailure = 1,  ///< an output that cannot be written, a full disk
  kUsage = 2,    ///< wrong words on the command line
  kInput = 3,    ///< input missing, cut, malformed, unsupported
  kBatch = 4,    ///< part of a batch failed
  kBudget = 5,   ///< over a memory or error budget
  kDevice = 6,   ///< no usable OpenCL device
};

inline ExitCode exit_code(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::kUsage:
      return ExitCode::kUsage;
    case ErrorKind::kInput:
      return ExitCode::kInput;
    case ErrorKind::kBudget:
      return ExitCode::kBudget;
    case ErrorKind::kDevice:
      return ExitCode::kDevice;
    case ErrorKind::kFailure:
      break;
  }
  return ExitCode::kFailure;
}

/// Some of a batch's files failed, each with its own line; the others are done.
class BatchFailure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace rbvh
