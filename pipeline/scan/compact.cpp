#include "pipeline/scan/compact.h"

#include "pipeline/base/error.h"

namespace rbvh {

std::size_t keep_vertices(Scan& scan, std::span<const std::uint8_t> keep) {
  RBVH_CHECK(keep.size() == scan.positions.size());
  std::size_t lost = 0;
  if (!scan.is_cloud()) {
    std::vector<std::uint32_t> moved(keep.size());
    std::uint32_t next = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      moved[i] = next;
      next += keep[i] != 0;
    }
    std::vector<std::uint8_t> whole(scan.triangles.size());
    for (std::size_t i = 0; i < whole.size(); ++i) {
      Triangle& t = scan.triangles[i];
      whole[i] = keep[t[0]] && keep[t[1]] && keep[t[2]];
      lost += !whole[i];
      t = {moved[t[0]], moved[t[1]], moved[t[2]]};
    }
    if (lost > 0) keep_triangles(scan, whole);
  } else {
    keep_entries(scan.object_ids, keep);
  }
  keep_vertex_entries(scan, keep);
  return lost;
}

void keep_triangles(Scan& scan, std::span<const std::uint8_t> keep) {
  RBVH_CHECK(keep.size() == scan.triangles.size());
  keep_entries(scan.triangles, keep);
  keep_entries(scan.object_ids, keep);
  keep_entries(scan.face_textures, keep);
}

}  // namespace rbvh
