#include "pipeline/scan/creases.h"

#include <algorithm>
#include <span>
#include <utility>

#include "pipeline/base/parallel_for.h"
#include "pipeline/base/sets.h"
#include "pipeline/scan/vertex_normals.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
constexpr std::uint32_t kNone = 0xffffffffu;
/// Of half the angle of a crease: normals that are all so near to one of them have no crease between them.
constexpr float kHalfCosine = 0.9055f;

/// Twice the area of narrower faces, of their longest edge squared: rounding turns their normals anywhere.
constexpr float kSliver = 1e-4f;

/// Unit; zeros of slivers.
std::vector<Vec3f> face_normals(const Scan& mesh) {
  std::vector<Vec3f> normals(mesh.triangles.size());
  parallel_for(normals.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Triangle& t = mesh.triangles[i];
      const Vec3f ab = mesh.positions[t[1]] - mesh.positions[t[0]],
                  ac = mesh.positions[t[2]] - mesh.positions[t[0]], bc = ac - ab, n = cross(ab, ac);
      if (length(n) > kSliver * std::max({dot(ab, ab), dot(ac, ac), dot(bc, bc)})) normals[i] = normalized(n);
    }
  });
  return normals;
}

bool is_zero(const Vec3f& normal) { return normal == Vec3f{}; }

/// A face at a vertex, and the side that it is on: the number of the side's first face there.
struct Fan {
  std::uint32_t vertex, face, side;
};

/// The faces at vertices that may lie on creases, by vertex.
std::vector<Fan> find_fans(const Scan& mesh, std::span<const Vec3f> normals) {
  std::vector<std::uint32_t> first(mesh.positions.size(), kNone);
  std::vector<std::uint8_t> may_crease(mesh.positions.size());
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    if (is_zero(normals[i])) continue;
    for (const std::uint32_t v : mesh.triangles[i]) {
      if (first[v] == kNone) first[v] = i;
      if (dot(normals[first[v]], normals[i]) < kHalfCosine) may_crease[v] = 1;
    }
  }
  std::vector<Fan> fans;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
    for (const std::uint32_t v : mesh.triangles[i])
      if (may_crease[v] != 0) fans.push_back({v, i, 0});
  std::stable_sort(fans.begin(), fans.end(), [](const Fan& a, const Fan& b) { return a.vertex < b.vertex; });
  return fans;
}

/// Joins one vertex's faces across edges that are no creases.
void find_sides(const Scan& mesh, std::span<const Vec3f> normals, std::span<Fan> fan) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> spokes;  // the edges' other ends, and faces of the fan
  for (std::uint32_t k = 0; k < fan.size(); ++k)
    for (const std::uint32_t v : mesh.triangles[fan[k].face])
      if (v != fan[k].vertex) spokes.push_back({v, k});
  std::sort(spokes.begin(), spokes.end());
  Sets sides(fan.size());
  for (std::size_t i = 0; i + 1 < spokes.size(); ++i) {
    const Vec3f here = normals[fan[spokes[i].second].face], there = normals[fan[spokes[i + 1].second].face];
    if (spokes[i].first == spokes[i + 1].first &&
        (is_zero(here) || is_zero(there) || dot(here, there) >= kCreaseCosine))
      sides.join(spokes[i].second, spokes[i + 1].second);
  }
  for (std::uint32_t k = 0; k < fan.size(); ++k) fan[k].side = sides.find(k);
}

}  // namespace

CreasedMesh split_creases(const Scan& mesh) {
  const std::vector<Vec3f> normals = face_normals(mesh);
  CreasedMesh result{mesh.triangles, {}};
  std::vector<Fan> fans = find_fans(mesh, normals);
  std::vector<std::uint32_t> numbers;  // of the sides
  for (std::size_t begin = 0, end = 0; begin < fans.size(); begin = end) {
    while (end < fans.size() && fans[end].vertex == fans[begin].vertex) ++end;
    const std::span<Fan> fan = std::span(fans).subspan(begin, end - begin);
    find_sides(mesh, normals, fan);
    const std::uint32_t vertex = fan[0].vertex;
    numbers.assign(fan.size(), kNone);
    numbers[0] = vertex;
    for (const Fan& face : fan) {
      std::uint32_t& number = numbers[face.side];
      if (number == kNone) {
        number = static_cast<std::uint32_t>(mesh.positions.size() + result.copies.size());
        result.copies.push_back(vertex);
      }
      Triangle& t = result.triangles[face.face];
      std::replace(t.begin(), t.end(), vertex, number);
    }
  }
  return result;
}

std::vector<Vec3f> vertex_normals(const Scan& mesh, const CreasedMesh& creased) {
  return vertex_normals(mesh, creased.triangles, mesh.positions.size() + creased.copies.size());
}

}  // namespace rbvh
