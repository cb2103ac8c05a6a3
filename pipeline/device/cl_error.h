// Every OpenCL failure becomes an Error with the call, the code's name and the device.
#pragma once

#include <string>

#include "pipeline/device/cl.h"
#include "pipeline/device/device.h"

namespace rbvh::device_detail {

/// "CL_OUT_OF_RESOURCES".
const char* cl_error_name(cl_int code);

/// `what`: the kernel or buffer concerned. Memory that is not there is over budget, anything else a device
/// failure.
[[noreturn]] void throw_cl(const DeviceInfo& device, const std::string& what, const cl::Error& error);

/// call(), whose cl::Error becomes an Error.
template <class Call>
decltype(auto) guarded(const DeviceInfo& device, const std::string& what, Call&& call) {
  try {
    return call();
  } catch (const cl::Error& error) {
    throw_cl(device, what, error);
  }
}

}  // namespace rbvh::device_detail
