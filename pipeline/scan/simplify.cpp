#include "pipeline/scan/simplify.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>
#include <vector>

namespace rbvh {
namespace {

/// Vertices that agree in all they have are one: quadrics see no seam between them.
std::vector<std::uint32_t> weld(const Scan& scan) {
  const std::size_t count = scan.positions.size();
  std::vector<meshopt_Stream> streams = {{scan.positions.data(), sizeof(Vec3f), sizeof(Vec3f)}};
  if (!scan.normals.empty()) streams.push_back({scan.normals.data(), sizeof(Vec3f), sizeof(Vec3f)});
  if (!scan.colors.empty()) streams.push_back({scan.colors.data(), sizeof(Color8), sizeof(Color8)});
  std::vector<std::uint32_t> first_of(count);
  const std::size_t unique = meshopt_generateVertexRemapMulti(
      first_of.data(), reinterpret_cast<const unsigned int*>(scan.triangles.data()),
      3 * scan.triangles.size(), count, streams.data(), streams.size());
  // From the new numbers to the first vertex of each; vertices that no triangle uses have none.
  std::vector<std::uint32_t> first(unique, 0xffffffffu);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (first_of[i] == 0xffffffffu) continue;
    std::uint32_t& vertex = first[first_of[i]];
    vertex = std::min(vertex, i);
    first_of[i] = vertex;
  }
  return first_of;
}

/// The vertex that stands for each one's component.
class Components {
 public:
  explicit Components(std::size_t vertices) : parents_(vertices) {
    std::iota(parents_.begin(), parents_.end(), 0u);
  }
  std::uint32_t find(std::uint32_t vertex) {
    while (parents_[vertex] != vertex) vertex = parents_[vertex] = parents_[parents_[vertex]];
    return vertex;
  }
  void join(const unsigned int* triangle) {
    for (int k = 1; k < 3; ++k) {
      const std::uint32_t a = find(triangle[0]), b = find(triangle[k]);
      parents_[std::max(a, b)] = std::min(a, b);
    }
  }

 private:
  std::vector<std::uint32_t> parents_;
};

/// Appends the triangles of components that are in `before` and no longer in `after`.
void keep_components(std::size_t vertices, const std::vector<unsigned int>& before,
                     std::vector<unsigned int>& after) {
  Components components(vertices);
  for (std::size_t i = 0; i < before.size(); i += 3) components.join(before.data() + i);
  std::vector<bool> is_there(vertices);
  for (const unsigned int vertex : after) is_there[components.find(vertex)] = true;
  for (std::size_t i = 0; i < before.size(); i += 3)
    if (!is_there[components.find(before[i])]) after.insert(after.end(), &before[i], &before[i] + 3);
}

std::vector<unsigned int> simplify_object(const Scan& scan, const std::vector<unsigned int>& indices,
                                          float error) {
  const auto* positions = reinterpret_cast<const float*>(scan.positions.data());
  const std::size_t vertices = scan.positions.size();
  const float scale = meshopt_simplifyScale(positions, vertices, sizeof(Vec3f));
  std::vector<unsigned int> fewer(indices.size());
  fewer.resize(meshopt_simplify(fewer.data(), indices.data(), indices.size(), positions, vertices,
                                sizeof(Vec3f), 0, scale > 0 ? error / scale : 0, 0, nullptr));
  keep_components(vertices, indices, fewer);
  return fewer;
}

/// The triangles' corners after welding, by object; those that weld to nothing go.
std::map<std::int32_t, std::vector<unsigned int>> indices_by_object(const Scan& scan) {
  const std::vector<std::uint32_t> first_of = weld(scan);
  std::map<std::int32_t, std::vector<unsigned int>> by_object;
  for (std::size_t i = 0; i < scan.triangles.size(); ++i) {
    const Triangle& t = scan.triangles[i];
    const unsigned int corners[3] = {first_of[t[0]], first_of[t[1]], first_of[t[2]]};
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    std::vector<unsigned int>& indices = by_object[scan.object_ids.empty() ? 0 : scan.object_ids[i]];
    indices.insert(indices.end(), corners, corners + 3);
  }
  return by_object;
}

}  // namespace

Scan simplify(const Scan& scan, float error) {
  if (scan.is_cloud()) return scan;
  Scan result;
  result.shift = scan.shift;
  std::vector<std::uint32_t> numbers(scan.positions.size(), 0xffffffffu);
  for (const auto& [object, indices] : indices_by_object(scan)) {
    const std::vector<unsigned int> fewer = simplify_object(scan, indices, error);
    for (std::size_t i = 0; i < fewer.size(); i += 3) {
      Triangle& triangle = result.triangles.emplace_back();
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const unsigned int vertex = fewer[i + corner];
        std::uint32_t& number = numbers[vertex];
        if (number == 0xffffffffu) {
          number = static_cast<std::uint32_t>(result.positions.size());
          result.positions.push_back(scan.positions[vertex]);
          if (!scan.normals.empty()) result.normals.push_back(scan.normals[vertex]);
          if (!scan.colors.empty()) result.colors.push_back(scan.colors[vertex]);
        }
        triangle[corner] = number;
      }
      if (!scan.object_ids.empty()) result.object_ids.push_back(object);
    }
  }
  return result;
}

}  // namespace rbvh
