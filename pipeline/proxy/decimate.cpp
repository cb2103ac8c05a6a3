#include "pipeline/proxy/decimate.h"

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/Utils/Property.hh>
// QuadricT.hh does not include what it needs: it comes after the mesh.
#include <OpenMesh/Core/Geometry/QuadricT.hh>
#include <OpenMesh/Tools/Decimater/CollapseInfoT.hh>
#include <algorithm>
#include <cmath>
#include <queue>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  VertexAttributes(OpenMesh::Attributes::Status);
  EdgeAttributes(OpenMesh::Attributes::Status);
  FaceAttributes(OpenMesh::Attributes::Status);
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;
using CollapseInfo = OpenMesh::Decimater::CollapseInfoT<Mesh>;
using Quadric = OpenMesh::Geometry::QuadricT<double>;
using OmPoint = OpenMesh::Vec3d;

Vec3d vec(const OmPoint& p) { return {p[0], p[1], p[2]}; }

// What follows was chosen on the Stanford dragon at 3,000 patches (docs/proxy.md): the error of the bake, the
// bytes of its map and the stretch of its texels.

// Flat areas have no error at all: there, triangles that keep near to their place come out well shaped.
constexpr double kPlaceWeight = 0.05;
// Boundary edges keep their shape by planes through them, perpendicular to the surface.
constexpr double kBoundaryWeight = 4;

/// What a step must leave in order. Later rounds are less strict, so that the target is reached.
struct Strictness {
  double least_cosine;    ///< between a triangle's normals before and after
  double least_shape;     ///< 1 is equilateral; or no worse than before
  double least_flat;      ///< of the step's map, see SelfMap::lies_flat()
  unsigned most_valence;  ///< of the vertex that stays
};
constexpr Strictness kRounds[] = {{0.5, 0.5, 0.2, 9}, {-0.5, 0.01, 0.001, 24}};
constexpr Strictness kLastRound = {-2, 0, 0, 200};  ///< anything that keeps a surface a surface

double shape_of(const OmPoint& a, const OmPoint& b, const OmPoint& c) {
  const double sides = (b - a).sqrnorm() + (c - b).sqrnorm() + (a - c).sqrnorm();
  return sides > 0 ? 2 * std::sqrt(3.0) * ((b - a) % (c - a)).norm() / sides : 0;
}

using Vertex = Mesh::VertexHandle;
using Halfedge = Mesh::HalfedgeHandle;
using Face = Mesh::FaceHandle;

std::size_t index(Vertex v) { return static_cast<std::size_t>(v.idx()); }

/// A step that is waiting: `from` is drawn onto a neighbour. Out of date once the vertex's stamp has moved
/// on.
struct Waiting {
  float error;
  std::uint32_t from, stamp;
  std::int32_t halfedge;  ///< that was found to be legal, or -1: not looked at yet
  // Smallest error on top; equal ones by number, so that the order is always the same.
  bool operator<(const Waiting& b) const { return error != b.error ? error > b.error : from > b.from; }
};

}  // namespace

// OpenMesh's own decimater looks at the legality of every step around a vertex whenever a neighbour changes;
// here errors alone are kept up to date, and legality is tested when a step is about to be taken: four times
// as fast.
struct Decimation::State {
  Mesh mesh;
  SelfMap map;
  std::vector<std::uint32_t> version,
      first_vertex;  ///< of each face: its version, and that one's first corner
  std::vector<Quadric> quadrics;
  std::vector<std::uint32_t> stamps;
  std::vector<std::uint16_t> valences;  ///< OpenMesh would count them anew each time
  std::priority_queue<Waiting> queue;
  Strictness strictness = kRounds[0];
  double max_error = 0;
  std::uint64_t live_triangles = 0;
  // Of the vertex at hand:
  std::vector<std::pair<float, Halfedge>> candidates;
  std::vector<Vec3d> ring;
  std::vector<Vertex> ring_vertices;
  std::vector<StarFace> star;
  std::vector<Face> star_faces;

