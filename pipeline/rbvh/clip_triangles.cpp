// Sutherland & Hodgman, "Reentrant Polygon Clipping", CACM 1974, finds a triangle's part inside of the box.
// The rest is cut by ears. It gets no corner on an edge of the triangle that the box does not meet, so that
// what lies beyond such an edge need not be cut.
#include "pipeline/rbvh/clip_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

constexpr int kInner = -1, kCut = 3, kCorner = 3;

/// Of a triangle's part inside of the box.
struct Corner {
  Vec3d p;
  Vec3d weights;    ///< of the triangle's corners
  int on = kInner;  ///< 0 to 2: that edge of the triangle, kCorner + i: its corner i
  int out = 0;      ///< what leads to the next: 0 to 2: that edge, kCut: a face of the box
  int plane = 0;    ///< that made it
};
using Polygon = std::vector<Corner>;

bool is_before(Vec3d a, Vec3d b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); }

class BoxClip {
 public:
  BoxClip(const Bounds3d& box, const std::array<Vec3d, 3>& corners) : box_(box), corners_(corners) {}

  /// The part inside; empty: none.
  Polygon clip() const {
    Polygon polygon;
    for (int i = 0; i < 3; ++i) {
      Vec3d weights{};
      weights[i] = 1;
      polygon.push_back({corners_[static_cast<std::size_t>(i)], weights, kCorner + i, i, 0});
    }
    for (int plane = 0; plane < 6 && !polygon.empty(); ++plane) polygon = clip_at(polygon, plane);
    return polygon.size() < 3 ? Polygon() : polygon;
  }

 private:
  double value(int plane) const { return plane < 3 ? box_.lo[plane] : box_.hi[plane - 3]; }
  bool is_inside(Vec3d p, int plane) const {
    return plane < 3 ? p[plane] >= value(plane) : p[plane - 3] <= value(plane);
  }

  Polygon clip_at(const Polygon& from, int plane) const {
    Polygon to;
    for (std::size_t i = 0; i < from.size(); ++i) {
      const Corner &here = from[i], &next = from[(i + 1) % from.size()];
      const bool is_here = is_inside(here.p, plane), is_next = is_inside(next.p, plane);
      if (is_here) to.push_back(here);
      if (is_here == is_next) continue;
      const Corner crossing = cross_at(here, next, plane);
      if (is_here && crossing.p == here.p)
        to.back().out = kCut;
      else if (is_here || crossing.p != next.p)
        to.push_back(crossing);
      if (is_here) to.back().out = kCut;
    }
    return to;
  }

  /// On an edge of the triangle it depends on that edge's ends alone, in either order: so it is the same in
  /// the triangle beyond the edge.
  Corner cross_at(const Corner& here, const Corner& next, int plane) const {
    Corner a = here, b = next;
    const bool is_on_edge = here.out != kCut;
    if (is_on_edge) {
      const int edge = here.out, end = (edge + 1) % 3;
      a.p = corners_[static_cast<std::size_t>(edge)];
      b.p = corners_[static_cast<std::size_t>(end)];
      a.weights = b.weights = {};
      a.weights[edge] = b.weights[end] = 1;
    }
    if (is_before(b.p, a.p)) std::swap(a, b);
    const int axis = plane % 3;
    const double t = (value(plane) - a.p[axis]) / (b.p[axis] - a.p[axis]);
    Corner crossing{a.p + (b.p - a.p) * t, a.weights + (b.weights - a.weights) * t,
                    is_on_edge ? here.out : kInner, here.out, plane};
    crossing.p[axis] = value(plane);
    return crossing;
  }

  const Bounds3d& box_;
  const std::array<Vec3d, 3>& corners_;
};

/// Along the triangle's border from where the part inside leaves it to where it comes back: the triangle's
/// corners between.
std::vector<int> corners_between(const Corner& from, const Corner& to, const std::array<Vec3d, 3>& corners) {
  const int first = from.on >= kCorner ? (from.on - kCorner + 1) % 3 : (from.on + 1) % 3;
  const int last = to.on >= kCorner ? (to.on - kCorner + 2) % 3 : to.on;
  int count = (last - first + 4) % 3;
  if (count == 0 && from.on == to.on && from.on < kCorner) {
    const auto start = corners[static_cast<std::size_t>(from.on)];
    if (length(from.p - start) >= length(to.p - start)) count = 3;
  }
  std::vector<int> between(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) between[static_cast<std::size_t>(i)] = (first + i) % 3;
  return between;
}

