#include "pipeline/scan/simplify.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "pipeline/base/parallel_for.h"
#include "pipeline/scan/coincident.h"

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

/// The cosine between normals of vertices that close_seams() may make one.
constexpr float kSameNormal = 0.99f;
/// Its cells, to the error: as a level's lattice.
constexpr float kSeam = 0.25f;

/// Vertices at which the surface is open: around the others each neighbour follows one and precedes one.
std::vector<bool> open_vertices(std::size_t count, const std::vector<Triangle>& triangles) {
  const auto mixed = [](std::uint64_t v) {
    v = (v + 1) * 0x9e3779b97f4a7c15u;
    return (v ^ (v >> 32)) * 0xd6e8feb86659fd93u;
  };
  std::vector<std::uint64_t> sums(count);
  for (const Triangle& t : triangles)
    for (std::size_t c = 0; c < 3; ++c) sums[t[c]] += mixed(t[(c + 1) % 3]) - mixed(t[(c + 2) % 3]);
  std::vector<bool> open(count);
  for (std::size_t v = 0; v < count; ++v) open[v] = sums[v] != 0;
  return open;
}

/// Two edges of the surface that are no further apart than rounding puts them are one: open vertices in one
/// cell of a grid, unless their attributes differ.
void close_seams(const Scan& scan, float cell, std::vector<Triangle>& triangles) {
  const std::vector<bool> open = open_vertices(scan.positions.size(), triangles);
  const Vec3f origin = bounds(scan).lo;
  const auto are_alike = [&](std::uint32_t a, std::uint32_t b) {
    return (scan.normals.empty() || dot(scan.normals[a], scan.normals[b]) >= kSameNormal) &&
           (scan.colors.empty() || scan.colors[a] == scan.colors[b]);
  };
  std::map<std::array<std::int64_t, 3>, std::vector<std::uint32_t>> cells;
  std::vector<std::uint32_t> now(scan.positions.size());
  std::iota(now.begin(), now.end(), 0u);
  for (std::uint32_t v = 0; v < open.size(); ++v) {
    if (!open[v]) continue;
    const Vec3f p = (scan.positions[v] - origin) * (1 / cell);
    std::vector<std::uint32_t>& others = cells[{std::llround(p.x), std::llround(p.y), std::llround(p.z)}];
    const auto first =
        std::find_if(others.begin(), others.end(), [&](std::uint32_t w) { return are_alike(w, v); });
    if (first != others.end())
      now[v] = *first;
    else
      others.push_back(v);
  }
  for (const Triangle& t : triangles)  // none vanishes
    if (now[t[0]] == now[t[1]] || now[t[1]] == now[t[2]] || now[t[2]] == now[t[0]])
      for (const std::uint32_t corner : t) now[corner] = corner;
  for (Triangle& t : triangles)
    for (std::uint32_t& corner : t) corner = now[corner];
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

/// Corners of triangles, three each.
using Indices = std::vector<unsigned int>;

Indices simplify_whole(std::span<const Vec3f> positions, const Indices& indices, float error,
                       unsigned int options = 0) {
  const auto* floats = reinterpret_cast<const float*>(positions.data());
  const float scale = meshopt_simplifyScale(floats, positions.size(), sizeof(Vec3f));
  Indices fewer(indices.size());
  fewer.resize(meshopt_simplify(fewer.data(), indices.data(), indices.size(), floats, positions.size(),
                                sizeof(Vec3f), 0, scale > 0 ? error / scale : 0, options, nullptr));
  return fewer;
}

/// Triangles that are simplified together: what they need stays in the cache, and each part has a thread.
constexpr std::size_t kPartTriangles = 1 << 16;
/// Where more of the vertices that are left lie at borders between parts, which stay, parts are too small.
constexpr double kMostBorder = 1.0 / 16;
/// The fewer edges compete, the better is the order in which they collapse: with so much larger a bound parts
/// come as near to the scan as the whole does.
constexpr float kPartError = 1.3f;

/// Halves the triangles along the longest axis until they are few enough.
void split_parts(std::span<const Vec3f> positions, const Indices& indices, std::span<std::uint32_t> triangles,
                 std::vector<std::span<std::uint32_t>>& parts) {
  if (triangles.size() <= kPartTriangles) {
    parts.push_back(triangles);
    return;
  }
  const auto first_corner = [&](std::uint32_t i) { return positions[indices[3 * std::size_t{i}]]; };
  Bounds3f box;
  for (const std::uint32_t i : triangles) box.add(first_corner(i));
  const Vec3f e = box.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  const auto middle = triangles.begin() + static_cast<std::ptrdiff_t>(triangles.size() / 2);
  std::nth_element(triangles.begin(), middle, triangles.end(), [&](std::uint32_t a, std::uint32_t b) {
    const float at_a = first_corner(a)[axis], at_b = first_corner(b)[axis];
    return at_a < at_b || (at_a == at_b && a < b);
  });
  split_parts(positions, indices, triangles.first(triangles.size() / 2), parts);
  split_parts(positions, indices, triangles.subspan(triangles.size() / 2), parts);
}

Indices simplify_part(std::span<const Vec3f> positions, const Indices& indices,
                      std::span<const std::uint32_t> triangles, float error) {
  std::unordered_map<unsigned int, unsigned int> numbers(triangles.size());
  Indices vertices, own;
  std::vector<Vec3f> own_positions;
  for (const std::uint32_t i : triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const unsigned int vertex = indices[3 * std::size_t{i} + k];
      const auto [at, is_new] = numbers.try_emplace(vertex, static_cast<unsigned int>(vertices.size()));
      if (is_new) {
        vertices.push_back(vertex);
        own_positions.push_back(positions[vertex]);
      }
      own.push_back(at->second);
    }
  Indices fewer = simplify_whole(own_positions, own, kPartError * error, meshopt_SimplifyLockBorder);
  for (unsigned int& vertex : fewer) vertex = vertices[vertex];
  return fewer;
}

/// The mesh in parts whose borders stay; nothing where these would show.
std::optional<Indices> simplify_in_parts(std::span<const Vec3f> positions, const Indices& indices,
                                         float error) {
  std::vector<std::uint32_t> triangles(indices.size() / 3);
  std::iota(triangles.begin(), triangles.end(), 0u);
  std::vector<std::span<std::uint32_t>> parts;
  split_parts(positions, indices, triangles, parts);
  std::vector<Indices> simplified(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      simplified[i] = simplify_part(positions, indices, parts[i], error);
  });
  Indices all;
  std::vector<std::uint32_t> part_of(positions.size());  // 1 + the last part that uses the vertex
  std::vector<bool> is_shared(positions.size());
  std::size_t used = 0, shared = 0;
  for (std::uint32_t i = 0; i < simplified.size(); ++i) {
    for (const unsigned int vertex : simplified[i]) {
      if (part_of[vertex] == 0) {
        ++used;
      } else if (part_of[vertex] != i + 1 && !is_shared[vertex]) {
        is_shared[vertex] = true;
        ++shared;
      }
      part_of[vertex] = i + 1;
    }
    all.insert(all.end(), simplified[i].begin(), simplified[i].end());
  }
  if (static_cast<double>(shared) > kMostBorder * static_cast<double>(used)) return std::nullopt;
  return all;
}

