#include "pipeline/device/open_meanwhile.h"

#include "pipeline/device/prepare_pocl.h"

namespace rbvh {

std::future<Device> open_meanwhile(const std::string& choice) {
  device_detail::prepare_pocl();  // changes the environment, which no other thread may read then
  return std::async(std::launch::async, [choice] { return Device::open(choice); });
}

}  // namespace rbvh
