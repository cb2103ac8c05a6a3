// The two kinds of error: Error for bad input, device or environment (thrown where the fact is known, caught
// once by the caller), and RBVH_CHECK for a bug of our own.
#pragma once

#include "rbvh/error.h"

namespace rbvh {

[[noreturn]] void check_failed(const char* expression, const char* file, int line);

}  // namespace rbvh

#define RBVH_CHECK(expression) \
  ((expression) ? static_cast<void>(0) : ::rbvh::check_failed(#expression, __FILE__, __LINE__))
