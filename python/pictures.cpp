// Pictures as arrays.
#include <pybind11/stl.h>

#include <array>

#include "python/arrays.h"
#include "python/asset.h"
#include "rbvh/camera.h"
#include "rbvh/error.h"
#include "rbvh/frame.h"
#include "rbvh/image_bytes.h"
#include "rbvh/io.h"
#include "rbvh/light.h"
#include "rbvh/render.h"

namespace rbvh_python {
namespace {

using Triple = std::optional<std::array<double, 3>>;

struct Picture {
  rbvh::CameraWords words;
  rbvh::Vec3d up;
  rbvh::RenderConfig config;
  std::string level, light;
  bool ground = false, denoise = false;
};

std::optional<rbvh::Vec3d> vector_of(const Triple& triple, const rbvh::Vec3d& less = {}) {
  if (!triple) return std::nullopt;
  return rbvh::Vec3d{(*triple)[0], (*triple)[1], (*triple)[2]} - less;
}

rbvh::Image draw(PyAsset& self, const Picture& wanted) {
  const rbvh::Asset& asset = self.asset;
  const rbvh::Tracer& tracer = self.tracer(wanted.level);
  const rbvh::RenderConfig& shown = wanted.config;
  const rbvh::Bounds3d box = rbvh::to_double(asset.bounds);
  const rbvh::Camera camera =
      rbvh::place_camera(wanted.words, box, wanted.up, static_cast<double>(shown.width) / shown.height);
  const bool is_lit = rbvh::is_of_light(shown.aov) || !wanted.light.empty();
  if (!is_lit) return rbvh::render(tracer, camera, shown);
  rbvh::PathConfig paths;
  paths.width = shown.width;
  paths.height = shown.height;
  if (shown.samples > 0) paths.samples = shown.samples;
  paths.denoise = wanted.denoise;
  if (wanted.ground) paths.ground = rbvh::ground_below(asset, shown.up);
  const std::string level =
      wanted.level.empty() && asset.rbvh() ? rbvh::level_names(asset).front() : wanted.level;
  paths.offset = rbvh::path_offset(asset, level, level);
  if (shown.aov == rbvh::Aov::kOcclusion)
    return rbvh::trace_ambient_occlusion(tracer, tracer, camera, 0, paths, check_signals());
  const std::string light = wanted.light.empty() ? "studio" : wanted.light;
  rbvh::PathPicture picture =
      rbvh::trace_paths(tracer, tracer, camera, rbvh::make_environment({.light = light}, camera, shown.up),
                        paths, check_signals());
  if (shown.aov == rbvh::Aov::kShaded) rbvh::apply_filmic_curve(picture.color);
  return std::move(rbvh::image_of(picture, shown.aov));
}

py::object array_of(const rbvh::Image& image, rbvh::Aov aov, const rbvh::Vec3d& shift) {
  const auto height = static_cast<py::ssize_t>(image.height), width = static_cast<py::ssize_t>(image.width);
  const auto channels = static_cast<py::ssize_t>(image.channels.size());
  if (aov == rbvh::Aov::kShaded) {
    const std::vector<std::uint8_t> bytes = rbvh::image_bytes(image, 4);
    py::array_t<std::uint8_t> array({height, width, py::ssize_t{4}});
    std::copy(bytes.begin(), bytes.end(), array.mutable_data());
    return array;
  }
  py::array_t<float> array(channels == 1 ? std::vector{height, width} : std::vector{height, width, channels});
  std::copy(image.pixels.begin(), image.pixels.end(), array.mutable_data());
  if (aov == rbvh::Aov::kPosition && shift != rbvh::Vec3d{}) return array + vector_array(shift);
  return array;
}

/// What the picture asked for would ignore.
void check_use(rbvh::Aov aov, const std::string& light, int samples, bool ground, bool denoise) {
  const bool is_lit = rbvh::is_of_light(aov) || !light.empty();
  const auto refuse = [](const char* word, const char* why) {
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "", std::string(word) + ": is for " + why);
  };
  if (!light.empty() && aov != rbvh::Aov::kShaded && !rbvh::is_of_light(aov)) refuse("light", "lit pictures");
  if (samples > 0 && aov != rbvh::Aov::kShaded && !is_lit) refuse("samples", "shaded and lit pictures");
  if (ground && !is_lit) refuse("ground", "lit pictures; give light");
  if (denoise && !is_lit) refuse("denoise", "lit pictures; give light");
}

py::object render(PyAsset& self, std::array<std::uint32_t, 2> resolution, const std::string& aov,
                  const std::string& level, const Triple& position, const Triple& focal_point,
                  const Triple& view_up, std::optional<double> view_angle, std::optional<double> azimuth,
                  std::optional<double> elevation, const Triple& up, int samples, const std::string& light,
                  bool ground, bool denoise) {
  const auto found = rbvh::find_aov(aov);
  if (!found) throw rbvh::Error(rbvh::ErrorKind::kUsage, "", "aov: '" + aov + "' is none");
  if (!light.empty() && !rbvh::is_light_name(light))
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "",
                      "light: '" + light + "' is none of studio, headlight, sky, sun, white");
  constexpr std::uint32_t kLargest = 65536;
  if (resolution[0] < 1 || resolution[1] < 1 || resolution[0] > kLargest || resolution[1] > kLargest ||
      samples < 0)
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "", "resolution: width and height from 1 to 65536 are wanted");
  check_use(*found, light, samples, ground, denoise);
  const rbvh::Vec3d shift = rbvh::shift(self.asset);
  Picture wanted;
  wanted.words = {vector_of(position, shift),
                  vector_of(focal_point, shift),
                  vector_of(view_up),
                  view_angle,
                  azimuth,
                  elevation};
  wanted.up = vector_of(up).value_or(self.asset.up_axis());
  wanted.config.width = resolution[0];
  wanted.config.height = resolution[1];
  wanted.config.aov = *found;
  wanted.config.samples = samples;
  wanted.config.up = static_cast<rbvh::Vec3f>(wanted.up);
  wanted.level = level;
  wanted.light = light;
  wanted.ground = ground;
  wanted.denoise = denoise;
  rbvh::Image image;
  {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(self.mutex);
    image = draw(self, wanted);
  }
  return array_of(image, *found, shift);
}

