// The OpenCL devices of this machine, and the choice of one.
#pragma once

#include <string>
#include <vector>

#include "pipeline/device/cl.h"
#include "pipeline/device/device.h"

namespace rbvh::device_detail {

struct FoundDevice {
  DeviceInfo info;
  cl::Device device;
};

/// All of every platform that are available and have a compiler, in the loader's order.
std::vector<FoundDevice> find_devices();

/// By the words of Device::open(); nullptr where none fits.
const FoundDevice* choose_device(const std::vector<FoundDevice>& devices, const std::string& choice);

}  // namespace rbvh::device_detail
