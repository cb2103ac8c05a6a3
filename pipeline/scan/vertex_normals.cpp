#include "pipeline/scan/vertex_normals.h"

namespace rbvh {

std::vector<Vec3f> vertex_normals(const Scan& scan) {
  std::vector<Vec3f> normals(scan.positions.size());
  for (const Triangle& t : scan.triangles) {
    const Vec3f a = scan.positions[t[0]];
    const Vec3f n = cross(scan.positions[t[1]] - a, scan.positions[t[2]] - a);
    for (const std::uint32_t corner : t) normals[corner] = normals[corner] + n;
  }
  for (Vec3f& n : normals) n = normalized(n);
  return normals;
}

}  // namespace rbvh