  explicit State(std::uint32_t triangles) : map(triangles) {}

  void add_quadrics() {
    quadrics.assign(mesh.n_vertices(), Quadric());
    for (const Face f : mesh.faces()) {
      auto corner = mesh.cfv_iter(f);
      const Vertex v[3] = {*corner, *++corner, *++corner};
      const OmPoint p = mesh.point(v[0]);
      OmPoint n = (mesh.point(v[1]) - p) % (mesh.point(v[2]) - p);
      const double twice = n.norm();
      if (!(twice > 0)) continue;
      n /= twice;
      const Quadric plane(n[0], n[1], n[2], -(p | n));
      for (const Vertex each : v) {
        const Quadric place(mesh.point(each));
        quadrics[index(each)] += plane * (twice / 6);
        quadrics[index(each)] += place * (twice / 6 * kPlaceWeight);
      }
      add_boundary(f, n);
    }
  }

  void add_boundary(Face f, const OmPoint& n) {
    for (const Halfedge h : mesh.fh_range(f)) {
      if (!mesh.is_boundary(mesh.opposite_halfedge_handle(h))) continue;
      const Vertex a = mesh.from_vertex_handle(h), b = mesh.to_vertex_handle(h);
      const OmPoint along = mesh.point(b) - mesh.point(a);
      OmPoint upright = along % n;
      const double size = upright.norm();
      if (!(size > 0)) continue;
      upright /= size;
      const Quadric plane = Quadric(upright[0], upright[1], upright[2], -(mesh.point(a) | upright)) *
                            (kBoundaryWeight * along.sqrnorm());
      quadrics[index(a)] += plane;
      quadrics[index(b)] += plane;
    }
  }

  /// All steps of `v` whose error is allowed, the least first.
  void find_candidates(Vertex v) {
    candidates.clear();
    for (const Halfedge h : mesh.voh_range(v)) {
      Quadric q = quadrics[index(v)];
      const Vertex to = mesh.to_vertex_handle(h);
      q += quadrics[index(to)];
      const double error = std::max(0.0, q(mesh.point(to)));
      if (error <= max_error * max_error * (q.a() + q.e() + q.h()))
        candidates.emplace_back(static_cast<float>(error), h);
    }
  }
  void enqueue(Vertex v) {
    const std::uint32_t stamp = ++stamps[index(v)];
    find_candidates(v);
    if (candidates.empty()) return;
    const float least = std::min_element(candidates.begin(), candidates.end())->first;
    queue.push({least, static_cast<std::uint32_t>(v.idx()), stamp, -1});
  }

  bool keeps_surface(const CollapseInfo& step) {
    if (!mesh.is_collapse_ok(step.v0v1)) return false;
    // Two triangles back to back would be left.
    if (step.vl.is_valid() && step.vr.is_valid() && mesh.valence(step.vl) == 3 &&
        mesh.valence(step.vr) == 3 && mesh.find_halfedge(step.vl, step.vr).is_valid())
      return false;
    if (mesh.is_boundary(step.v0) &&
        (!mesh.is_boundary(step.v1) || (step.vl.is_valid() && step.vr.is_valid())))
      return false;
    return valences[index(step.v0)] >= 3;
  }
  bool keeps_shape(const CollapseInfo& step) {
    if (strictness.least_flat <= 0) return true;
    if (valences[index(step.v0)] + valences[index(step.v1)] > strictness.most_valence + 4) return false;
    double worst_before = 1, worst_after = 1;
    for (const Halfedge h : mesh.voh_range(step.v0)) {
      if (mesh.is_boundary(h)) continue;
      const Vertex a = mesh.to_vertex_handle(h), b = mesh.to_vertex_handle(mesh.next_halfedge_handle(h));
      const OmPoint &pa = mesh.point(a), &pb = mesh.point(b);
      worst_before = std::min(worst_before, shape_of(step.p0, pa, pb));
      if (a == step.v1 || b == step.v1) continue;
      const OmPoint before = (pa - step.p0) % (pb - step.p0), after = (pa - step.p1) % (pb - step.p1);
      const double size = std::sqrt(before.sqrnorm() * after.sqrnorm());
      if (size > 0 && (before | after) < strictness.least_cosine * size) return false;
      worst_after = std::min(worst_after, shape_of(step.p1, pa, pb));
    }
    if (worst_after < strictness.least_shape && worst_after < worst_before) return false;
    return true;
  }
  bool lies_flat(const CollapseInfo& step) {
    if (strictness.least_flat <= 0) return true;
    gather_ring(step);
    return SelfMap::lies_flat(vec(step.p0), ring, star_faces.size() < ring.size(), fan_from(step),
                              strictness.least_flat);
  }

