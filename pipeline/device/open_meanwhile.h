#pragma once

#include <future>
#include <string>

#include "rbvh/device.h"

namespace rbvh {

/// Device::open() on another thread, while the caller reads files: the OpenCL runtime takes as long. Sets an
/// environment variable first: to be called before other threads start.
std::future<Device> open_meanwhile(const std::string& choice);

}  // namespace rbvh
