// The module rbvh._rbvh: what Python sees of the public library (include/rbvh).
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>

#include "python/asset.h"
#include "rbvh/error.h"
#include "rbvh/ray.h"
#include "rbvh/version.h"

namespace rbvh_python {
namespace {

std::mutex device_mutex;
// Never destroyed: Python frees its objects after C++ does.
std::optional<rbvh::Device>& the_device() {
  static auto* const held = new std::optional<rbvh::Device>;
  return *held;
}

const char* kind_name(rbvh::ErrorKind kind) {
  switch (kind) {
    case rbvh::ErrorKind::kUsage:
      return "usage";
    case rbvh::ErrorKind::kInput:
      return "input";
    case rbvh::ErrorKind::kBudget:
      return "budget";
    case rbvh::ErrorKind::kDevice:
      return "device";
    default:
      return "failure";
  }
}

/// What would help, in Python's words.
const char* remedy_words(rbvh::Remedy remedy) {
  switch (remedy) {
    case rbvh::Remedy::kOverwrite:
      return "; pass overwrite=True to replace it";
    case rbvh::Remedy::kViewUp:
      return "; give another view_up";
    case rbvh::Remedy::kNewLayer:
      return "; scale is for new ones";
    default:
      return "";
  }
}

void add_errors(py::module_& module) {
  static auto* const error_class = new py::exception<rbvh::Error>(module, "Error");
  error_class->doc() = "What is wrong with an input, a file, the device or what was asked for, in one line.";
  py::register_exception_translator(
      [](std::exception_ptr thrown) {  // NOLINT(performance-unnecessary-value-param): pybind11 wants it so
        try {
          if (thrown) std::rethrow_exception(thrown);
        } catch (const rbvh::Error& error) {
          py::object raised = static_cast<py::object&>(*error_class)(std::string(error.what()) +
                                                                     remedy_words(error.remedy()));
          raised.attr("kind") = kind_name(error.kind());
          raised.attr("file") = error.file();
          PyErr_SetObject(error_class->ptr(), raised.ptr());
        }
      });
}

py::list devices() {
  using namespace py::literals;
  py::list all;
  for (const rbvh::DeviceInfo& info : rbvh::list_devices())
    all.append(py::dict("index"_a = info.index, "name"_a = info.name, "platform"_a = info.platform,
                        "type"_a = info.is_gpu   ? "gpu"
                                   : info.is_cpu ? "cpu"
                                                 : "other",
                        "memory_bytes"_a = info.memory_bytes, "compute_units"_a = info.compute_units));
  return all;
}

void use_device(const std::string& choice) {
  const py::gil_scoped_release released;
  rbvh::Device chosen = rbvh::Device::open(choice);
  const std::scoped_lock lock(device_mutex);
  the_device() = std::move(chosen);
}

}  // namespace

const rbvh::Device& device() {
  const std::scoped_lock lock(device_mutex);
  if (!the_device()) the_device() = rbvh::Device::open();
  return *the_device();
}

rbvh::Progress check_signals() {
  return [](std::string_view, double) {
    const py::gil_scoped_acquire held;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  };
}

const rbvh::Tracer& PyAsset::tracer(const std::string& level) {
  std::unique_ptr<rbvh::Tracer>& found = tracers_[level];
  if (found) return *found;
  rbvh::TracerConfig config;
  config.level = level;
  found = rbvh::make_tracer(device(), asset, config);
  return *found;
}

void add_device(py::module_& module) {
  module.def("devices", &devices, "The OpenCL devices: a list of dicts.");
  module.def(
      "use_device", &use_device, py::arg("choice"),
      R"(Does all later work on another device: "cpu", "gpu", an index, or part of a name. What rays were cast
at before stays on its device. By default it is RBVH_DEVICE of the environment, else the first CPU.)");
}

}  // namespace rbvh_python

PYBIND11_MODULE(_rbvh, module) {
  using namespace rbvh_python;
  module.attr("__version__") = rbvh::version();
  module.attr("INVALID_ID") = RBVH_NO_LEAF;
  add_errors(module);
  AssetClass asset(
      module, "Asset",
      "What rays can be cast at: a scan, a pair with its levels, a proxy, or a scene. It may be used from "
      "several threads, of which one works at a time.");
  ScanClass scan(module, "Scan", "A triangle mesh or a cloud of oriented discs.");
  add_device(module);
  add_pair(module, asset);
  add_rays(asset);
  add_pictures(module, asset);
  add_layers(asset);
  add_scan(module, scan);
}
