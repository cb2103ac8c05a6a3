#include "pipeline/proxy/manifold.h"

#include <algorithm>
#include <span>

#include "pipeline/base/error.h"
#include "pipeline/base/sets.h"
#include "pipeline/scan/clean.h"

namespace rbvh {
namespace {

// A side of a triangle, keyed by its vertices. Corner 3f + k starts side k of triangle f.
struct Side {
  std::uint64_t key;  ///< smaller vertex, larger vertex
  std::uint32_t corner;
  bool is_forward;  ///< from the smaller vertex to the larger
};

constexpr std::size_t kMostSheets = 64;  ///< that are paired at one edge

std::uint32_t next_corner(std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

std::vector<Side> sorted_sides(const std::vector<std::uint32_t>& vertex_of) {
  std::vector<Side> sides(vertex_of.size());
  for (std::uint32_t corner = 0; corner < sides.size(); ++corner) {
    const std::uint64_t a = vertex_of[corner], b = vertex_of[next_corner(corner)];
    sides[corner] = {std::min(a, b) << 32 | std::max(a, b), corner, a < b};
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.key != b.key ? a.key < b.key : a.corner < b.corner;
  });
  return sides;
}

// Calls group(begin, end) for the sides of each edge.
template <class Group>
void for_each_edge(const std::vector<Side>& sides, const Group& group) {
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].key == sides[begin].key) ++end;
    group(begin, end);
  }
}

double area_of(const Scan& scan, const std::uint32_t* corner) {
  const Vec3d a(scan.positions[corner[0]]), b(scan.positions[corner[1]]), c(scan.positions[corner[2]]);
  return length(cross(b - a, c - a)) / 2;
}

// Three vertices a triangle, where equal positions are one, without what is small.
std::vector<std::uint32_t> kept_corners(const Scan& scan, double min_component, ManifoldCounts& counts) {
  const std::vector<std::uint32_t> first = first_equal_vertices(scan, false);
  std::vector<std::uint32_t> corners;
  corners.reserve(scan.triangles.size() * 3);
  for (const Triangle& t : scan.triangles) {
    const std::uint32_t a = first[t[0]], b = first[t[1]], c = first[t[2]];
    if (a == b || b == c || c == a)
      ++counts.flat_triangles;
    else
      corners.insert(corners.end(), {a, b, c});
  }
  Sets sets(scan.positions.size());
  for (std::size_t i = 0; i < corners.size(); i += 3) {
    sets.join(corners[i], corners[i + 1]);
    sets.join(corners[i], corners[i + 2]);
  }
  std::vector<double> area(scan.positions.size(), 0);  // at the roots
  double whole = 0, largest = 0;
  for (std::size_t i = 0; i < corners.size(); i += 3) {
    const double a = area_of(scan, &corners[i]);
    largest = std::max(largest, area[sets.find(corners[i])] += a);
    whole += a;
  }
  const double least = std::min(largest, whole * min_component);
  std::size_t to = 0;
  for (std::size_t i = 0; i < corners.size(); i += 3) {
    double& part = area[sets.find(corners[i])];
    if (part >= least) {
      std::copy_n(corners.begin() + static_cast<std::ptrdiff_t>(i), 3,
                  corners.begin() + static_cast<std::ptrdiff_t>(to));
      to += 3;
    } else {
      ++counts.small_triangles;
      if (part >= 0) ++counts.small_components;
      part = -1;  // counted
    }
  }
  corners.resize(to);
  return corners;
}

Vec3d normal_of(const Scan& scan, const std::vector<std::uint32_t>& vertex_of, std::uint32_t triangle) {
  const auto point = [&](std::uint32_t k) { return Vec3d(scan.positions[vertex_of[3 * triangle + k]]); };
  return normalized(cross(point(1) - point(0), point(2) - point(0)));
}

// Which sides of an edge with more than two triangles are neighbours: of those of the same orientation, the
// ones that lie flattest. Calls glue(a, b).
template <class Glue>
void pair_sheets(const Scan& scan, const std::vector<std::uint32_t>& vertex_of, std::span<const Side> sides,
                 const Glue& glue) {
  if (sides.size() > kMostSheets) return;
  struct Candidate {
    double cosine;
    std::size_t a, b;
  };
  std::vector<Candidate> candidates;
  for (std::size_t a = 0; a < sides.size(); ++a)
    for (std::size_t b = a + 1; b < sides.size(); ++b)
      if (sides[a].is_forward != sides[b].is_forward)
        candidates.push_back({dot(normal_of(scan, vertex_of, sides[a].corner / 3),
                                  normal_of(scan, vertex_of, sides[b].corner / 3)),
                              a, b});
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& x, const Candidate& y) { return x.cosine > y.cosine; });
  std::vector<bool> is_glued(sides.size());
  for (const Candidate& c : candidates) {
    if (is_glued[c.a] || is_glued[c.b]) continue;
    is_glued[c.a] = is_glued[c.b] = true;
    glue(sides[c.a], sides[c.b]);
  }
}

