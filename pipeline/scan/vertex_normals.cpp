#include "pipeline/scan/vertex_normals.h"

namespace rbvh {

std::vector<Vec3f> vertex_normals(const Scan& scan) {
  return vertex_normals(scan, scan.triangles, scan.positions.size());
}

std::vector<Vec3f> vertex_normals(const Scan& scan, std::span<const Triangle> corners, std::size_t count) {
  std::vector<Vec3f> normals(count);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Triangle& t = scan.triangles[i];
    const Vec3f a = scan.positions[t[0]];
    const Vec3f n = cross(scan.positions[t[1]] - a, scan.positions[t[2]] - a);
    for (const std::uint32_t corner : corners[i]) normals[corner] = normals[corner] + n;
  }
  for (Vec3f& n : normals) n = normalized(n);
  return normals;
}

}  // namespace rbvh