/// The parts outside, as simple polygons (or such that touch themselves at a corner).
std::vector<Polygon> outer_loops(const Polygon& inside, const std::array<Vec3d, 3>& corners) {
  const auto corner = [&](int i) {
    Vec3d weights{};
    weights[i] = 1;
    return Corner{corners[static_cast<std::size_t>(i)], weights, kCorner + i, i, 0};
  };
  std::vector<Polygon> loops;
  const std::size_t n = inside.size();
  for (std::size_t s = 0; s < n; ++s) {
    if (inside[s].on == kInner || inside[s].out != kCut) continue;
    std::size_t steps = 1;
    while (inside[(s + steps) % n].on == kInner) ++steps;
    const std::size_t e = (s + steps) % n;
    Polygon& loop = loops.emplace_back();
    loop.push_back(inside[s]);
    for (const int i : corners_between(inside[s], inside[e], corners)) loop.push_back(corner(i));
    for (std::size_t k = steps; k > 0; --k) loop.push_back(inside[(s + k) % n]);
    if (loop.size() < 3) loops.pop_back();
  }
  const bool is_hole =
      std::all_of(inside.begin(), inside.end(), [](const Corner& c) { return c.on == kInner; });
  if (!is_hole) return loops;
  // A bridge from the nearest corner that sees a corner of the hole.
  const Vec3d normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
  double least = std::numeric_limits<double>::infinity();
  int from = 0;
  std::size_t to = 0;
  for (int i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < n; ++k) {
      const Vec3d p = corners[static_cast<std::size_t>(i)], here = inside[k].p;
      const auto is_beyond = [&](const Vec3d& a, const Vec3d& b) {
        return dot(cross(b - a, p - a), normal) < 0;
      };
      if (!is_beyond(here, inside[(k + 1) % n].p) && !is_beyond(inside[(k + n - 1) % n].p, here)) continue;
      if (const double distance = length(p - here); distance < least) {
        least = distance;
        from = i;
        to = k;
      }
    }
  Polygon loop;
  for (int i = 0; i <= 3; ++i) loop.push_back(corner((from + i) % 3));
  for (std::size_t k = 0; k <= n; ++k) loop.push_back(inside[(to + n - k % n) % n]);
  return {loop};
}

