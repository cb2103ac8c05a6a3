// A picture of an asset by whatever lights it: the plain shading, paths of light, or light kept in a layer.
#pragma once

#include <string>
#include <vector>

#include "pipeline/render/look.h"
#include "rbvh/asset.h"
#include "rbvh/light.h"

namespace rbvh {

/// What paths of light take of the host's memory for each pixel: sums, pictures, and what denoising adds.
inline constexpr std::uint64_t kPathBytesPerPixel = 300;

/// How a picture is lit. By default it is shaded softly (render_soft()), or an AOV without light.
struct Lighting {
  LightWords words{.light = {}};  ///< of light, empty: pictures are not lit by paths
  PathConfig paths;               ///< but its size, samples, colours, ground and offset
  bool ground = false;            ///< shadows fall on the plane below the asset
  double distance = 0;            ///< that ambient occlusion sees, scan units; 0: all
  std::string cached;             ///< a layer that lights a pair in place of paths
  bool linear = false;            ///< light as it is, without the filmic curve
  bool quick = false;             ///< of what is not lit by paths or a layer: without shadows
};

/// What a picture is of, and what its rays are cast at.
struct PictureSubject {
  const Asset& asset;
  std::string level;            ///< of a pair
  std::string secondary_level;  ///< of shadows and bounces
  const Tracer &primary, &secondary;
};

struct Picture {
  Image image;
  int path_samples = 0;       ///< paths a pixel that it took
  double noise = 0;           ///< as PathPicture's
  bool is_empty = false;      ///< nothing was in view
  std::vector<Text> texts{};  ///< of the look, to be drawn by io/draw_text.h
};

/// Of the AOV that `shown` names, with `shown.up` up; its colours are the look's. Where `shown.as_shown` is
/// set, light goes through the filmic curve, too. Throws Error(kUsage) as render(), baked_layer() and
/// value_colors().
Picture draw_picture(const PictureSubject& subject, const Camera& camera, RenderConfig shown,
                     const Lighting& lighting, const Look& look, RenderTimings& timings,
                     const Progress& progress = {});

}  // namespace rbvh
