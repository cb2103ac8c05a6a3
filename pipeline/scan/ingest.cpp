#include "pipeline/scan/ingest.h"

#include <algorithm>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/scan/normals.h"
#include "pipeline/scan/outliers.h"
#include "pipeline/scan/precision.h"
#include "pipeline/scan/radii.h"
#include "pipeline/scan/thin.h"
#include "pipeline/scan/vertex_normals.h"
#include "rbvh/complete_scan.h"

namespace rbvh {
namespace {

/// As measured: while a mesh is cleaned, while a cloud has all its neighbours.
constexpr std::uint64_t kBytesPerVertex = 64, kBytesPerFace = 48, kBytesPerPoint = 600;

/// Makes a mesh's normals unit. Vertices without one, after a merge with a mesh that has them, get that of
/// their faces. Returns how many did.
std::size_t complete_mesh_normals(Scan& scan) {
  if (scan.normals.empty()) return 0;
  const std::vector<Vec3f> smooth = vertex_normals(scan);
  std::size_t completed = 0;
  for (std::size_t i = 0; i < smooth.size(); ++i) {
    Vec3f& normal = scan.normals[i];
    const bool given = is_direction(normal);
    completed += !given;
    if (!given) normal = smooth[i];
    if (std::abs(dot(normal, normal) - 1) > 1e-5f) normal = normalized(normal);
  }
  return completed;
}

void flip(Scan& scan) {
  for (Vec3f& normal : scan.normals) normal = -normal;
  for (std::size_t face = 0; face < scan.triangles.size(); ++face) turn_face(scan, face);
}

std::size_t count_objects(const Scan& scan) {
  std::vector<std::int32_t> ids = scan.object_ids;
  std::sort(ids.begin(), ids.end());
  const auto distinct = std::unique(ids.begin(), ids.end()) - ids.begin();
  return std::max<std::size_t>(1, static_cast<std::size_t>(distinct));
}

}  // namespace

std::uint64_t ingest_memory(const RawScan& scan) {
  const std::uint64_t vertices = scan.positions.size();
  return scan.triangles.empty() ? vertices * kBytesPerPoint
                                : vertices * kBytesPerVertex + scan.triangles.size() * kBytesPerFace +
                                      scan.face_textures.size() * sizeof(FaceTexture);
}

void check_usable(const Scan& scan, const std::string& file) {
  const Bounds3f box = bounds(scan);
  if (box.empty()) throw Error(ErrorKind::kInput, file, "has no point with finite coordinates");
  if (!(box.diagonal() > 0))  // also where it is too small for float
    throw Error(ErrorKind::kInput, file, "all points are equal: there is no surface");
}

void complete_scan(Scan& scan, const Progress& progress) {
  check_usable(scan, "");
  for (std::size_t i = 0; i < scan.triangles.size(); ++i)
    for (const std::uint32_t corner : scan.triangles[i])
      if (corner >= scan.positions.size())
        throw Error(ErrorKind::kInput, "", FilePlace{"triangle", i},
                    "has the corner " + std::to_string(corner) + "; there are " +
                        std::to_string(scan.positions.size()) + " vertices");
  if (scan.is_cloud()) complete_cloud(scan, {}, progress);
}

Scan ingest(RawScan&& raw, const std::string& file, const IngestConfig& config, IngestReport& counts,
            const Progress& progress) {
  counts.vertices_in = raw.positions.size();
  counts.faces_in = raw.triangles.size();
  const bool is_mesh = !raw.triangles.empty();
  if (is_mesh && (config.voxel > 0 || config.viewpoint || config.recompute_normals))
    throw Error(ErrorKind::kUsage, file, "is a mesh: voxels, viewpoints and new normals are for clouds only");

  report(progress, "clean", 0);
  const Vec3d old_shift = raw.shift;
  if (config.remove_far) counts.far = drop_far(raw);
  Scan scan = shift_to_float(std::move(raw));
  check_usable(scan, file);
  counts.cleaned = clean(scan);
  counts.cleaned.non_finite_vertices -= counts.far;
  const auto check_left = [&](const char* because) {
    if (scan.positions.empty() || (is_mesh && scan.triangles.empty()))
      throw Error(ErrorKind::kInput, file, because);
  };
  check_left("no face with an area is left after cleaning");
  if (config.outliers)
    counts.outliers = remove_outliers(scan, config.outliers->neighbors, config.outliers->sigma);
  check_left("no face is left after the removal of outliers");
  if (config.voxel > 0) counts.thinned = thin_cloud(scan, config.voxel);
  report(progress, "clean", 1);

  if (is_mesh) {
    counts.winding = config.orient ? orient_faces(scan) : count_winding(scan);
    counts.mesh_normals_completed = complete_mesh_normals(scan);
  } else {
    if (config.recompute_normals) scan.normals.clear();
    CloudConfig cloud{.neighbors = config.normals_k, .viewpoint = config.viewpoint};
    if (cloud.viewpoint) cloud.viewpoint = *cloud.viewpoint - (scan.shift - old_shift);
    counts.cloud = complete_cloud(scan, cloud, progress);
  }
  if (config.min_component > 0) counts.small_components = remove_small_components(scan, config.min_component);
  check_left("nothing is left after the removal of small components");
  check_usable(scan, file);
  if (config.flip_normals) flip(scan);

  // Vertices of a mesh may have lost all their faces to what was asked for.
  if (is_mesh && (counts.outliers > 0 || counts.small_components.vertices > 0))
    counts.cleaned.unreferenced_vertices += clean(scan).unreferenced_vertices;
  counts.vertices_out = scan.positions.size();
  counts.faces_out = scan.triangles.size();
  counts.objects = count_objects(scan);
  counts.area = surface_area(scan);
  return scan;
}

}  // namespace rbvh
