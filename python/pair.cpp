// Pairs: built, opened, saved, and what any asset holds.
#include <optional>
#include <variant>

#include <pybind11/stl.h>

#include "python/arrays.h"
#include "python/asset.h"
#include "rbvh/build.h"
#include "rbvh/error.h"
#include "rbvh/frame.h"
#include "rbvh/io.h"
#include "rbvh/layers.h"
#include "rbvh/mesh.h"

namespace rbvh_python {
namespace {

using LevelWords = std::variant<std::monostate, std::string, std::vector<std::string>,
                                std::map<std::string, std::optional<double>>>;

std::vector<rbvh::LevelConfig> levels_of(const LevelWords& words, std::optional<double> error) {
  if (error && words.index() != 0)
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "", "levels and error: one of them is wanted");
  if (error) return {rbvh::level_of_error(*error)};
  std::vector<rbvh::WantedLevel> wanted;
  if (const auto* name = std::get_if<std::string>(&words)) wanted = {{*name, {}}};
  if (const auto* names = std::get_if<std::vector<std::string>>(&words))
    for (const std::string& name : *names) wanted.push_back({name, {}});
  if (const auto* errors = std::get_if<std::map<std::string, std::optional<double>>>(&words))
    for (const auto& [name, of_level] : *errors) wanted.push_back({name, of_level});
  return rbvh::wanted_levels(wanted);
}

std::shared_ptr<PyAsset> build(PyScan& scan, const LevelWords& levels, std::optional<double> error) {
  rbvh::BuildConfig config;
  config.levels = levels_of(levels, error);
  const py::gil_scoped_release released;
  rbvh::Asset pair = rbvh::build_pair(device(), scan.scan(), config, check_signals());
  pair.name = scan.asset.name;
  return std::make_shared<PyAsset>(std::move(pair));
}

py::object open(const std::string& path, const std::optional<std::vector<std::string>>& levels) {
  rbvh::LoadConfig config;
  config.levels = levels;
  rbvh::Asset asset;
  {
    const py::gil_scoped_release released;
    asset = rbvh::load_asset(path, config, check_signals());
  }
  if (asset.scan()) return py::cast(std::make_shared<PyScan>(std::move(asset)));
  return py::cast(std::make_shared<PyAsset>(std::move(asset)));
}

void save(PyAsset& self, const std::string& path, bool overwrite) {
  const py::gil_scoped_release released;
  const std::scoped_lock lock(self.mutex);
  rbvh::save_pair(path, self.asset, overwrite);
}

std::shared_ptr<PyScan> mesh(PyAsset& self, const std::string& level) {
  const py::gil_scoped_release released;
  const std::scoped_lock lock(self.mutex);
  return std::make_shared<PyScan>(rbvh::make_asset(rbvh::level_mesh(self.asset, level), self.asset.name));
}

py::array_t<double> bounds(const PyAsset& self) {
  const rbvh::Bounds3d box = rbvh::file_bounds(self.asset);
  py::array_t<double> corners({2, 3});
  for (int axis = 0; axis < 3; ++axis) {
    corners.mutable_at(0, axis) = box.lo[axis];
    corners.mutable_at(1, axis) = box.hi[axis];
  }
  return corners;
}

const char* kind(const PyAsset& self) {
  return self.asset.rbvh() ? "rbvh" : self.asset.scene() ? "scene" : self.asset.is_cloud ? "cloud" : "mesh";
}

std::string info_text(const std::string& path) {
  const py::gil_scoped_release released;
  return rbvh::describe_json(path);
}

py::object info_of_file(const std::string& path) {
  return py::module_::import("json").attr("loads")(info_text(path));
}

py::object info(const PyAsset& self) {
  if (!self.asset.path.empty() && self.asset.path != "-") return info_of_file(self.asset.path);
  using namespace py::literals;
  return py::dict("kind"_a = kind(self), "bounds"_a = bounds(self).attr("tolist")(),
                  "shift"_a = vector_array(rbvh::shift(self.asset)).attr("tolist")(),
                  "levels"_a = rbvh::level_names(self.asset));
}

}  // namespace

void add_pair(py::module_& module, AssetClass& asset) {
  module.def("build", &build, py::arg("scan"), py::kw_only(), py::arg("levels") = std::monostate{},
             py::arg("error") = std::nullopt,
             R"(Builds a pair in memory: an Asset to cast rays at, and to save.

levels: names such as ["Q0", "Q2"], or {name: error}, an error as a part of the scan's diagonal (None: the
level's own); by default all five. error: builds one level of that error instead.)");
  module.def("open", &open, py::arg("path"), py::kw_only(), py::arg("levels") = std::nullopt,
             R"(Opens a pair (.rbvh), a scan of any format, a proxy, or a scene (.json), to cast rays at.

levels: those to read of a pair; by default all. A scan comes as a Scan.)");
  module.def("info", &info_of_file, py::arg("path"), "What a file holds: the dict of `rbvh info --json`.");
  asset.def("save", &save, py::arg("path"), py::kw_only(), py::arg("overwrite") = false,
            "Writes a pair: NAME.rbvh, and NAME.atlas.tif beside it.");
  asset.def(
      "mesh", &mesh, py::arg("level") = "",
      "A level of a pair (the finest by default) as a Scan: triangles with shared vertices, or points.");
  asset.def("info", &info, "What the asset holds: of a file the dict of `rbvh info --json`.");
  asset.def_property_readonly(
      "path", [](const PyAsset& self) { return self.asset.path; }, "of the file; '' where there is none");
  asset.def_property_readonly("kind", &kind, "'rbvh' (a pair), 'mesh', 'cloud', or 'scene' (proxies, too)");
  asset.def_property_readonly("bounds", &bounds,
                              "(2, 3) float64: lowest and highest, in the file's own coordinates");
  asset.def_property_readonly(
      "shift", [](const PyAsset& self) { return vector_array(rbvh::shift(self.asset)); },
      "(3,) float64: what the library subtracts from large coordinates; all arrays here have it added again");
  asset.def_property_readonly(
      "levels", [](const PyAsset& self) { return rbvh::level_names(self.asset); },
      "the names of a pair's levels, finest first");
  asset.def_property_readonly(
      "layers",
      [](const PyAsset& self) {
        return self.asset.rbvh() ? rbvh::layer_names(self.asset) : std::vector<std::string>{};
      },
      "the names of a pair's own layers, at its finest level");
}

}  // namespace rbvh_python
