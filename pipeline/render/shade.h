// From hits to pictures: the shaded view and the other AOVs.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/trace/surface.h"
#include "rbvh/asset.h"
#include "rbvh/image.h"
#include "rbvh/render.h"

namespace rbvh {

/// Colours for values, `width` of them a hit: one from dark blue (lo) to yellow (hi), three as red, green and
/// blue from lo to hi; clay for NaN.
std::vector<Vec3f> value_colors(std::span<const float> values, std::size_t width, float lo, float hi);

/// A headlight and a soft sky on clay (or the surface's own colours), from both sides, on a transparent
/// background; valleys and depth steps are darkened by the depth of the pixels around. R, G, B, A; `up` is
/// where the sky is. Adds to the picture of the rays, `weight` times; with `by_key` the key light's part to
/// that (R, G, B), and neither is cut off at 1.
void add_shaded(const CameraRays& rays, std::span<const Hit> hits, const SurfaceSamples& surface, Vec3f up,
                float weight, Image& picture, Image* by_key = nullptr);

/// Where it comes from: the camera's upper left.
Vec3f to_key_light(const CameraRays& rays);

Image shade(const CameraRays& rays, std::span<const Hit> hits, const SurfaceSamples& surface, Vec3f up);

/// What an AOV other than shaded and steps shows, as numbers for EXR: normal (geometric: N.X N.Y N.Z; 0 for
/// nothing), depth (Z, distance along the ray in scan units), position (P.X P.Y P.Z), leaf (leaf). +infinity,
/// for leaf -1, is nothing.
Image data_image(Aov aov, const CameraRays& rays, std::span<const Hit> hits);
/// One channel `steps`: nodes and texels visited by each pixel's ray.
Image steps_image(const CameraRays& rays, std::span<const std::uint32_t> steps);

/// The same for the eye: normals as colours, leaves in distinct colours, steps from blue (none) to yellow
/// (the 99.9th percentile and more). Throws Error(kUsage) for depth and position, which 8 bits cannot hold.
Image shown_image(Aov aov, const Image& data);

/// The values of a user's layer as colours, for RenderConfig.colors: from the layer's lo to its hi.
std::vector<Vec3f> layer_colors(const Level& level, const Layer& layer, std::span<const Hit> hits);

/// RenderConfig.colors by the layer of that name of the pair's level, which must outlive them. Throws
/// Error(kUsage) where there is none, or it is not a user's.
std::function<std::vector<Vec3f>(std::span<const Hit>)> layer_colors(const Asset& asset,
                                                                     const std::string& level,
                                                                     const std::string& layer);

}  // namespace rbvh