// Joins corners of one vertex across the edges that two triangles share as neighbours should. What is then
// one set of corners goes round its vertex in one fan.
std::vector<std::uint32_t> fans(const Scan& scan, const std::vector<std::uint32_t>& vertex_of,
                                const std::vector<Side>& sides, const std::vector<bool>& is_apart,
                                std::uint64_t& cut_edges) {
  Sets sets(vertex_of.size());
  cut_edges = 0;
  const auto glue = [&](const Side& a, const Side& b) {
    if (is_apart[a.corner / 3] || is_apart[b.corner / 3]) return;
    sets.join(a.corner, next_corner(b.corner));
    sets.join(next_corner(a.corner), b.corner);
  };
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if (end - begin == 1) return;
    const Side &a = sides[begin], &b = sides[begin + 1];
    if (end - begin == 2 && a.is_forward != b.is_forward) return glue(a, b);
    ++cut_edges;
    pair_sheets(scan, vertex_of, std::span(sides).subspan(begin, end - begin), glue);
  });
  std::vector<std::uint32_t> fan(vertex_of.size());
  for (std::uint32_t corner = 0; corner < fan.size(); ++corner) fan[corner] = sets.find(corner);
  return fan;
}

}  // namespace

Manifold make_manifold(const Scan& scan, double min_component, ManifoldCounts& counts) {
  const std::vector<std::uint32_t> vertex_of = kept_corners(scan, min_component, counts);
  RBVH_CHECK(vertex_of.size() < UINT32_MAX);
  std::vector<std::uint32_t> fan;
  {
    const std::vector<Side> sides = sorted_sides(vertex_of);
    std::vector<bool> is_apart(vertex_of.size() / 3, false);
    fan = fans(scan, vertex_of, sides, is_apart, counts.cut_edges);
    // Fans that were cut along an edge may still be one at both of its ends, round about. Rare: such
    // triangles stand alone.
    for (bool is_again = counts.cut_edges > 0; is_again;) {
      is_again = false;
      const std::vector<Side> fan_sides = sorted_sides(fan);
      for_each_edge(fan_sides, [&](std::size_t begin, std::size_t end) {
        const bool is_pair =
            end - begin == 2 && fan_sides[begin].is_forward != fan_sides[begin + 1].is_forward;
        if (end - begin == 1 || is_pair) return;
        for (std::size_t i = begin; i < end; ++i) is_apart[fan_sides[i].corner / 3] = true;
        is_again = true;
      });
      if (is_again) fan = fans(scan, vertex_of, sides, is_apart, counts.cut_edges);
    }
  }

  Manifold mesh;
  std::vector<std::uint32_t> number(fan.size(), UINT32_MAX);
  std::vector<bool> is_seen(scan.positions.size());
  mesh.triangles.resize(fan.size() / 3);
  for (std::uint32_t corner = 0; corner < fan.size(); ++corner) {
    std::uint32_t& vertex = number[fan[corner]];
    if (vertex == UINT32_MAX) {
      vertex = static_cast<std::uint32_t>(mesh.positions.size());
      mesh.positions.push_back(scan.positions[vertex_of[corner]]);
      if (is_seen[vertex_of[corner]]) ++counts.cut_vertices;
      is_seen[vertex_of[corner]] = true;
    }
    mesh.triangles[corner / 3][corner % 3] = vertex;
  }
  Sets parts(mesh.positions.size());
  std::uint64_t sides_open = 0;
  for (const Triangle& t : mesh.triangles) {
    parts.join(t[0], t[1]);
    parts.join(t[0], t[2]);
  }
  for (std::uint32_t i = 0; i < mesh.positions.size(); ++i) counts.components += parts.find(i) == i;
  for_each_edge(sorted_sides(fan),
                [&](std::size_t begin, std::size_t end) { sides_open += end - begin == 1; });
  counts.open_edges = sides_open;
  return mesh;
}

}  // namespace rbvh
