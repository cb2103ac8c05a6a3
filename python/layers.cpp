// Values on a pair's surface.
#include "rbvh/layers.h"

#include <pybind11/stl.h>

#include <cstring>

#include "python/arrays.h"
#include "python/asset.h"
#include "rbvh/error.h"
#include "rbvh/frame.h"

namespace rbvh_python {
namespace {

py::array sample(PyAsset& self, const py::object& points, const std::string& layer, const std::string& level,
                 std::optional<float> reach) {
  const FloatArray from = float_array(points, "points", {3});
  const std::vector<rbvh::Vec3f> at = points_of(from, rbvh::shift(self.asset));
  rbvh::LayerValues values;
  {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(self.mutex);
    values = rbvh::sample_pair(device(), self.asset, layer, at, level, reach);
  }
  auto array = make_array<float>(from.leading(), {static_cast<py::ssize_t>(values.width)});
  std::copy(values.values.begin(), values.values.end(), array.mutable_data());
  return array;
}

std::uint64_t paint(PyAsset& self, const py::object& points, const py::object& values,
                    const std::string& layer, const std::vector<std::string>& levels, float radius,
                    std::optional<double> scale, std::optional<float> reach) {
  const FloatArray from = float_array(points, "points", {3});
  const std::vector<rbvh::Vec3f> at = points_of(from, rbvh::shift(self.asset));
  const auto rows = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(values);
  if (!rows || at.empty() || static_cast<std::size_t>(rows.size()) % at.size() != 0)
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "",
                      "values: an array of 1 to 4 values for each point is wanted");
  const std::span<const float> all(rows.data(), static_cast<std::size_t>(rows.size()));
  const py::gil_scoped_release released;
  const std::scoped_lock lock(self.mutex);
  self.forget_tracers();
  return rbvh::paint_pair(device(), self.asset, at, all, all.size() / at.size(),
                          {layer, levels, radius, scale, reach});
}

std::map<std::string, std::uint64_t> bake(PyAsset& self, const std::string& what, const std::string& name,
                                          const std::string& light, int samples,
                                          const std::vector<std::string>& levels, double scale,
                                          float distance, bool ground) {
  rbvh::BakeLayer layer{.name = name.empty() ? what : name, .scale = scale, .distance = distance};
  if (what == "ao")
    layer.light = rbvh::BakedLight::kOcclusion;
  else if (what == "sky")
    layer.light = rbvh::BakedLight::kSky;
  else if (what == "irradiance")
    layer.light = rbvh::BakedLight::kIrradiance;
  else
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "", "'" + what + "' is none of ao, sky, irradiance");
  if (light != "sky" && light != "sun" && light != "white")
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "", "light: '" + light + "' is none of white, sky, sun");
  if (distance != 0 && what != "ao") throw rbvh::Error(rbvh::ErrorKind::kUsage, "", "distance: is for ao");
  if (samples < 1) throw rbvh::Error(rbvh::ErrorKind::kUsage, "", "samples: at least 1 is wanted");
  const auto up = static_cast<rbvh::Vec3f>(self.asset.up_axis());
  rbvh::PathConfig config;
  config.samples = samples;
  const py::gil_scoped_release released;
  const std::scoped_lock lock(self.mutex);
  self.forget_tracers();
  if (ground) config.ground = rbvh::ground_below(self.asset, up);
  const auto baked =
      rbvh::bake_pair(device(), self.asset, layer, rbvh::make_environment({.light = light}, {}, up), config,
                      levels, check_signals());
  return {baked.begin(), baked.end()};
}

}  // namespace

void add_layers(AssetClass& asset) {
  asset.def("sample", &sample, py::arg("points"), py::arg("layer"), py::kw_only(), py::arg("level") = "",
            py::arg("reach") = std::nullopt,
            R"(Reads a layer of a pair at points on its surface.

points: (..., 3), in the file's own coordinates. layer: one of your own, or "normal", "color" (sRGB in [0, 1]) or
"height" (how far the surface lies above the point). reach: how far from the surface a point may lie, scan units
(1% of the diagonal by default).
Returns (..., width) float32, nan where there is no value.)");
  asset.def("paint", &paint, py::arg("points"), py::arg("values"), py::arg("layer"), py::kw_only(),
            py::arg("levels") = std::vector<std::string>{}, py::arg("radius") = 0.0f,
            py::arg("scale") = std::nullopt, py::arg("reach") = std::nullopt,
            R"(Writes values to a layer of a pair in memory; save() writes the pair.

points: (..., 3), in the file's own coordinates. values: 1 to 4 for each point; nan takes a value away.
layer: "color", or a name of your own, made where it is not there. levels: all by default.
radius: paints what lies within, scan units; of several points the nearest counts; 0: the texels that cover a point.
scale: of a new layer, its texels to one of the heights'. reach: as in sample().
Returns the number of points that lie on no surface.)");
  asset.def("bake", &bake, py::arg("what") = "ao", py::kw_only(), py::arg("layer") = "",
            py::arg("light") = "white", py::arg("samples") = 64,
            py::arg("levels") = std::vector<std::string>{}, py::arg("scale") = 1.0,
            py::arg("distance") = 0.0f, py::arg("ground") = false,
            R"(Keeps light in a layer of a pair in memory, as `rbvh bake` does.

what: "ao" (the part of the sky that is seen; 1 value), "sky" (direct light; 3) or "irradiance" (all; 3).
layer: its name, `what` by default. light: "white", "sky" or "sun". samples: rays or paths a texel.
distance: of "ao", what lies farther is not seen, scan units; 0: all is. ground: a plane below.
Returns {level: number of texels}.)");
}

}  // namespace rbvh_python
