// The search for a decimated mesh of a given error, and what such a mesh takes on disk.
#include "tests/bench/twin.h"

#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tests/shapes.h"

namespace rbvh::bench {
namespace {

/// Falls as a smooth surface's error does.
double inverse_error(const Scan& mesh) { return 1 / static_cast<double>(mesh.triangles.size()); }

TEST(Decimate, LeavesAboutThatManyTrianglesAndNoOtherVertices) {
  const Scan scan = bumpy_sphere(64);
  const Scan mesh = decimate(scan, 1000);
  EXPECT_LE(mesh.triangles.size(), 1000u);
  EXPECT_GT(mesh.triangles.size(), 900u);
  std::set<std::uint32_t> used;
  for (const Triangle& triangle : mesh.triangles) used.insert(triangle.begin(), triangle.end());
  EXPECT_EQ(used.size(), mesh.positions.size());
  EXPECT_EQ(*used.rbegin() + 1, mesh.positions.size());
  for (const Vec3f& position : mesh.positions)
    EXPECT_NE(std::find(scan.positions.begin(), scan.positions.end(), position), scan.positions.end());
}

TEST(FindTwin, HasTheErrorWithAndWithoutEarlierTrials) {
  const Scan scan = bumpy_sphere(64);  // 8192 triangles
  std::vector<TwinTrial> known;
  for (const double triangles : {4000, 300, 1000}) {
    std::vector<TwinTrial> none;
    const Twin alone = find_twin(scan, 1 / triangles, inverse_error, none);
    const Twin after = find_twin(scan, 1 / triangles, inverse_error, known);
    for (const Twin* twin : {&alone, &after}) {
      EXPECT_NEAR(twin->error * triangles, 1, kTwinTolerance) << triangles;
      EXPECT_EQ(twin->error, inverse_error(twin->mesh));
    }
    EXPECT_EQ(none.size(), static_cast<std::size_t>(alone.trials));
    EXPECT_LE(after.trials, alone.trials);
    EXPECT_LE(alone.trials, 6);
  }
}

TEST(FindTwin, OfNoErrorIsTheWholeMesh) {
  const Scan scan = bumpy_sphere(16);
  std::vector<TwinTrial> known;
  EXPECT_EQ(find_twin(scan, 0, inverse_error, known).mesh.triangles.size(), scan.triangles.size());
}

TEST(FindTwin, TakesTheNearestWhereErrorsJump) {
  const Scan scan = bumpy_sphere(64);
  const auto jumping = [](const Scan& mesh) { return mesh.triangles.size() < 2000 ? 1.0 : 0.01; };
  std::vector<TwinTrial> known;
  const Twin twin = find_twin(scan, 0.02, jumping, known);
  EXPECT_EQ(twin.error, 0.01);
  EXPECT_NEAR(static_cast<double>(twin.mesh.triangles.size()), 2000, 20);
}

TEST(StoredBytes, AreThoseOfTheEncodedIndicesAndSixPerVertex) {
  const Scan mesh = decimate(bumpy_sphere(64), 4000);
  const MeshBytes bytes = stored_bytes(mesh);
  const std::size_t corners = mesh.triangles.size() * 3;
  std::vector<unsigned char> indices(meshopt_encodeIndexBufferBound(corners, mesh.positions.size()));
  const std::size_t encoded =
      meshopt_encodeIndexBuffer(indices.data(), indices.size(), mesh.triangles.front().data(), corners);
  EXPECT_EQ(bytes.plain, mesh.positions.size() * 6 + encoded);
  EXPECT_LT(encoded, mesh.triangles.size() * 2);  // the codec's own promise, given a good order
  EXPECT_LE(bytes.zstd, bytes.plain);
  EXPECT_LE(bytes.best, bytes.zstd);
}

TEST(StoredBytes, ShrinkByTheVertexCodecWhereVerticesAreDense) {
  const MeshBytes bytes = stored_bytes(decimate(bumpy_sphere(256), 1'000'000));
  EXPECT_LT(bytes.zstd, bytes.plain);
  EXPECT_LT(bytes.best, bytes.zstd);
}

}  // namespace
}  // namespace rbvh::bench
