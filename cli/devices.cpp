// rbvh devices: the OpenCL devices of this machine.
#include "pipeline/device/device.h"

#include <memory>

#include "cli/common.h"
#include "cli/stages.h"
#include "io/report_json.h"
#include "io/report_text.h"

namespace rbvh {
namespace {

void run_devices(bool as_json) {
  const std::vector<DeviceInfo> devices = list_devices();
  if (as_json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const DeviceInfo& info : devices) list.push_back(device_json(info));
    print_json(list);
  } else {
    for (const DeviceInfo& info : devices) print_data(device_line(info));
  }
  if (devices.empty())
    throw Error(ErrorKind::kDevice, "",
                "no OpenCL device; install one, e.g. the Debian package pocl-opencl-icd");
}

}  // namespace

void add_devices(CLI::App& app, Context& context) {
  const auto as_json = std::make_shared<bool>(false);
  CLI::App* stage =
      add_stage(app, context, {"devices", "List the OpenCL devices of this machine", "rbvh devices --json"},
                0, [as_json] { run_devices(*as_json); });
  stage->add_flag("--json", *as_json, "as JSON");
}

}  // namespace rbvh
