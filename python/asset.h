// What Python holds of the library: an asset and the tracers that rays are cast with.
#pragma once

#include <pybind11/pybind11.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "rbvh/asset.h"
#include "rbvh/device.h"
#include "rbvh/tracer.h"

namespace rbvh_python {

namespace py = pybind11;

/// A scan, pair, proxy or scene. Its tracers are made when they are wanted. Work on it is done without
/// Python's lock, under its own.
struct PyAsset {
  explicit PyAsset(rbvh::Asset held) : asset(std::move(held)) {}

  rbvh::Asset asset;
  std::mutex mutex;

  /// With `mutex` held.
  const rbvh::Tracer& tracer(const std::string& level);
  void forget_tracers() { tracers_.clear(); }

 private:
  std::map<std::string, std::unique_ptr<rbvh::Tracer>> tracers_;
};

/// An asset that is a scan, whose arrays Python sees.
struct PyScan : PyAsset {
  using PyAsset::PyAsset;
  rbvh::Scan& scan() { return *asset.scan(); }
};

/// The device that all work is done on: that of use_device(), else RBVH_DEVICE, else the first CPU.
const rbvh::Device& device();

/// Lets Ctrl-C stop long work.
rbvh::Progress check_signals();

using AssetClass = py::class_<PyAsset, std::shared_ptr<PyAsset>>;
using ScanClass = py::class_<PyScan, PyAsset, std::shared_ptr<PyScan>>;

// What the files of this folder add to the module.
void add_device(py::module_& module);
void add_scan(py::module_& module, ScanClass& scan);
void add_pair(py::module_& module, AssetClass& asset);
void add_rays(AssetClass& asset);
void add_pictures(py::module_& module, AssetClass& asset);
void add_layers(AssetClass& asset);

}  // namespace rbvh_python