/// Takes out flaps, which collapses leave where they fold triangles onto each other. Large ones, such as a
/// plate thinner than the error, become sheets, as at ingest.
void drop_flaps(const Scan& scan, Indices& indices) {
  std::vector<Triangle> triangles(indices.size() / 3);
  for (std::size_t i = 0; i < indices.size(); ++i) triangles[i / 3][i % 3] = indices[i];
  CoincidentCounts counts;
  const std::vector<FaceFate> fates =
      settle_coincident(triangles, scan.positions, {}, kLargestFold * bounds(scan).diagonal(), counts);
  if (fates.empty()) return;
  indices.clear();
  for (std::size_t i = 0; i < fates.size(); ++i)
    if (fates[i] == FaceFate::kStays || fates[i] == FaceFate::kSheet)
      indices.insert(indices.end(), triangles[i].begin(), triangles[i].end());
}

Indices simplify_object(const Scan& scan, const Indices& indices, float error) {
  std::optional<Indices> fewer;
  if (indices.size() / 3 > 2 * kPartTriangles) fewer = simplify_in_parts(scan.positions, indices, error);
  if (!fewer) fewer = simplify_whole(scan.positions, indices, error);
  drop_flaps(scan, *fewer);
  keep_components(scan.positions.size(), indices, *fewer);
  return std::move(*fewer);
}

/// The triangles' corners after welding, by object; those that weld to nothing go.
std::map<std::int32_t, std::vector<unsigned int>> indices_by_object(const Scan& scan, float error) {
  const std::vector<std::uint32_t> first_of = weld(scan);
  std::vector<Triangle> triangles = scan.triangles;
  for (Triangle& t : triangles)
    for (std::uint32_t& corner : t) corner = first_of[corner];
  if (error > 0) close_seams(scan, kSeam * error, triangles);
  std::map<std::int32_t, std::vector<unsigned int>> by_object;
  for (std::size_t i = 0; i < scan.triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    std::vector<unsigned int>& indices = by_object[scan.object_ids.empty() ? 0 : scan.object_ids[i]];
    indices.insert(indices.end(), t.begin(), t.end());
  }
  return by_object;
}

}  // namespace

Scan simplify(const Scan& scan, float error) {
  if (scan.is_cloud()) return scan;
  Scan result;
  result.shift = scan.shift;
  std::vector<std::uint32_t> numbers(scan.positions.size(), 0xffffffffu);
  for (const auto& [object, indices] : indices_by_object(scan, error)) {
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
