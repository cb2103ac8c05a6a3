#include "pipeline/proxy/split_polygons.h"

#include <algorithm>
#include <map>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

struct Corner {
  std::uint32_t vertex;
  Uv uv;
  Vec3d normal;
};
using Face = std::vector<Corner>;

Uv mean(const Uv& a, const Uv& b) { return {(a.u + b.u) / 2, (a.v + b.v) / 2}; }

void add_quad(UvQuads& to, const std::array<Corner, 4>& corners, bool has_normals) {
  Quad quad{};
  std::array<Uv, 4> uvs;
  std::array<Vec3d, 4> normals;
  for (std::size_t k = 0; k < 4; ++k) {
    quad[k] = corners[k].vertex;
    uvs[k] = corners[k].uv;
    normals[k] = corners[k].normal;
  }
  to.quads.push_back(quad);
  to.uvs.push_back(uvs);
  if (has_normals) to.normals.push_back(normals);
}

// From the face's middle to the middles of its sides: as many quads as it has corners.
class Splitter {
 public:
  Splitter(UvQuads& to, bool has_normals) : to_(to), has_normals_(has_normals) {}

  void split(const Face& face) {
    const double share = 1.0 / static_cast<double>(face.size());
    Corner center{static_cast<std::uint32_t>(to_.positions.size()), {}, {}};
    Vec3d position{};
    std::vector<Corner> middles;
    for (std::size_t k = 0; k < face.size(); ++k) {
      const Corner& a = face[k];
      position = position + to_.positions[a.vertex] * share;
      center.uv = {center.uv.u + a.uv.u * share, center.uv.v + a.uv.v * share};
      center.normal = center.normal + a.normal * share;
    }
    to_.positions.push_back(position);
    for (std::size_t k = 0; k < face.size(); ++k) {
      const Corner &a = face[k], &b = face[(k + 1) % face.size()];
      middles.push_back({middle(a.vertex, b.vertex), mean(a.uv, b.uv), (a.normal + b.normal) * 0.5});
    }
    for (std::size_t k = 0; k < face.size(); ++k)
      add_quad(to_, {face[k], middles[k], center, middles[(k + face.size() - 1) % face.size()]},
               has_normals_);
  }

 private:
  std::uint32_t middle(std::uint32_t a, std::uint32_t b) {
    const auto [found, is_new] =
        middle_of_.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(to_.positions.size()));
    if (is_new) to_.positions.push_back((to_.positions[a] + to_.positions[b]) * 0.5);
    return found->second;
  }

  UvQuads& to_;
  bool has_normals_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle_of_;
};

std::vector<std::uint32_t> weld(const std::vector<Vec3d>& positions, UvQuads& to) {
  std::vector<std::uint32_t> order(positions.size()), number(positions.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto key = [&](std::uint32_t i) {
    return std::array{positions[i].x + 0.0, positions[i].y + 0.0, positions[i].z + 0.0};
  };
  const auto is_less = [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); };
  // Those that are not finite compare with nothing: they stay as they are, and are refused later.
  std::stable_sort(order.begin(),
                   std::stable_partition(order.begin(), order.end(),
                                         [&](std::uint32_t i) { return is_finite(positions[i]); }),
                   is_less);
  std::vector<std::uint32_t> first(positions.size());
  for (std::size_t n = 0; n < order.size(); ++n)
    first[order[n]] =
        n > 0 && positions[order[n]] == positions[order[n - 1]] ? first[order[n - 1]] : order[n];
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    if (first[i] == i) {
      number[i] = static_cast<std::uint32_t>(to.positions.size());
      to.positions.push_back(positions[i]);
    } else {
      number[i] = number[first[i]];  // the first of equals comes first: the sort is stable
    }
  }
  return number;
}

std::size_t different_corners(const Face& face) {
  std::vector<std::uint32_t> vertices;
  for (const Corner& corner : face) vertices.push_back(corner.vertex);
  std::sort(vertices.begin(), vertices.end());
  return static_cast<std::size_t>(std::unique(vertices.begin(), vertices.end()) - vertices.begin());
}

}  // namespace

UvQuads split_polygons(const PolygonMesh& mesh, const std::string& file, std::uint64_t& no_quads,
                       std::uint64_t& dropped) {
  UvQuads quads;
  const std::vector<std::uint32_t> number = weld(mesh.positions, quads);
  const bool has_normals = std::all_of(mesh.corners.begin(), mesh.corners.end(), [](const PolygonCorner& c) {
    return c.normal != PolygonCorner::kNone;
  });
  std::vector<Face> faces;
  no_quads = dropped = 0;
  for (std::size_t f = 0; f < mesh.face_count(); ++f) {
    Face face;
    for (std::uint32_t c = mesh.face_begin(f); c < mesh.face_ends[f]; ++c) {
      const PolygonCorner& corner = mesh.corners[c];
      if (corner.uv == PolygonCorner::kNone)
        throw Error(ErrorKind::kInput, file,
                    "face " + std::to_string(f + 1) +
                        " has no texture coordinates, and a displacement map needs them; unwrap the mesh");
      face.push_back(
          {number[corner.vertex], mesh.uvs[corner.uv], has_normals ? mesh.normals[corner.normal] : Vec3d{}});
    }
    if (different_corners(face) < 3) {
      ++dropped;
      continue;
    }
    no_quads += face.size() != 4;
    faces.push_back(std::move(face));
  }
  if (faces.empty()) throw Error(ErrorKind::kInput, file, "has no face with three different corners");
  Splitter splitter(quads, has_normals);
  for (const Face& face : faces) {
    if (no_quads > 0)
      splitter.split(face);
    else
      add_quad(quads, {face[0], face[1], face[2], face[3]}, has_normals);
  }
  return quads;
}

}  // namespace rbvh
