#include "pipeline/device/open_meanwhile.h"

#include "pipeline/device/find_devices.h"

namespace rbvh {

std::future<Device> open_meanwhile(const std::string& choice) {
  device_detail::set_pocl_threads();  // changes the environment, which no other thread may read then
  return std::async(std::launch::async, [choice] { return Device::open(choice); });
}

}  // namespace rbvh
