#include "io/gltf_draco.h"

#ifdef RBVH_DRACO
#include <draco/compression/decode.h>
#endif

namespace rbvh {

#ifdef RBVH_DRACO
DracoMesh decode_draco(std::string_view bytes, const std::map<std::string, std::uint32_t>& ids) {
  DracoMesh result;
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  const auto geometry = draco::Decoder::GetEncodedGeometryType(&buffer);
  if (!geometry.ok() || geometry.value() != draco::TRIANGULAR_MESH) return result;
  auto decoded = draco::Decoder().DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) return result;
  const draco::Mesh& mesh = *decoded.value();
  for (const auto& [name, id] : ids) {
    const draco::PointAttribute* from = mesh.GetAttributeByUniqueId(id);
    if (from == nullptr || from->num_components() < 1 || from->num_components() > 4) return {};
    GltfValues& to = result.attributes[name];
    to.rows = mesh.num_points();
    to.columns = static_cast<std::size_t>(from->num_components());
    to.values.resize(to.rows * to.columns);
    for (std::uint32_t i = 0; i < to.rows; ++i)
      if (!from->ConvertValue<float>(from->mapped_index(draco::PointIndex(i)),
                                     static_cast<std::int8_t>(from->num_components()),
                                     &to.values[i * to.columns]))
        return {};
  }
  for (std::uint32_t i = 0; i < mesh.num_faces(); ++i)
    for (const draco::PointIndex& corner : mesh.face(draco::FaceIndex(i)))
      result.indices.push_back(corner.value());
  return result;
}
#else
DracoMesh decode_draco(std::string_view, const std::map<std::string, std::uint32_t>&) { return {}; }
#endif

}  // namespace rbvh
