#include "pipeline/scan/stitch.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <queue>
#include <set>
#include <unordered_map>
#include <unordered_set>

#include "pipeline/scan/clean.h"

namespace rbvh {
namespace {

/// Vertices closer than this part of a gap are one.
constexpr float kWeld = 0.3f;
/// The longest edge across a gap, in gaps.
constexpr float kLongestEdge = 3;
/// Holes that are closed at the end: twice their area over the way around them, which is the width of a slit
/// and the radius of a circle, in gaps; the longest way around one that is folded over, in gaps; and their
/// edges.
constexpr float kWidestHole = 2, kFoldedHole = 6;
constexpr std::size_t kMostLoopEdges = 256;
/// The cosine between a new triangle's normal and those of its vertices.
constexpr float kSameSide = 0.2f;

using Edge = std::uint64_t;  ///< from, to
Edge edge(std::uint32_t from, std::uint32_t to) { return std::uint64_t{from} << 32 | to; }
std::uint32_t from(Edge e) { return static_cast<std::uint32_t>(e >> 32); }
std::uint32_t to(Edge e) { return static_cast<std::uint32_t>(e); }
Edge reversed(Edge e) { return edge(to(e), from(e)); }

/// The edges of all triangles, as they go around them.
std::vector<Edge> sorted_edges(const std::vector<Triangle>& triangles) {
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (const Triangle& t : triangles)
    for (std::size_t c = 0; c < 3; ++c) edges.push_back(edge(t[c], t[(c + 1) % 3]));
  std::sort(edges.begin(), edges.end());
  return edges;
}

/// The edges that a further triangle could have: the reverse of those that one triangle has.
std::vector<Edge> open_edges(const std::vector<Edge>& sorted) {
  std::vector<Edge> open;
  for (const Edge e : sorted)
    if (!std::binary_search(sorted.begin(), sorted.end(), reversed(e))) open.push_back(reversed(e));
  return open;
}

/// Things at points, found by place.
class Grid {
 public:
  explicit Grid(float cell) : cell_(cell) {}
  void add(Vec3f p, std::uint32_t what) { cells_[key(place(p))].push_back(what); }
  /// Things may come several times.
  template <class Visit>
  void near(const Bounds3f& box, const Visit& visit) const {
    const std::array<std::int64_t, 3> lo = place(box.lo), hi = place(box.hi);
    for (std::int64_t z = lo[2]; z <= hi[2]; ++z)
      for (std::int64_t y = lo[1]; y <= hi[1]; ++y)
        for (std::int64_t x = lo[0]; x <= hi[0]; ++x) {
          const auto found = cells_.find(key({x, y, z}));
          if (found == cells_.end()) continue;
          for (const std::uint32_t what : found->second) visit(what);
        }
  }

