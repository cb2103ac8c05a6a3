// Where a mesh without normals is shaded as two sides that meet.
#include "pipeline/scan/creases.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "pipeline/rbvh/build.h"
#include "pipeline/scan/vertex_normals.h"
#include "pipeline/trace/surface.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

Scan cube() {
  Scan scan;
  for (int i = 0; i < 8; ++i)
    scan.positions.push_back(
        {static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1), static_cast<float>(i >> 2)});
  for (const std::array<std::uint32_t, 4>& q : {std::array<std::uint32_t, 4>{0, 2, 3, 1},
                                                {4, 5, 7, 6},
                                                {0, 1, 5, 4},
                                                {2, 6, 7, 3},
                                                {0, 4, 6, 2},
                                                {1, 3, 7, 5}}) {
    scan.triangles.push_back({q[0], q[1], q[2]});
    scan.triangles.push_back({q[0], q[2], q[3]});
  }
  return scan;
}

Vec3f face_normal(const Scan& scan, const Triangle& t) {
  const Vec3f a = scan.positions[t[0]];
  return normalized(cross(scan.positions[t[1]] - a, scan.positions[t[2]] - a));
}

/// Triangles around a vertex; the others lie on a ring of radius 1, at these heights by their angle.
template <class Height>
Scan fan(std::uint32_t count, Height height) {
  Scan scan;
  scan.positions.push_back({0, 0, 0});
  for (std::uint32_t i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    scan.positions.push_back({static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)),
                              static_cast<float>(height(angle))});
    scan.triangles.push_back({0, 1 + i, 1 + (i + 1) % count});
  }
  return scan;
}

TEST(Creases, ACubeHasThreeSidesAtEachCorner) {
  const Scan scan = cube();
  const CreasedMesh creased = split_creases(scan);
  EXPECT_EQ(creased.copies.size(), 2 * scan.positions.size());
  const std::vector<Vec3f> normals = vertex_normals(scan, creased);
  for (std::size_t i = 0; i < scan.triangles.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t corner = creased.triangles[i][c];
      const std::uint32_t vertex = corner < 8 ? corner : creased.copies[corner - 8];
      EXPECT_EQ(vertex, scan.triangles[i][c]);
      EXPECT_GT(dot(normals[corner], face_normal(scan, scan.triangles[i])), 0.9999f);
    }
}

TEST(Creases, WhatIsSmoothStaysAsItIs) {
  const Scan scan = bumpy_sphere(60);
  const CreasedMesh creased = split_creases(scan);
  EXPECT_TRUE(creased.copies.empty());
  EXPECT_EQ(creased.triangles, scan.triangles);
  EXPECT_EQ(vertex_normals(scan, creased), vertex_normals(scan));
}

TEST(Creases, ACreaseThatEndsAtAVertexPartsNothingThere) {
  const Scan once = fan(32, [](double a) { return 1.2 * std::abs(std::sin(a / 2)); });
  const Scan through = fan(32, [](double a) { return 1.2 * std::abs(std::sin(a)); });
  EXPECT_LT(dot(face_normal(once, once.triangles.front()), face_normal(once, once.triangles.back())),
            kCreaseCosine);
  EXPECT_EQ(split_creases(once).triangles[0][0], split_creases(once).triangles[31][0]);
  EXPECT_NE(split_creases(through).triangles[0][0], split_creases(through).triangles[31][0]);
}

TEST(Creases, FacesWithoutAnAreaPartNothing) {
  Scan scan = fan(32, [](double) { return 0.0; });
  scan.positions[5] = scan.positions[6];
  EXPECT_TRUE(split_creases(scan).copies.empty());
}

TEST(Creases, AVertexOfManyFacesTakesNoLongTime) {
  const Scan scan = fan(20'000, [](double a) { return std::abs(std::sin(a)); });
  EXPECT_GT(split_creases(scan).copies.size(), 0u);
}

TEST(Creases, ScansAndTheirLevelsAreShadedFlatBesideThem) {
  const Scan scan = cube();
  const ShadingNormals normals = shading_normals(scan);
  std::vector<Hit> hits(12);
  for (std::uint32_t i = 0; i < hits.size(); ++i) hits[i] = {1, {}, 0.2f, 0.3f, i, 0};
  const SurfaceSamples samples = sample_surface(scan, normals, TextureSampler(scan), hits, 0);
  for (std::uint32_t i = 0; i < hits.size(); ++i)
    EXPECT_GT(dot(samples.normals[i], face_normal(scan, scan.triangles[i])), 0.9999f) << i;

  for (const Level& level : build_rbvh(Device::open(), scan, {}).levels) {
    EXPECT_EQ(level.primitives.triangles.size(), 12u);
    for (const Triangle& t : level.primitives.triangles)
      for (const std::uint32_t corner : t)
        EXPECT_GT(dot(level.primitives.normals[corner], face_normal(level.primitives, t)), 0.999f);
  }
}

}  // namespace
}  // namespace rbvh
