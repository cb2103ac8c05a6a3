// What is said where what was asked for is refused.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "pipeline/base/error.h"

namespace rbvh {

/// The message of the Error(kUsage) that `work` must end with.
inline std::string usage_refusal(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kUsage);
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

}  // namespace rbvh