 private:
  std::array<std::int64_t, 3> place(Vec3f p) const {
    return {std::llround(p.x / cell_), std::llround(p.y / cell_), std::llround(p.z / cell_)};
  }
  static std::uint64_t key(const std::array<std::int64_t, 3>& p) {
    const auto part = [](std::int64_t v) { return static_cast<std::uint64_t>(v) & 0x1fffff; };
    return part(p[0]) | part(p[1]) << 21 | part(p[2]) << 42;
  }
  float cell_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

Bounds3f around(Vec3f p, float by) { return {p - Vec3f{by, by, by}, p + Vec3f{by, by, by}}; }

float largest(const std::vector<float>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

Vec3f normal_of(const Scan& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  const Vec3f p = mesh.positions[a];
  return normalized(cross(mesh.positions[b] - p, mesh.positions[c] - p));
}

/// Drops triangles without area, those that are there twice, and of several at one edge, going the same way,
/// all but the first, unless they came with their patch.
void drop_repeated(Scan& mesh, const Patches& patches, StitchCounts& counts) {
  std::unordered_set<Edge> repeated;
  const std::vector<Edge> edges = sorted_edges(mesh.triangles);
  for (std::size_t i = 1; i < edges.size(); ++i)
    if (edges[i] == edges[i - 1]) repeated.insert(edges[i]);
  std::unordered_set<Edge> seen;
  std::set<Triangle> kept;
  const std::size_t before = mesh.triangles.size();
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return true;
    const Edge own[3] = {edge(t[0], t[1]), edge(t[1], t[2]), edge(t[2], t[0])};
    if (std::none_of(own, own + 3, [&](Edge e) { return repeated.contains(e); })) return false;
    Triangle turned = t;
    std::rotate(turned.begin(), std::min_element(turned.begin(), turned.end()), turned.end());
    if (!kept.insert(turned).second) return true;
    const bool is_complete = patches.gap[t[0]] == 0 && patches.gap[t[1]] == 0 && patches.gap[t[2]] == 0;
    if (!is_complete && std::any_of(own, own + 3, [&](Edge e) { return seen.contains(e); })) return true;
    seen.insert(own, own + 3);
    return false;
  });
  counts.dropped_triangles += before - mesh.triangles.size();
}

void weld(Scan& mesh, const Patches& patches, StitchCounts& counts) {
  std::vector<std::uint32_t> boundary;
  for (const Edge e : open_edges(sorted_edges(mesh.triangles))) boundary.push_back(from(e));
  std::sort(boundary.begin(), boundary.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair{patches.of_vertex[a], a} < std::pair{patches.of_vertex[b], b};
  });
  boundary.erase(std::unique(boundary.begin(), boundary.end()), boundary.end());
  const float reach = kWeld * largest(patches.gap);
  if (!(reach > 0)) return;
  Grid grid(2 * reach);
  std::vector<std::uint32_t> now(mesh.positions.size());
  std::iota(now.begin(), now.end(), 0u);
  for (const std::uint32_t v : boundary) {
    const Vec3f p = mesh.positions[v];
    float nearest = std::numeric_limits<float>::infinity();
    grid.near(around(p, reach), [&](std::uint32_t other) {
      const float gaps[2] = {patches.gap[v], patches.gap[other]};
      const float gap = gaps[0] > 0 && gaps[1] > 0 ? std::min(gaps[0], gaps[1]) : std::max(gaps[0], gaps[1]);
      const float distance = length(mesh.positions[other] - p);
      if (patches.of_vertex[other] == patches.of_vertex[v] || distance > kWeld * gap ||
          !(distance < nearest) || dot(mesh.normals[v], mesh.normals[other]) < kSameSide)
        return;
      nearest = distance;
      now[v] = other;
    });
    if (now[v] == v)
      grid.add(p, v);
    else
      ++counts.welded_vertices;
  }
  for (Triangle& t : mesh.triangles)
    for (std::uint32_t& corner : t) corner = now[corner];
}

class Stitcher {
 public:
  Stitcher(Scan& mesh, const Patches& patches)
      : mesh_(mesh),
        patches_(patches),
        reach_(kLongestEdge * largest(patches.gap)),
        vertices_(reach_ / 2),
        edges_(reach_ / 2),
        sorted_(sorted_edges(mesh.triangles)) {
    for (const Edge e : open_edges(sorted_)) open(e);
  }

  std::uint64_t run() {
    const std::size_t before = mesh_.triangles.size();
    for (std::size_t i = 0; i < listed_.size(); ++i) push(listed_[i]);
    while (!queue_.empty()) {
      const Candidate best = queue_.top();
      queue_.pop();
      if (!is_open(best.edge)) continue;
      const std::optional<std::uint32_t> apex = find_apex(best.edge);
      if (apex != best.apex) {
        push(best.edge);
        continue;
      }
      add(best.edge, *apex);
    }
    close_loops();
    return mesh_.triangles.size() - before;
  }

 private:
  struct Candidate {
    float size;
    Edge edge;
    std::uint32_t apex;
    bool operator<(const Candidate& other) const {  // the smallest is on top
      return size != other.size ? size > other.size : edge > other.edge;
    }
  };