  /// The neighbours of v0, counter-clockwise: from v1, or on the boundary from one end to the other.
  void gather_ring(const CollapseInfo& step) {
    ring.clear();
    ring_vertices.clear();
    star.clear();
    star_faces.clear();
    Halfedge first = step.v0v1;
    if (mesh.is_boundary(step.v0))
      first = mesh.opposite_halfedge_handle(mesh.prev_halfedge_handle(mesh.halfedge_handle(step.v0)));
    for (Halfedge h = first;;) {
      const Vertex v = mesh.to_vertex_handle(h);
      ring_vertices.push_back(v);
      ring.push_back(vec(mesh.point(v)));
      if (mesh.is_boundary(h)) break;
      const Face f = mesh.face_handle(h);
      const auto at = static_cast<std::size_t>(f.idx());
      const std::uint32_t start = first_vertex[at];
      const std::uint32_t corner = start == index(step.v0) ? 0 : start == index(v) ? 2 : 1;
      star.push_back({version[at], corner});
      star_faces.push_back(f);
      h = mesh.opposite_halfedge_handle(mesh.prev_halfedge_handle(h));
      if (h == first) break;
    }
  }

  std::uint32_t fan_from(const CollapseInfo& step) const {
    return ring_vertices.front() == step.v1 ? 0 : static_cast<std::uint32_t>(ring.size() - 1);
  }

  void take(const CollapseInfo& step) {
    gather_ring(step);
    const std::size_t faces = star_faces.size(), n = ring_vertices.size();
    std::uint32_t next = map.remove_vertex(
        vec(step.p0), ring, star, ring_vertices.front() == step.v1 ? 0 : static_cast<std::uint32_t>(n - 1));
    for (std::size_t i = 0; i < faces; ++i) {
      if (ring_vertices[i] == step.v1 || ring_vertices[(i + 1) % n] == step.v1) continue;
      const auto f = static_cast<std::size_t>(star_faces[i].idx());
      version[f] = next++;
      first_vertex[f] = static_cast<std::uint32_t>(step.v1.idx());
    }
    live_triangles -= faces == n ? 2 : 1;
    quadrics[index(step.v1)] += quadrics[index(step.v0)];
    ++stamps[index(step.v0)];
    mesh.collapse(step.v0v1);
    for (const Vertex v : {step.vl, step.vr})
      if (v.is_valid()) --valences[index(v)];
    valences[index(step.v1)] = static_cast<std::uint16_t>(mesh.valence(step.v1));
    for (const Vertex v : ring_vertices) enqueue(v);
  }

  /// The next step in order of error is taken, or the vertex at the queue's head waits for its next best.
  bool advance() {
    const Waiting head = queue.top();
    queue.pop();
    if (head.stamp != stamps[head.from]) return false;
    const Vertex v(static_cast<int>(head.from));
    if (head.halfedge >= 0) {
      const CollapseInfo step(mesh, Halfedge(head.halfedge));
      // What lies two edges away may have changed since.
      if (keeps_surface(step)) {
        take(step);
        return true;
      }
    }
    find_candidates(v);
    std::sort(candidates.begin(), candidates.end());
    for (const auto& [error, halfedge] : candidates) {
      const CollapseInfo step(mesh, halfedge);
      if (!keeps_shape(step) || !keeps_surface(step) || !lies_flat(step)) continue;
      if (error <= head.error) {
        take(step);
        return true;
      }
      queue.push({error, head.from, head.stamp, halfedge.idx()});
      return false;
    }
    return false;  // until a neighbour changes
  }
};