/// Bytes are taken as they are to be shown, other numbers as data.
rbvh::Image image_of(const py::object& pixels) {
  const py::array any = py::array::ensure(pixels);
  const bool fits = any && (any.ndim() == 2 || any.ndim() == 3) && any.size() > 0 &&
                    (any.ndim() == 2 || any.shape(2) == 1 || any.shape(2) == 3 || any.shape(2) == 4);
  if (!fits)
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "",
                      "pixels: an array of shape (H, W) or (H, W, 1, 3 or 4) is wanted");
  const bool is_bytes = any.dtype().kind() == 'u' && any.itemsize() == 1;
  const std::size_t channels = any.ndim() == 2 ? 1 : static_cast<std::size_t>(any.shape(2));
  static const std::vector<std::string> kNames[] = {{}, {"Y"}, {}, {"R", "G", "B"}, {"R", "G", "B", "A"}};
  rbvh::Image image = rbvh::make_image(is_bytes ? rbvh::Image::Kind::kShown : rbvh::Image::Kind::kData,
                                       static_cast<std::uint32_t>(any.shape(1)),
                                       static_cast<std::uint32_t>(any.shape(0)), kNames[channels]);
  const auto values = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(any);
  std::copy_n(values.data(), image.pixels.size(), image.pixels.begin());
  for (std::size_t i = 0; is_bytes && i < image.pixels.size(); i += channels) {
    const float alpha = channels == 4 ? image.pixels[i + 3] / 255 : 1;  // straight, and wanted premultiplied
    for (std::size_t c = 0; c < channels; ++c) image.pixels[i + c] *= (c < 3 ? alpha : 1) / 255;
  }
  return image;
}

void write_image(const std::string& path, const py::object& pixels, bool overwrite) {
  const rbvh::Image image = image_of(pixels);
  const py::gil_scoped_release released;
  rbvh::write_image(path, image, overwrite);
}

}  // namespace

void add_pictures(py::module_& module, AssetClass& asset) {
  module.def("write_image", &write_image, py::arg("path"), py::arg("pixels"), py::kw_only(),
             py::arg("overwrite") = false,
             R"(Writes a picture by the name's extension: .png or .jpg of uint8, .exr of any numbers.

pixels: (H, W) or (H, W, 1, 3 or 4), row 0 on top; uint8 as it is to be shown.)");
  using py::arg;
  const auto none = py::none();
  asset.def(
      "render", &render, py::kw_only(), arg("resolution") = std::array<std::uint32_t, 2>{1024, 1024},
      arg("aov") = "shaded", arg("level") = "", arg("position") = none, arg("focal_point") = none,
      arg("view_up") = none, arg("view_angle") = none, arg("azimuth") = none, arg("elevation") = none,
      arg("up") = none, arg("samples") = 0, arg("light") = "", arg("ground") = false, arg("denoise") = false,
      R"(A picture, as `rbvh render --quick` makes it; from the three-quarter view where no camera is given.

resolution: (width, height). level: of a pair; the finest by default.
aov: "shaded", "normal", "depth", "position", "leaf", "steps"; of light "ao", "albedo", "shadow", "direct", "indirect".
position, focal_point, view_up (3 numbers each), view_angle, azimuth, elevation (degrees): the camera, in f3d's
words and the file's own coordinates; what is left out is chosen so that all is in view. up: what is up, 3 numbers.
samples: rays a pixel. light: "studio", "headlight", "sky", "sun" or "white" for a path-traced picture, with
ground (a plane below) and denoise; without light they are refused.

Returns (H, W, 4) uint8 (sRGB, straight alpha) for "shaded"; else (H, W) or (H, W, channels) float32, row 0 on
top; "depth" is the distance from the camera in scan units, inf where nothing is hit; "position" is float64 where
coordinates are shifted inside.)");
}

}  // namespace rbvh_python