  Vec3f at(std::uint32_t v) const { return mesh_.positions[v]; }
  bool is_open(Edge e) const { return open_.contains(e); }
  /// Whether a triangle has the edge.
  bool is_taken(Edge e) const {
    return std::binary_search(sorted_.begin(), sorted_.end(), e) || taken_.contains(e);
  }
  bool is_complete(std::uint32_t v) const { return patches_.gap[v] == 0; }

  void open(Edge e) {
    open_.insert(e);
    for (const std::uint32_t v : {from(e), to(e)})
      if (holes_[v]++ == 0) vertices_.add(at(v), v);
    const Vec3f a = at(from(e)), b = at(to(e));
    const int steps = 1 + static_cast<int>(length(b - a) / (reach_ / 2));
    for (int i = 0; i <= steps; ++i)
      edges_.add(a + (b - a) * (static_cast<float>(i) / static_cast<float>(steps)),
                 static_cast<std::uint32_t>(listed_.size()));
    listed_.push_back(e);
  }

  void take(Edge e) {
    taken_.insert(e);
    if (open_.erase(e) != 0) {
      --holes_[from(e)];
      --holes_[to(e)];
    } else {
      open(reversed(e));
      push(reversed(e));
    }
  }

  /// The edge goes around the new triangle.
  void add(Edge e, std::uint32_t apex) {
    mesh_.triangles.push_back({from(e), to(e), apex});
    take(e);
    take(edge(to(e), apex));
    take(edge(apex, from(e)));
  }

  void push(Edge e) {
    if (const auto apex = find_apex(e)) {
      const Vec3f c = at(*apex);
      queue_.push({std::max(length(c - at(from(e))), length(c - at(to(e)))), e, *apex});
    }
  }

  /// Whether the segments cross, seen along `n`, about at one depth.
  bool crosses(Vec3f a, Vec3f b, Vec3f p, Vec3f q, Vec3f n, float depth) const {
    const auto side = [&](Vec3f u, Vec3f v, Vec3f w) { return dot(cross(v - u, w - u), n); };
    const float s1 = side(a, b, p), s2 = side(a, b, q), s3 = side(p, q, a), s4 = side(p, q, b);
    if (!(s1 * s2 < 0 && s3 * s4 < 0)) return false;
    const float t = s3 / (s3 - s4), u = s1 / (s1 - s2);
    return std::abs(dot((a + (b - a) * t) - (p + (q - p) * u), n)) < depth;
  }

  bool is_blocked(std::uint32_t a, std::uint32_t b, Vec3f n) const {
    bool blocked = false;
    Bounds3f box;
    box.add(at(a));
    box.add(at(b));
    edges_.near(box, [&](std::uint32_t listed) {
      const Edge e = listed_[listed];
      if (blocked || !is_open(e)) return;
      const std::uint32_t p = from(e), q = to(e);
      if (p == a || p == b || q == a || q == b || dot(mesh_.normals[p] + mesh_.normals[q], n) < 0) return;
      blocked = crosses(at(a), at(b), at(p), at(q), n, reach_);
    });
    return blocked;
  }

  /// May the triangle be added, apart from what lies between its corners? Gives the normal around it.
  std::optional<Vec3f> fits(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    if (is_complete(a) && is_complete(b) && is_complete(c)) return {};
    if (is_taken(edge(b, c)) || is_taken(edge(c, a))) return {};
    const Vec3f n = normalized(normalized(mesh_.normals[a] + mesh_.normals[b]) + mesh_.normals[c]);
    if (!(dot(normal_of(mesh_, a, b, c), n) > kSameSide)) return {};
    return n;
  }

