#include "pipeline/rbvh/close_seam.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "pipeline/rbvh/group_primitives.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/scan/closest_point.h"

namespace rbvh {
namespace {

/// A border's edges, and which of its vertices is near a point.
class Border {
 public:
  explicit Border(const LooseLevel& level) : level_(level), edges_(soup_of(level)) {}

  const std::vector<CutEdge>& cuts() const { return level_.cuts; }
  const Scan& mesh() const { return level_.level.primitives; }

  /// The nearer end of the nearest edge, where that is within `most`.
  std::optional<std::uint32_t> vertex_near(Vec3f p, double most) const {
    const ClosestPoint::Nearest nearest = edges_.find(p);
    if (!(static_cast<double>(nearest.distance) <= most)) return {};
    const CutEdge& edge = level_.cuts[nearest.triangle];
    const auto distance = [&](std::uint32_t v) { return length(mesh().positions[v] - nearest.point); };
    return distance(edge.a) <= distance(edge.b) ? edge.a : edge.b;
  }

 private:
  static TriangleSoup soup_of(const LooseLevel& level) {
    TriangleSoup soup;
    for (const CutEdge& edge : level.cuts) {
      const Vec3f a = level.level.primitives.positions[edge.a], b = level.level.primitives.positions[edge.b];
      add_triangle(soup, a, b, b);
    }
    return soup;
  }

  const LooseLevel& level_;
  ClosestPoint edges_;
};

class Seam {
 public:
  Seam(bool has_colors, double most) : has_colors_(has_colors), most_(most) {}

  Scan mesh;

  /// Between each edge of one border and the vertices of the other that its ends are near. Where a vertex
  /// follows several edges of the other border, the strip of the other way round fills what is left.
  void add_strips(const Border& from, const Border& to, bool is_swapped) {
    for (const CutEdge& edge : from.cuts()) {
      const auto under_a = to.vertex_near(from.mesh().positions[edge.a], most_),
                 under_b = to.vertex_near(from.mesh().positions[edge.b], most_);
      if (!under_a || !under_b) continue;
      const std::uint32_t a = vertex(from, edge.a, is_swapped), b = vertex(from, edge.b, is_swapped),
                          c = vertex(to, *under_b, !is_swapped), d = vertex(to, *under_a, !is_swapped);
      add({b, a, d}, edge.of);
      add({b, d, c}, edge.of);
    }
  }

 private:
  void add(const Triangle& t, std::uint32_t object) {
    const auto p = [&](std::size_t i) { return Vec3d(mesh.positions[t[i]]); };
    if (cross(p(1) - p(0), p(2) - p(0)) == Vec3d{}) return;
    mesh.triangles.push_back(t);
    mesh.object_ids.push_back(static_cast<std::int32_t>(object));
  }

  std::uint32_t vertex(const Border& border, std::uint32_t number, bool is_swapped) {
    const auto [place, is_new] =
        numbers_.try_emplace({is_swapped, number}, static_cast<std::uint32_t>(mesh.positions.size()));
    if (!is_new) return place->second;
    const Scan& from = border.mesh();
    mesh.positions.push_back(from.positions[number]);
    mesh.normals.push_back(from.normals[number]);
    if (has_colors_) mesh.colors.push_back(from.colors.empty() ? Color8{255, 255, 255} : from.colors[number]);
    return place->second;
  }

  bool has_colors_;
  double most_;
  std::map<std::pair<bool, std::uint32_t>, std::uint32_t> numbers_;
};

}  // namespace

void close_seam(const LooseLevel& kept, LooseLevel& added, double most) {
  if (kept.cuts.empty() || added.cuts.empty()) return;
  Scan& to = added.level.primitives;
  Seam seam(!to.colors.empty(), most);
  {
    const Border before(kept), now(added);
    seam.add_strips(now, before, false);
    seam.add_strips(before, now, true);
  }
  const Scan& mesh = seam.mesh;
  if (mesh.triangles.empty()) return;
  const auto first_vertex = static_cast<std::uint32_t>(to.positions.size());
  to.positions.insert(to.positions.end(), mesh.positions.begin(), mesh.positions.end());
  to.normals.insert(to.normals.end(), mesh.normals.begin(), mesh.normals.end());
  to.colors.insert(to.colors.end(), mesh.colors.begin(), mesh.colors.end());
  for (const std::vector<std::uint32_t>& held : group_primitives(mesh, added.level.lattice).held) {
    added.level.primitive_leaves.push_back({static_cast<std::uint32_t>(added.level.leaves.size()),
                                            static_cast<std::uint32_t>(to.triangles.size())});
    RbvhLeaf& leaf = added.level.leaves.emplace_back();
    leaf.width = leaf.height = 2;
    leaf.primitives = static_cast<std::uint32_t>(held.size());
    leaf.object_id = static_cast<std::uint32_t>(mesh.object_ids[held.front()]);
    Bounds3f& box = added.boxes.emplace_back();
    added.from.push_back(0);
    added.is_new.push_back(1);
    for (const std::uint32_t i : held) {
      Triangle t = mesh.triangles[i];
      for (std::uint32_t& corner : t) corner += first_vertex;
      to.triangles.push_back(t);
      box.add(primitive_bounds(to, static_cast<std::uint32_t>(to.triangles.size() - 1)));
    }
  }
}

}  // namespace rbvh
