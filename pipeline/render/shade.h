// From hits to pictures: the shaded view and the other AOVs.
#pragma once

#include <span>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/trace/surface.h"
#include "rbvh/image.h"
#include "rbvh/render.h"

namespace rbvh {

/// Rows of a picture.
struct Band {
  std::size_t first = 0, rows = 0;
};

/// A picture is shaded in bands, whose samples stay in the cache and take little memory; in one where the
/// tracer is on demand.
std::vector<Band> bands(const Tracer& tracer, std::size_t width, std::size_t height);

/// A headlight and a soft sky on clay (or the surface's own colours), from both sides, on a transparent
/// background; valleys and depth steps are darkened by the depth of the pixels around. R, G, B, A; `up` is
/// where the sky is. Adds to a band of the rays' picture, `weight` times; with `by_key` the key light's part
/// to that (R, G, B), and neither is cut off at 1. `hits` are the whole picture's, `surface` is the band's.
void add_shaded(const CameraRays& rays, std::span<const Hit> hits, Band band, const SurfaceSamples& surface,
                Vec3f up, float weight, Image& picture, Image* by_key = nullptr);

/// Where it comes from: the camera's upper left.
Vec3f to_key_light(const CameraRays& rays);

/// The picture of one ray a pixel.
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

}  // namespace rbvh
