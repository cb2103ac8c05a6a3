// Arbitrary bytes as an artist's base mesh, made into a proxy with a small map of heights.
#include <cstdlib>

#include "io/polygon_obj.h"
#include "pipeline/base/error.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/import_vdm.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace rbvh;
  try {
    const PolygonMesh mesh = read_polygon_obj({reinterpret_cast<const char*>(data), size}, "fuzz.obj");
    if (mesh.corners.size() > size || mesh.face_ends.back() != mesh.corners.size()) std::abort();
    for (const PolygonCorner& corner : mesh.corners)
      if (corner.vertex >= mesh.positions.size() ||
          (corner.uv != PolygonCorner::kNone && corner.uv >= mesh.uvs.size()) ||
          (corner.normal != PolygonCorner::kNone && corner.normal >= mesh.normals.size()))
        std::abort();
    if (mesh.corners.size() > 512) return 0;
    VdmMap map{.width = 4, .height = 4, .channels = 1};
    for (int i = 0; i < 16; ++i) map.values.push_back(0.1f * static_cast<float>(i));
    ImportReport counts;
    if (find_fault(import_vdm(mesh, map, {.max_side = 9}, "fuzz.obj", counts))) std::abort();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput && error.kind() != ErrorKind::kBudget) std::abort();
    if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
  }
  return 0;
}
