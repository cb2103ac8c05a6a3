// The primitives' edges, drawn over a picture.
#pragma once

#include "rbvh/camera.h"
#include "rbvh/image.h"
#include "rbvh/tracer.h"

namespace rbvh {

/// Darkens the picture (R, G, B first) along the edges of triangles, by their barycentric coordinates, and
/// along the borders of tiles, patches and discs. Where these are smaller than pixels, all is darkened.
void draw_edges(const Tracer& tracer, const Camera& camera, Image& picture);

}  // namespace rbvh
