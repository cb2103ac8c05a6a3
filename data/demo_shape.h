// The demo's sculpture: a knotted, pleated ribbon with carved glyphs, cradling a lipped cup on a stepped
// plinth. It is defined as a distance function, so a simulated scanner can measure it from anywhere.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "pipeline/base/vec.h"

namespace rbvh::demo {

/// What the sculpture is like at a point: the colour is meant for points on the surface.
struct ShapeSample {
  float distance = 0;  ///< signed, negative inside; close to Euclidean near the surface, never much above it
  Vec3f color{};       ///< sRGB, 0..1
};

/// About 3 units high, +Y up, facing +Z.
class DemoShape {
 public:
  DemoShape();

  ShapeSample sample(Vec3f p) const;
  float distance(Vec3f p) const { return sample(p).distance; }
  /// Differences over `step`, at the corners of a tetrahedron.
  Vec3f normal(Vec3f p, float step) const;
  const Bounds3f& bounds() const { return bounds_; }

 private:
  struct CurvePoint {
    Vec3f position, tangent, across,
        out;  ///< tangent is the derivative by the sample number, the others unit
    float tangent_squared;
  };
  struct Part {
    float distance, carved;  ///< carved: 0 at the face, 1 at the bottom of a groove
    float along;             ///< 0..1, where colours run along the part
  };
  Part ribbon(Vec3f p) const;
  Part ribbon_near(Vec3f p, int start) const;
  static Part plinth(Vec3f p);
  static Part cup(Vec3f p);

  static constexpr int kCurveSamples = 4096;
  static constexpr int kCells = 24;  ///< a side, of the grid of starting points
  std::vector<CurvePoint> curve_;
  struct Strand {
    float distance;  ///< of the curve from the cell's centre
    int sample;      ///< -1: no more
  };
  Vec3f cell_center(std::size_t x, std::size_t y, std::size_t z) const;
  std::vector<std::array<Strand, 4>> strands_;  ///< per cell, nearest first
  Bounds3f bounds_;
};

}  // namespace rbvh::demo
