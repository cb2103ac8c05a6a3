// Patches become one mesh.
#include "pipeline/scan/stitch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "pipeline/scan/vertex_normals.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

/// Sheets of n x n cells over [x0, x1] x [0, 1], each a patch.
struct Sheets {
  Scan mesh;
  Patches patches;

  void add(int n, float x0, float x1, float gap, float turn = 0) {
    add_sheet(mesh, n, [=](float s, float t) { return Vec3f{x0 + s * (x1 - x0) + turn * (t - 0.5f), t, 0}; });
    const auto patch = patches.of_vertex.empty() ? 1 : patches.of_vertex.back() + 1;
    patches.of_vertex.resize(mesh.positions.size(), patch);
    patches.gap.resize(mesh.positions.size(), gap);
    mesh.normals = vertex_normals(mesh);
  }
  double area() const {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
      const Vec3f a = mesh.positions[t[0]];
      sum += 0.5 * static_cast<double>(
                       cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a).z);  // turned over: negative
    }
    return sum;
  }
};

TEST(Stitch, AGapBetweenTwoPatchesIsClosed) {
  Sheets sheets;
  sheets.add(10, 0, 1, 0.1f);
  sheets.add(8, 1.15f, 2.15f, 0.125f, 0.05f);  // coarser, and at an angle
  const StitchCounts counts = stitch(sheets.mesh, sheets.patches);
  // A strip between 10 edges and 8; at its ends it may go on by an edge.
  EXPECT_GE(counts.added_triangles, 18u);
  EXPECT_LE(counts.added_triangles, 22u);
  EXPECT_LE(count_edges(sheets.mesh).open, 10u * 3 + 8u * 3 + 2);
  EXPECT_GE(count_edges(sheets.mesh).open, 10u * 3 + 8u * 3 - 2);
  EXPECT_EQ(count_edges(sheets.mesh).non_manifold, 0u);
  EXPECT_NEAR(sheets.area(), 2.15, 0.02);
}

TEST(Stitch, VerticesThatAreCloseAreOne) {
  Sheets sheets;
  sheets.add(10, 0, 1, 0.1f);
  sheets.add(10, 1.01f, 2.01f, 0.1f);
  const StitchCounts counts = stitch(sheets.mesh, sheets.patches);
  EXPECT_EQ(counts.welded_vertices, 11u);
  EXPECT_EQ(counts.added_triangles, 0u);
  EXPECT_EQ(sheets.mesh.positions.size(), 2u * 121 - 11);
  EXPECT_EQ(sheets.mesh.normals.size(), sheets.mesh.positions.size());
  EXPECT_EQ(count_edges(sheets.mesh).open, 60u);
}

TEST(Stitch, WideGapsAndPatchesThatAreCompleteStayApart) {
  Sheets wide;
  wide.add(10, 0, 1, 0.1f);
  wide.add(10, 1.5f, 2.5f, 0.1f);
  EXPECT_EQ(stitch(wide.mesh, wide.patches).added_triangles, 0u);
  EXPECT_EQ(count_edges(wide.mesh).open, 80u);
  Sheets complete;
  complete.add(10, 0, 1, 0);
  complete.add(10, 1.01f, 2.01f, 0);
  EXPECT_EQ(stitch(complete.mesh, complete.patches).added_triangles, 0u);
  EXPECT_EQ(complete.mesh.positions.size(), 242u);
}

TEST(Stitch, TheTwoSidesOfASheetStayApart) {
  Scan mesh;
  add_plate(mesh, 10, 0.02f);
  add_plate(mesh, 10, 0, false);
  mesh.normals = vertex_normals(mesh);
  Patches patches;
  patches.of_vertex.resize(121, 1);
  patches.of_vertex.resize(242, 2);
  patches.gap.resize(242, 0.1f);
  const StitchCounts counts = stitch(mesh, patches);
  EXPECT_EQ(counts.welded_vertices, 0u);
  EXPECT_EQ(count_edges(mesh).non_manifold, 0u);
}

TEST(Stitch, RepeatedTrianglesGo) {
  Sheets sheets;
  sheets.add(4, 0, 1, 0);
  sheets.mesh.triangles.push_back(sheets.mesh.triangles[5]);
  EXPECT_EQ(count_edges(sheets.mesh).non_manifold, 3u);
  EXPECT_EQ(stitch(sheets.mesh, sheets.patches).dropped_triangles, 1u);
  EXPECT_EQ(sheets.mesh.triangles.size(), 32u);
  EXPECT_EQ(count_edges(sheets.mesh).non_manifold, 0u);
}

}  // namespace
}  // namespace rbvh