  std::optional<std::uint32_t> find_apex(Edge e) const {
    const std::uint32_t a = from(e), b = to(e);
    const float base = length(at(b) - at(a));
    struct Choice {
      float cosine;  ///< of the angle at the apex: the least is the emptiest circle
      std::uint32_t apex;
      Vec3f n;
    };
    std::vector<Choice> choices;
    Bounds3f box = around(at(a), reach_);
    box.add(around(at(b), reach_));
    vertices_.near(box, [&](std::uint32_t c) {
      if (c == a || c == b || holes_.at(c) == 0) return;
      const float gap = std::max({patches_.gap[a], patches_.gap[b], patches_.gap[c]});
      const Vec3f to_a = at(a) - at(c), to_b = at(b) - at(c);
      const float la = length(to_a), lb = length(to_b);
      if (std::min(la, lb) > kLongestEdge * gap || std::max(la, lb) > std::max(kLongestEdge * gap, base))
        return;
      if (const auto n = fits(a, b, c)) choices.push_back({dot(to_a, to_b) / (la * lb), c, *n});
    });
    std::sort(choices.begin(), choices.end(), [](const Choice& x, const Choice& y) {
      return x.cosine != y.cosine ? x.cosine < y.cosine : x.apex < y.apex;
    });
    for (const Choice& choice : choices) {
      const auto is_free = [&](std::uint32_t p, std::uint32_t q) {
        return is_open(edge(p, q)) || !is_blocked(p, q, choice.n);
      };
      if (is_free(b, choice.apex) && is_free(choice.apex, a)) return choice.apex;
    }
    return {};
  }

  /// Closes narrow holes that are left. Holes may touch at a vertex: the way around them is cut into loops.
  void close_loops() {
    std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> next;
    std::vector<Edge> starts;
    for (const Edge e : listed_)
      if (is_open(e)) {
        next[from(e)].push_back(to(e));
        starts.push_back(e);
      }
    for (const Triangle& t : mesh_.triangles)
      for (std::size_t c = 0; c < 3; ++c)
        if (const Edge e = edge(t[(c + 1) % 3], t[c]); is_open(e)) opposite_[e] = t[(c + 2) % 3];
    for (const Edge start : starts) {
      std::vector<std::uint32_t> path = {from(start)};
      std::unordered_map<std::uint32_t, std::size_t> place = {{from(start), 0}};
      while (!path.empty()) {
        std::vector<std::uint32_t>& ways = next[path.back()];
        if (ways.empty()) {
          place.erase(path.back());
          path.pop_back();
          continue;
        }
        const std::uint32_t v = ways.back();
        ways.pop_back();
        const auto [before, is_new] = place.try_emplace(v, path.size());
        if (is_new) {
          path.push_back(v);
          continue;
        }
        const auto first = path.begin() + static_cast<std::ptrdiff_t>(before->second);
        const std::vector<std::uint32_t> loop(first, path.end());
        for (std::size_t i = before->second + 1; i < path.size(); ++i) place.erase(path[i]);
        path.erase(first + 1, path.end());
        if (loop.size() >= 3 && loop.size() <= kMostLoopEdges) close_loop(loop);
      }
    }
  }

  /// Ear by ear, the smallest first.
  void close_loop(std::vector<std::uint32_t> loop) {
    const std::vector<std::uint32_t> outline = loop;
    std::vector<Triangle> ears;
    float way = 0, gap = 0, area = 0, facing = 0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      way += length(at(loop[(i + 1) % loop.size()]) - at(loop[i]));
      gap = std::max(gap, patches_.gap[loop[i]]);
    }
    while (loop.size() >= 3) {
      std::size_t best = loop.size();
      float best_size = std::numeric_limits<float>::infinity();
      for (std::size_t i = 0; i < loop.size(); ++i) {
        const std::uint32_t a = loop[(i + loop.size() - 1) % loop.size()], b = loop[i],
                            c = loop[(i + 1) % loop.size()];
        if (loop.size() > 3 && (is_taken(edge(c, a)) || is_taken(edge(a, c)))) continue;
        const Vec3f n = normalized(mesh_.normals[a] + mesh_.normals[b] + mesh_.normals[c]);
        // Ears that turn over come last: they close the hole all the same.
        const float turned = 2 - dot(normal_of(mesh_, a, b, c), n);
        const float size = length(at(c) - at(a)) * turned * turned;
        if (size < best_size) {
          best_size = size;
          best = i;
        }
      }
      if (best == loop.size()) return;
      const Triangle& ear = ears.emplace_back(
          Triangle{loop[(best + loop.size() - 1) % loop.size()], loop[best], loop[(best + 1) % loop.size()]});
      const Vec3f p = at(ear[0]), n = cross(at(ear[1]) - p, at(ear[2]) - p) * 0.5f;
      area += length(n);
      facing += dot(n, normalized(mesh_.normals[ear[0]] + mesh_.normals[ear[1]] + mesh_.normals[ear[2]]));
      if (loop.size() == 3) break;
      loop.erase(loop.begin() + static_cast<std::ptrdiff_t>(best));
    }
    if (2 * area > kWidestHole * gap * way) return;
    if (!(facing > 0) && (way > kFoldedHole * gap || is_patch(outline))) return;
    for (const Triangle& t : ears) {
      mesh_.triangles.push_back(t);
      for (std::size_t c = 0; c < 3; ++c) {
        const Edge e = edge(t[c], t[(c + 1) % 3]);
        taken_.insert(e);
        open_.erase(e);
      }
    }
  }

