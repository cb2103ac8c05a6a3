#include "pipeline/device/find_devices.h"

#include <algorithm>
#include <cctype>
#include <charconv>

#include "pipeline/device/prepare_pocl.h"

namespace rbvh {
namespace device_detail {
namespace {

std::string trimmed(const std::string& text) {
  const std::size_t from = text.find_first_not_of(" \t\n");
  const std::size_t to = text.find_last_not_of(std::string_view(" \t\n\0", 4));
  return from == std::string::npos ? std::string() : text.substr(from, to - from + 1);
}

DeviceInfo describe(const cl::Platform& platform, const cl::Device& device) {
  DeviceInfo info;
  info.platform = trimmed(platform.getInfo<CL_PLATFORM_NAME>());
  info.name = trimmed(device.getInfo<CL_DEVICE_NAME>());
  info.version = trimmed(device.getInfo<CL_DEVICE_VERSION>());
  info.driver = trimmed(device.getInfo<CL_DRIVER_VERSION>());
  const cl_device_type type = device.getInfo<CL_DEVICE_TYPE>();
  info.is_cpu = (type & CL_DEVICE_TYPE_CPU) != 0;
  info.is_gpu = (type & CL_DEVICE_TYPE_GPU) != 0;
  info.memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
  info.max_buffer_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  info.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
  const std::string extensions = device.getInfo<CL_DEVICE_EXTENSIONS>();
  info.has_int64_atomics = extensions.find("cl_khr_int64_base_atomics") != std::string::npos &&
                           extensions.find("cl_khr_int64_extended_atomics") != std::string::npos;
  return info;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

std::vector<FoundDevice> find_devices() {
  prepare_pocl();
  std::vector<FoundDevice> found;
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    return found;  // no ICD: the loader calls that an error
  }
  for (const cl::Platform& platform : platforms) {
    try {
      std::vector<cl::Device> devices;
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
      for (const cl::Device& device : devices) {
        if (!device.getInfo<CL_DEVICE_AVAILABLE>() || !device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>())
          continue;
        found.push_back({describe(platform, device), device});
        found.back().info.index = static_cast<int>(found.size()) - 1;
      }
    } catch (const cl::Error&) {
      continue;  // a platform without devices
    }
  }
  tidy_pocl_cache();
  return found;
}

const FoundDevice* choose_device(const std::vector<FoundDevice>& devices, const std::string& choice) {
  const auto first = [&](auto&& fits) -> const FoundDevice* {
    const auto at = std::find_if(devices.begin(), devices.end(), fits);
    return at == devices.end() ? nullptr : &*at;
  };
  const auto is_cpu = [](const FoundDevice& d) { return d.info.is_cpu; };
  if (choice.empty()) {
    const FoundDevice* cpu = first(is_cpu);
    return cpu != nullptr || devices.empty() ? cpu : &devices.front();
  }
  if (lower(choice) == "cpu") return first(is_cpu);
  if (lower(choice) == "gpu") return first([](const FoundDevice& d) { return d.info.is_gpu; });
  int index = 0;
  const char* end = choice.data() + choice.size();
  if (const auto [at, error] = std::from_chars(choice.data(), end, index);
      error == std::errc() && at == end) {
    return first([&](const FoundDevice& d) { return d.info.index == index; });
  }
  return first(
      [&](const FoundDevice& d) { return lower(d.info.name).find(lower(choice)) != std::string::npos; });
}

}  // namespace device_detail

std::vector<DeviceInfo> list_devices() {
  std::vector<DeviceInfo> infos;
  for (const device_detail::FoundDevice& found : device_detail::find_devices()) infos.push_back(found.info);
  return infos;
}

}  // namespace rbvh
