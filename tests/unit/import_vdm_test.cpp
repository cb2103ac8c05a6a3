// Maps of other programs on a sphere, whose frames are known everywhere.
#include "pipeline/proxy/import_vdm.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/patch_point.h"

namespace rbvh {
namespace {

// A band of a unit sphere about z in 32 x 8 quads: u goes east, v north. With `flipped`, u goes west, as
// where an artist has mirrored half of an object.
PolygonMesh band(bool flipped) {
  PolygonMesh mesh;
  constexpr std::uint32_t kAround = 32, kHigh = 8;
  for (std::uint32_t j = 0; j <= kHigh; ++j)
    for (std::uint32_t i = 0; i <= kAround; ++i) {
      const double u = static_cast<double>(i) / kAround, v = static_cast<double>(j) / kHigh;
      const double east = 2 * M_PI * (i % kAround) / kAround, north = v - 0.5;
      mesh.positions.push_back(
          {std::cos(north) * std::cos(east), std::cos(north) * std::sin(east), std::sin(north)});
      mesh.uvs.push_back({flipped ? 1 - u : u, v});
    }
  for (std::uint32_t j = 0; j < kHigh; ++j)
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const std::uint32_t a = j * (kAround + 1) + i;
      for (const std::uint32_t corner : {a, a + 1, a + kAround + 2, a + kAround + 1})
        mesh.corners.push_back({corner, corner, PolygonCorner::kNone});
      mesh.face_ends.push_back(static_cast<std::uint32_t>(mesh.corners.size()));
    }
  return mesh;
}

VdmMap constant_map(std::vector<float> texel) {
  VdmMap map;
  map.width = map.height = 16;
  map.channels = static_cast<std::uint32_t>(texel.size());
  for (int i = 0; i < 256; ++i) map.values.insert(map.values.end(), texel.begin(), texel.end());
  return map;
}

// Every texel is displaced by `out` along the radius, `east` and `north`.
void expect_displaced(const VdmMap& map, const ImportConfig& config, bool flipped, Vec3d expected) {
  ImportReport counts;
  const Proxy proxy = import_vdm(band(flipped), map, config, "band", counts);
  EXPECT_EQ(find_fault(proxy), std::nullopt);
  EXPECT_EQ(counts.patches, 256u);
  EXPECT_EQ(proxy.positions.size(), 32u * 9);  // the vertices at the map's seam are one
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch)
    for (std::uint32_t j = 0; j < proxy.tiles[patch].side; ++j)
      for (std::uint32_t i = 0; i < proxy.tiles[patch].side; ++i) {
        const Vec3d p(base_point(proxy, proxy.quads[patch], proxy.tiles[patch].side, i, j));
        const Vec3d out = normalized(p), east = normalized(Vec3d{-p.y, p.x, 0}), north = cross(out, east);
        const Vec3d v = Vec3d(surface_point(proxy, patch, i, j)) - p;
        // Normals at the band's boundaries lean by half a quad.
        EXPECT_NEAR(dot(v, out), expected.x, 0.02);
        EXPECT_NEAR(dot(v, east), expected.y, 0.02);
        EXPECT_NEAR(dot(v, north), expected.z, 0.02);
      }
}

TEST(ImportVdm, TangentSpaceFollowsTheSurface) {
  ImportConfig config;
  config.convention = vdm_preset("blender", VdmSpace::kTangent);
  const VdmMap map = constant_map({0.1f, 0.2f, -0.15f});
  expect_displaced(map, config, false, {0.2, 0.1, -0.15});
  expect_displaced(map, config, true, {0.2, -0.1, -0.15});  // west is where u grows, and north stays
  config.convention.order = parse_vdm_order("tn-b");
  expect_displaced(map, config, false, {0.2, 0.1, 0.15});
}

TEST(ImportVdm, HeightsGoAlongTheNormal) {
  ImportConfig config;
  config.convention.midlevel = 0.5;
  config.convention.scale = 0.4;
  expect_displaced(constant_map({1}), config, false, {0.2, 0, 0});
  expect_displaced(constant_map({0}), config, true, {-0.2, 0, 0});
}

TEST(ImportVdm, BoundsAreKept) {
  ImportReport counts;
  ImportConfig config;
  config.max_texels = 1000;
  EXPECT_THROW(static_cast<void>(import_vdm(band(false), constant_map({0, 0, 0}), config, "band", counts)),
               Error);
  PolygonMesh mesh = band(false);
  mesh.positions[3].x = std::nan("");
  EXPECT_THROW(static_cast<void>(import_vdm(mesh, constant_map({0, 0, 0}), {}, "band", counts)), Error);
  mesh = band(false);
  mesh.uvs[3].u = INFINITY;
  EXPECT_THROW(static_cast<void>(import_vdm(mesh, constant_map({0, 0, 0}), {}, "band", counts)), Error);
}

// Survey coordinates would lose their digits as floats.
TEST(ImportVdm, LargeCoordinatesShift) {
  PolygonMesh mesh = band(false);
  for (Vec3d& p : mesh.positions) p = p + Vec3d{5e6, 0, 0};
  ImportReport counts;
  const Proxy proxy = import_vdm(mesh, constant_map({0, 0, 0}), {}, "band", counts);
  EXPECT_EQ(counts.shift.x, 5e6);
  EXPECT_NEAR(proxy.positions[0].x, mesh.positions[0].x - 5e6, 1e-6);
}

}  // namespace
}  // namespace rbvh