Decimation::Decimation(const Manifold& mesh, const std::string& file)
    : state_(std::make_unique<State>(static_cast<std::uint32_t>(mesh.triangles.size()))) {
  State& s = *state_;
  s.mesh.reserve(mesh.positions.size(), mesh.positions.size() + mesh.triangles.size() + 16,
                 mesh.triangles.size());
  for (const Vec3f& p : mesh.positions) s.mesh.add_vertex(OmPoint(p.x, p.y, p.z));
  for (const Triangle& t : mesh.triangles) {
    const Face f = s.mesh.add_face(Vertex(static_cast<int>(t[0])), Vertex(static_cast<int>(t[1])),
                                   Vertex(static_cast<int>(t[2])));
    if (!f.is_valid())
      throw Error(ErrorKind::kInput, file, "has triangles that do not form a surface; clean the mesh first");
    s.version.push_back(static_cast<std::uint32_t>(f.idx()));
    s.first_vertex.push_back(t[0]);
  }
  s.live_triangles = mesh.triangles.size();
  s.stamps.assign(mesh.positions.size(), 0);
  s.add_quadrics();
  s.valences.resize(mesh.positions.size());
  for (const Vertex v : s.mesh.vertices())
    s.valences[index(v)] = static_cast<std::uint16_t>(s.mesh.valence(v));
}

Decimation::~Decimation() = default;

void Decimation::run(std::uint64_t triangles, double max_error, const Progress& progress) {
  State& s = *state_;
  s.max_error = max_error;
  const std::uint64_t start = s.live_triangles;
  const auto run_round = [&](const Strictness& round) {
    s.strictness = round;
    s.queue = {};
    for (const Vertex v : s.mesh.vertices())
      if (!s.mesh.status(v).deleted()) s.enqueue(v);
    for (std::uint64_t steps = 0; s.live_triangles > triangles && !s.queue.empty();)
      if (s.advance() && ++steps % 16384 == 0)
        report(progress, "decimating",
               static_cast<double>(start - s.live_triangles) / static_cast<double>(start - triangles));
  };
  // An error, once reached, is no reason to spoil shapes.
  if (triangles == 0) return run_round(kRounds[0]);
  for (const Strictness& round : kRounds) run_round(round);
  run_round(kLastRound);
}

std::uint64_t Decimation::triangle_count() const { return state_->live_triangles; }

BaseMesh Decimation::base() const {
  const State& s = *state_;
  BaseMesh base;
  std::vector<std::uint32_t> number(s.mesh.n_vertices(), UINT32_MAX);
  for (std::size_t f = 0; f < s.mesh.n_faces(); ++f) {
    const Mesh::FaceHandle face(static_cast<int>(f));
    if (s.mesh.status(face).deleted()) continue;
    Triangle triangle{};
    std::size_t at = 0, first = 0;
    for (const Mesh::VertexHandle v : s.mesh.fv_range(face)) {
      const auto vertex = static_cast<std::uint32_t>(v.idx());
      if (vertex == s.first_vertex[f]) first = at;
      triangle[at++] = vertex;
    }
    std::rotate(triangle.begin(), triangle.begin() + static_cast<std::ptrdiff_t>(first), triangle.end());
    for (std::uint32_t& vertex : triangle) {
      std::uint32_t& n = number[vertex];
      if (n == UINT32_MAX) {
        n = static_cast<std::uint32_t>(base.positions.size());
        base.positions.push_back(Vec3f(vec(s.mesh.point(Mesh::VertexHandle(static_cast<int>(vertex))))));
      }
      vertex = n;
    }
    base.triangles.push_back(triangle);
    base.versions.push_back(s.version[f]);
  }
  return base;
}

SelfMap Decimation::finish() {
  SelfMap map = std::move(state_->map);
  state_.reset();
  return map;
}

}  // namespace rbvh