/// A polygon as triangles (Meisters 1975), corners by number.
std::vector<std::array<std::size_t, 3>> cut_ears(const Polygon& loop, Vec3d normal) {
  std::vector<std::size_t> left(loop.size());
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = i;
  const auto area = [&](std::size_t a, std::size_t b, std::size_t c) {
    return dot(cross(loop[b].p - loop[a].p, loop[c].p - loop[a].p), normal);
  };
  std::vector<std::array<std::size_t, 3>> triangles;
  while (left.size() > 3) {
    const std::size_t n = left.size();
    std::size_t best = n;
    double best_shape = -1;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
      const double size = area(a, b, c);
      if (!(size > 0)) continue;
      const bool is_free = std::none_of(left.begin(), left.end(), [&](std::size_t k) {
        const Vec3d p = loop[k].p;
        if (p == loop[a].p || p == loop[b].p || p == loop[c].p) return false;
        return area(a, b, k) >= 0 && area(b, c, k) >= 0 && area(c, a, k) >= 0;
      });
      // The fattest ear, by its area to that of a square on its longest side.
      const double longest = std::max(
          {length(loop[b].p - loop[a].p), length(loop[c].p - loop[b].p), length(loop[a].p - loop[c].p)});
      const double shape = (is_free ? 1 : 0) + std::min(0.5, size / (longest * longest * length(normal)));
      if (shape > best_shape) {
        best_shape = shape;
        best = i;
      }
    }
    if (best == n) break;  // what is left has no area
    triangles.push_back({left[(best + n - 1) % n], left[best], left[(best + 1) % n]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
  }
  if (left.size() == 3) triangles.push_back({left[0], left[1], left[2]});
  return triangles;
}

/// Collects the triangles that are kept.
class Clipper {
 public:
  Clipper(Scan& mesh, const Bounds3d& box, BoxSide side, const Lattice& lattice, std::vector<CutEdge>* cuts)
      : mesh_(mesh), box_(box), side_(side), lattice_(lattice), cuts_(cuts) {
    for (int axis = 0; axis < 3; ++axis) {
      wide_.lo[axis] = std::nextafter(static_cast<float>(box.lo[axis]), std::numeric_limits<float>::lowest());
      wide_.hi[axis] = std::nextafter(static_cast<float>(box.hi[axis]), std::numeric_limits<float>::max());
    }
  }

  std::vector<std::uint32_t> run() {
    const std::vector<Triangle> triangles = std::exchange(mesh_.triangles, {});
    const std::vector<std::int32_t> objects = std::exchange(mesh_.object_ids, {});
    const std::vector<FaceTexture> textures = std::exchange(mesh_.face_textures, {});
    has_textures_ = !textures.empty();
    mesh_.triangles.reserve(triangles.size());
    origins_.reserve(triangles.size());
    for (std::uint32_t i = 0; i < triangles.size(); ++i) {
      if (is_beside(triangles[i])) {
        if (side_ != BoxSide::kInside) keep(i, triangles[i], has_textures_ ? textures[i] : FaceTexture{});
      } else {
        add(i, triangles[i], has_textures_ ? textures[i] : FaceTexture{});
      }
      if (!objects.empty()) mesh_.object_ids.resize(mesh_.triangles.size(), objects[i]);
    }
    if (!textures.empty()) mesh_.face_textures = std::move(textures_);
    return std::move(origins_);
  }

 private:
  void keep(std::uint32_t number, const Triangle& t, const FaceTexture& texture) {
    mesh_.triangles.push_back(t);
    if (has_textures_) textures_.push_back(texture);
    origins_.push_back(number);
  }

  /// Most are: told in floats.
  bool is_beside(const Triangle& t) const {
    const Vec3f &a = mesh_.positions[t[0]], &b = mesh_.positions[t[1]], &c = mesh_.positions[t[2]];
    for (int axis = 0; axis < 3; ++axis)
      if (std::max({a[axis], b[axis], c[axis]}) < wide_.lo[axis] ||
          std::min({a[axis], b[axis], c[axis]}) > wide_.hi[axis])
        return true;
    return false;
  }

  void add(std::uint32_t number, const Triangle& t, const FaceTexture& texture) {
    const std::array<Vec3d, 3> corners = {Vec3d(mesh_.positions[t[0]]), Vec3d(mesh_.positions[t[1]]),
                                          Vec3d(mesh_.positions[t[2]])};
    Bounds3d own;
    for (const Vec3d& p : corners) own.add(p);
    const Polygon inside = overlap(own, box_) ? BoxClip(box_, corners).clip() : Polygon();
    const bool is_all =
        std::none_of(inside.begin(), inside.end(), [](const Corner& c) { return c.out == kCut; });
    if (inside.empty() || is_all) {
      const BoxSide where = inside.empty() ? BoxSide::kOutside : BoxSide::kInside;
      if (side_ == where || side_ == BoxSide::kBoth) keep(number, t, texture);
      return;
    }
    const Vec3d normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
    std::vector<Polygon> loops;
    if (side_ != BoxSide::kInside) loops = outer_loops(inside, corners);
    if (side_ != BoxSide::kOutside) loops.push_back(inside);
    for (const Polygon& loop : loops) {
      std::vector<std::uint32_t> vertices;
      for (const Corner& corner : loop) vertices.push_back(vertex(t, corner));
      for (const auto& [a, b, c] : cut_ears(loop, normal)) {
        const Triangle part = {vertices[a], vertices[b], vertices[c]};
        if (!has_area(part)) continue;
        FaceTexture own_texture = texture;
        const std::array<std::size_t, 3> parts = {a, b, c};
        for (std::size_t k = 0; k < 3; ++k)
          for (std::size_t axis = 0; axis < 2; ++axis) {
            double sum = 0;
            for (int i = 0; i < 3; ++i)
              sum += loop[parts[k]].weights[i] *
                     static_cast<double>(texture.corners[static_cast<std::size_t>(i)][axis]);
            own_texture.corners[k][axis] = static_cast<float>(sum);
          }
        keep(number, part, own_texture);
      }
    }
    if (cuts_ != nullptr) note_cuts(number, t, inside);
    inner_.clear();
  }

  void note_cuts(std::uint32_t number, const Triangle& t, const Polygon& inside) {
    for (std::size_t i = 0; i < inside.size(); ++i) {
      if (inside[i].out != kCut) continue;
      std::uint32_t a = vertex(t, inside[i]), b = vertex(t, inside[(i + 1) % inside.size()]);
      if (side_ == BoxSide::kOutside) std::swap(a, b);
      if (mesh_.positions[a] != mesh_.positions[b]) cuts_->push_back({a, b, number});
    }
  }

  bool has_area(const Triangle& t) const {
    const auto p = [&](std::size_t i) { return Vec3d(mesh_.positions[t[i]]); };
    return cross(p(1) - p(0), p(2) - p(0)) != Vec3d{};
  }

  std::uint32_t vertex(const Triangle& t, const Corner& corner) {
    if (corner.on >= kCorner) return t[static_cast<std::size_t>(corner.on - kCorner)];
    if (corner.on == kInner) {
      for (const auto& [p, number] : inner_)
        if (p == corner.p) return number;
      return inner_.emplace_back(corner.p, make_vertex(t, corner)).second;
    }
    const std::uint32_t a = t[static_cast<std::size_t>(corner.on)],
                        b = t[static_cast<std::size_t>((corner.on + 1) % 3)];
    const auto [place, is_new] = on_edges_.try_emplace({std::min(a, b), std::max(a, b), corner.plane}, 0u);
    if (is_new) place->second = make_vertex(t, corner);
    return place->second;
  }

  std::uint32_t make_vertex(const Triangle& t, const Corner& corner) {
    const auto mean = [&](auto&& value) {
      Vec3d sum{};
      for (int i = 0; i < 3; ++i)
        sum = sum + Vec3d(value(t[static_cast<std::size_t>(i)])) * corner.weights[i];
      return sum;
    };
    mesh_.positions.push_back(snapped(lattice_, Vec3f(corner.p)));
    if (!mesh_.normals.empty()) {
      const auto n = Vec3f(normalized(mean([&](std::uint32_t v) { return mesh_.normals[v]; })));
      mesh_.normals.push_back(lattice_.step > 0 ? unpack_normal(pack_normal(n)) : n);
    }
    if (!mesh_.colors.empty()) {
      const Vec3d c = mean([&](std::uint32_t v) {
        const Color8& of = mesh_.colors[v];
        return Vec3d{static_cast<double>(of[0]), static_cast<double>(of[1]), static_cast<double>(of[2])};
      });
      const auto byte = [](double x) { return static_cast<std::uint8_t>(std::clamp(x + 0.5, 0.0, 255.0)); };
      mesh_.colors.push_back({byte(c.x), byte(c.y), byte(c.z)});
    }
    for (ScalarProperty& property : mesh_.properties)
      property.values.push_back(static_cast<float>(mean([&](std::uint32_t v) {
                                                     return Vec3f{property.values[v], 0, 0};
                                                   }).x));
    return static_cast<std::uint32_t>(mesh_.positions.size() - 1);
  }

  Scan& mesh_;
  const Bounds3d& box_;
  BoxSide side_;
  const Lattice& lattice_;
  std::vector<CutEdge>* cuts_;
  Bounds3f wide_;  ///< the box, not smaller
  bool has_textures_ = false;
  std::vector<std::uint32_t> origins_;
  std::vector<FaceTexture> textures_;
  /// Of vertices on an edge: its ends and the box's face.
  std::map<std::tuple<std::uint32_t, std::uint32_t, int>, std::uint32_t> on_edges_;
  std::vector<std::pair<Vec3d, std::uint32_t>> inner_;  ///< of the triangle at hand
};

}  // namespace

std::vector<std::uint32_t> clip_triangles(Scan& mesh, const Bounds3d& box, BoxSide side,
                                          const Lattice& lattice, std::vector<CutEdge>* cuts) {
  return Clipper(mesh, box, side, lattice, cuts).run();
}

}  // namespace rbvh