  /// Whether the loop goes around a few triangles, all of whose corners are in it.
  bool is_patch(const std::vector<std::uint32_t>& loop) const {
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const std::uint32_t third = opposite_.at(edge(loop[i], loop[(i + 1) % loop.size()]));
      if (std::find(loop.begin(), loop.end(), third) == loop.end()) return false;
    }
    return true;
  }

  Scan& mesh_;
  const Patches& patches_;
  float reach_;
  Grid vertices_, edges_;
  std::vector<Edge> sorted_;                          ///< of the triangles that came in
  std::unordered_set<Edge> taken_;                    ///< of those that were added
  std::unordered_set<Edge> open_;                     ///< that a further triangle could have
  std::vector<Edge> listed_;                          ///< all that ever were open
  std::unordered_map<Edge, std::uint32_t> opposite_;  ///< of an open edge the third corner of its triangle
  std::unordered_map<std::uint32_t, int> holes_;      ///< open edges at a vertex
  std::priority_queue<Candidate> queue_;
};

/// Drops vertices that no triangle has.
void drop_unused(Scan& mesh) {
  std::vector<std::uint32_t> now(mesh.positions.size(), 0xffffffffu);
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t corner : t) now[corner] = 0;
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (now[i] != 0) continue;
    mesh.positions[count] = mesh.positions[i];
    mesh.normals[count] = mesh.normals[i];
    if (!mesh.colors.empty()) mesh.colors[count] = mesh.colors[i];
    now[i] = count++;
  }
  mesh.positions.resize(count);
  mesh.normals.resize(count);
  if (!mesh.colors.empty()) mesh.colors.resize(count);
  for (Triangle& t : mesh.triangles)
    for (std::uint32_t& corner : t) corner = now[corner];
}

}  // namespace

StitchCounts stitch(Scan& mesh, const Patches& patches) {
  StitchCounts counts;
  weld(mesh, patches, counts);
  drop_repeated(mesh, patches, counts);
  if (largest(patches.gap) > 0) counts.added_triangles = Stitcher(mesh, patches).run();
  drop_unused(mesh);
  return counts;
}

EdgeCounts count_edges(const Scan& mesh) {
  const std::vector<std::uint32_t> first = first_equal_vertices(mesh, false);
  std::vector<Triangle> triangles = mesh.triangles;
  for (Triangle& t : triangles)
    for (std::uint32_t& corner : t) corner = first[corner];
  const std::vector<Edge> edges = sorted_edges(triangles);
  EdgeCounts counts;
  const auto times = [&](Edge e) {
    const auto [first, last] = std::equal_range(edges.begin(), edges.end(), e);
    return last - first;
  };
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (i > 0 && edges[i] == edges[i - 1]) continue;
    const auto here = times(edges[i]), back = times(reversed(edges[i]));
    if (here + back == 1)
      ++counts.open;
    else if ((here != 1 || back != 1) && (back == 0 || from(edges[i]) < to(edges[i])))
      ++counts.non_manifold;
  }
  return counts;
}

}  // namespace rbvh
