#include "pipeline/scan/collapse_edges.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <queue>
#include <span>
#include <utility>

#include "pipeline/scan/quadric.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
/// The cosine between the normals of two faces below which their edge is sharp, and that of half the angle:
/// no edge is sharp where all normals are that near to one of them.
constexpr double kSharp = 0.64, kHalfSharp = 0.9055;
/// Between a triangle's normals before a step and after it, at least.
constexpr double kLeastCosine = 0.2;
/// Triangles at a vertex, at most, unless the scan has more.
constexpr std::size_t kMostTriangles = 24;
/// Of the error: what a step across the whole mesh counts beside its own, for flat areas to keep their shape.
constexpr double kLengthWeight = 0.02;
/// Of a vertex's weight, what holds it to its place when it is moved to where its error is least.
constexpr double kPlaceWeight = 0.01;
/// It moves less than so much of the error, and turns triangles less (cosine).
constexpr double kMostMove = 4, kLeastTurn = 0.5;

/// Of the angle; 0 where one of them is.
double cosine(Vec3d a, Vec3d b) {
  const double sizes = dot(a, a) * dot(b, b);
  return sizes > 0 ? dot(a, b) / std::sqrt(sizes) : 0;
}

/// A vertex that waits to be drawn onto `to`.
struct Step {
  float cost;
  std::uint32_t from, to, stamp;
  // The least cost on top; equal ones by number, so that the order is always the same.
  bool operator<(const Step& b) const { return cost != b.cost ? cost > b.cost : from > b.from; }
};

struct Candidate {
  float cost;
  std::uint32_t to;
  auto operator<=>(const Candidate&) const = default;  // NOLINT(modernize-use-nullptr)
};

class Collapse {
 public:
  Collapse(CollapseMesh& mesh, float error)
      : mesh_(mesh), most_(static_cast<double>(error) * static_cast<double>(error)) {}

  void run() {
    Bounds3f box;
    for (const Vec3f& p : mesh_.places) box.add(p);
    middle_ = (box.lo + box.hi) * 0.5f;
    at_.reserve(mesh_.places.size());
    for (const Vec3f& p : mesh_.places) at_.push_back(static_cast<Vec3d>(p - middle_));
    length_weight_ = kLengthWeight * most_ / std::max(1e-30, static_cast<double>(box.diagonal()));
    list_triangles();
    add_faces();
    find_feature_edges();
    stamps_.assign(at_.size(), 0);
    marks_.assign(at_.size(), 0);
    waits_for_.assign(at_.size(), {0, kNone});
    has_more_.assign(at_.size(), 0);
    for (std::uint32_t v = 0; v < at_.size(); ++v) enqueue(v);
    while (!queue_.empty()) advance();
    for (std::uint32_t v = 0; v < at_.size(); ++v)
      if (has_more_[v] != 0 && lists_[v].count > 0) settle(v);
    drop_dead();
  }

 private:
  struct List {
    std::uint32_t begin = 0, count = 0;
  };

  std::span<std::uint32_t> triangles_at(std::uint32_t v) {
    return std::span(arena_).subspan(lists_[v].begin, lists_[v].count);
  }
  Triangle& triangle(std::uint32_t t) { return mesh_.triangles[t]; }
  static std::size_t corner_of(const Triangle& t, std::uint32_t v) {
    return t[0] == v ? 0 : t[1] == v ? 1 : t[2] == v ? 2 : 3;
  }

  void list_triangles() {
    lists_.resize(at_.size());
    for (const Triangle& t : mesh_.triangles)
      for (const std::uint32_t v : t) ++lists_[v].count;
    std::uint32_t begin = 0;
    for (List& list : lists_) {
      list.begin = begin;
      begin += std::exchange(list.count, 0);
    }
    arena_.resize(begin);
    for (std::uint32_t i = 0; i < mesh_.triangles.size(); ++i)
      for (const std::uint32_t v : mesh_.triangles[i]) arena_[lists_[v].begin + lists_[v].count++] = i;
    is_dead_.assign(mesh_.triangles.size(), 0);
    arena_.reserve(3 * arena_.size());
  }

  Vec3d area_normal(const Triangle& t) const { return cross(at_[t[1]] - at_[t[0]], at_[t[2]] - at_[t[0]]); }

  void add_faces() {
    faces_.resize(at_.size());
    normals_.reserve(mesh_.triangles.size());
    for (const Triangle& t : mesh_.triangles) {
      const Vec3d n = area_normal(t);
      const double twice = length(n);
      const Vec3d unit = twice > 0 ? n * (1 / twice) : Vec3d{};
      normals_.push_back(static_cast<Vec3f>(unit));
      if (!(twice > 0)) continue;
      const Quadric plane = plane_quadric(unit, at_[t[0]], twice);
      for (const std::uint32_t v : t) faces_[v] += plane;
    }
  }

  /// One of a vertex's edges, as a triangle has it.
  struct Spoke {
    std::uint32_t to, triangle;
    bool leads;                                      ///< from the vertex, else to it
    auto operator<=>(const Spoke&) const = default;  // NOLINT(modernize-use-nullptr)
  };

  /// Those of one edge are consecutive.
  void find_spokes(std::uint32_t v) {
    spokes_.clear();
    for (const std::uint32_t i : triangles_at(v)) {
      const Triangle& t = triangle(i);
      const std::size_t c = corner_of(t, v);
      spokes_.push_back({t[(c + 1) % 3], i, true});
      spokes_.push_back({t[(c + 2) % 3], i, false});
    }
    std::sort(spokes_.begin(), spokes_.end());
  }
  template <class Visit>
  void for_each_edge(Visit&& visit) const {
    for (std::size_t begin = 0, end = 0; begin < spokes_.size(); begin = end) {
      while (end < spokes_.size() && spokes_[end].to == spokes_[begin].to) ++end;
      visit(std::span(spokes_).subspan(begin, end - begin));
    }
  }

  /// Whether as many triangles go one way along the edge as the other.
  static bool is_inner(std::span<const Spoke> edge) {
    return 2 * std::count_if(edge.begin(), edge.end(), [](const Spoke& s) { return s.leads; }) ==
           static_cast<std::ptrdiff_t>(edge.size());
  }

  /// Whether no edge at the vertex can be a feature edge, told without looking at each.
  bool is_smooth(std::uint32_t v) {
    const auto mixed = [](std::uint64_t vertex) {
      vertex = (vertex + 1) * 0x9e3779b97f4a7c15u;
      return (vertex ^ (vertex >> 32)) * 0xd6e8feb86659fd93u;
    };
    const std::span<const std::uint32_t> own = triangles_at(v);
    if (own.empty()) return true;
    const Vec3f normal = normals_[own[0]];
    const std::uint32_t vertex = mesh_.vertices[own[0]][corner_of(triangle(own[0]), v)];
    std::uint64_t around = 0;  // 0: each neighbour follows one and precedes one
    for (const std::uint32_t i : own) {
      const Triangle& t = triangle(i);
      const std::size_t c = corner_of(t, v);
      around += mixed(t[(c + 1) % 3]) - mixed(t[(c + 2) % 3]);
      if (mesh_.vertices[i][c] != vertex || !(dot(normals_[i], normal) > static_cast<float>(kHalfSharp)))
        return false;
    }
    return around == 0;
  }

  void find_feature_edges() {
    feature_of_.assign(at_.size(), kNone);
    is_boundary_.assign(at_.size(), 0);
    for (std::uint32_t v = 0; v < at_.size(); ++v) {
      if (is_smooth(v)) continue;
      find_spokes(v);
      std::size_t open = 0;
      for_each_edge([&](std::span<const Spoke> edge) {
        const bool inner = is_inner(edge);
        if (!inner) ++open;
        if (v < edge.front().to && (!inner || is_sharp(v, edge))) add_feature_edge(v, edge.front().to);
      });
      if (open > 0) is_boundary_[v] = 1;
      if (open > 2) mesh_.stays[v] = 1;
    }
  }

  /// Also where attributes differ.
  bool is_sharp(std::uint32_t v, std::span<const Spoke> edge) {
    if (edge.size() != 2) return false;
    const std::uint32_t i = edge[0].triangle, j = edge[1].triangle;
    const auto differ = [&](std::uint32_t place) {
      return mesh_.vertices[i][corner_of(triangle(i), place)] !=
             mesh_.vertices[j][corner_of(triangle(j), place)];
    };
    return dot(normals_[i], normals_[j]) < static_cast<float>(kSharp) || differ(v) || differ(edge[0].to);
  }

  void add_feature_edge(std::uint32_t a, std::uint32_t b) {
    const Vec3d along = at_[b] - at_[a];
    const double size = length(along);
    if (!(size > 0)) return;
    const Quadric line = line_quadric(along * (1 / size), at_[a], size);
    for (const std::uint32_t v : {a, b}) feature_quadric(v) += line;
  }
  Quadric& feature_quadric(std::uint32_t v) {
    if (feature_of_[v] == kNone) {
      feature_of_[v] = static_cast<std::uint32_t>(features_.size());
      features_.emplace_back();
    }
    return features_[feature_of_[v]];
  }

  /// The squared error of drawing `from` onto `to`.
  double error_of(std::uint32_t from, std::uint32_t to) const {
    const double face = faces_[from].at(at_[to]);
    return feature_of_[from] == kNone ? face : std::max(face, features_[feature_of_[from]].at(at_[to]));
  }

  /// All its neighbours, each once.
  void find_neighbors(std::uint32_t v) {
    neighbors_.clear();
    ++mark_;
    marks_[v] = mark_;
    for (const std::uint32_t i : triangles_at(v))
      for (const std::uint32_t other : triangle(i))
        if (std::exchange(marks_[other], mark_) != mark_) neighbors_.push_back(other);
  }

  std::optional<Candidate> candidate(std::uint32_t v, std::uint32_t to) const {
    const double error = error_of(v, to);
    if (!(error <= most_)) return {};
    return Candidate{static_cast<float>(error + length_weight_ * length(at_[to] - at_[v])), to};
  }

  void find_candidates(std::uint32_t v) {
    candidates_.clear();
    if (mesh_.stays[v] != 0) return;
    find_neighbors(v);
    for (const std::uint32_t to : neighbors_) {
      if (is_boundary_[v] != 0 && is_boundary_[to] == 0) continue;
      if (const std::optional<Candidate> here = candidate(v, to)) candidates_.push_back(*here);
    }
  }

  void wait_for(std::uint32_t v, const Candidate& candidate) {
    waits_for_[v] = candidate;
    queue_.push({candidate.cost, v, candidate.to, ++stamps_[v]});
  }
  void wait_no_more(std::uint32_t v) {
    waits_for_[v].to = kNone;
    ++stamps_[v];
  }

  void enqueue(std::uint32_t v) {
    find_candidates(v);
    if (candidates_.empty()) return wait_no_more(v);
    wait_for(v, *std::min_element(candidates_.begin(), candidates_.end()));
  }

  /// After `from` was drawn onto `to`, a neighbour of theirs.
  void update(std::uint32_t v, std::uint32_t from, std::uint32_t to) {
    const Candidate& best = waits_for_[v];
    if (best.to == kNone || best.to == from || best.to == to) return enqueue(v);
    if (mesh_.stays[v] != 0 || (is_boundary_[v] != 0 && is_boundary_[to] == 0)) return;
    const std::optional<Candidate> here = candidate(v, to);
    if (here && *here < best) wait_for(v, *here);
  }

  void advance() {
    const Step step = queue_.top();
    queue_.pop();
    if (step.stamp != stamps_[step.from]) return;
    if (is_legal(step.from, step.to)) return take(step.from, step.to);
    find_candidates(step.from);
    std::sort(candidates_.begin(), candidates_.end());
    for (const Candidate& next : candidates_)
      if (next.to != step.to && is_legal(step.from, next.to)) return wait_for(step.from, next);
    wait_no_more(step.from);  // until a neighbour changes
  }

  bool is_legal(std::uint32_t from, std::uint32_t to) {
    // What both have as a neighbour must lie across a triangle of both; and a boundary goes along its edge.
    find_neighbors(to);
    const std::uint32_t near_to = mark_;
    std::size_t shared = 0, there = 0, back = 0;
    apexes_.clear();
    for (const std::uint32_t i : triangles_at(from)) {
      const Triangle& t = triangle(i);
      const std::size_t c = corner_of(t, to);
      if (c == 3) continue;
      ++shared;
      const std::size_t own = corner_of(t, from);
      (t[(own + 1) % 3] == to ? there : back) += 1;
      apexes_.push_back(t[3 - own - c]);
    }
    if (shared == 0 || (is_boundary_[from] != 0 && there == back)) return false;
    const std::size_t left = lists_[from].count + lists_[to].count - 2 * shared;
    if (left == 0 || left > std::max<std::size_t>(kMostTriangles, lists_[to].count)) return false;
    for (const std::uint32_t apex : apexes_) marks_[apex] = near_to - 1;  // older than near_to
    for (const std::uint32_t i : triangles_at(from))
      for (const std::uint32_t v : triangle(i))
        if (v != from && v != to && marks_[v] == near_to) return false;
    return keeps_shape(from, to) && !doubles(from, to);
  }

  bool keeps_shape(std::uint32_t from, std::uint32_t to) {
    for (const std::uint32_t i : triangles_at(from)) {
      const Triangle& t = triangle(i);
      if (corner_of(t, to) != 3) continue;
      const std::size_t c = corner_of(t, from);
      const Vec3d a = at_[t[(c + 1) % 3]], b = at_[t[(c + 2) % 3]];
      const Vec3d before = cross(b - a, at_[from] - a);
      if (dot(before, before) > 0 && cosine(before, cross(b - a, at_[to] - a)) < kLeastCosine) return false;
    }
    return true;
  }

  /// Whether a triangle would come to lie on another.
  bool doubles(std::uint32_t from, std::uint32_t to) {
    for (const std::uint32_t i : triangles_at(from)) {
      const Triangle& t = triangle(i);
      if (corner_of(t, to) != 3) continue;
      const std::size_t c = corner_of(t, from);
      const std::uint32_t a = t[(c + 1) % 3], b = t[(c + 2) % 3];
      for (const std::uint32_t j : triangles_at(to))
        if (corner_of(triangle(j), a) != 3 && corner_of(triangle(j), b) != 3) return true;
    }
    return false;
  }

  void take(std::uint32_t from, std::uint32_t to) {
    find_neighbors(from);
    const std::vector<std::uint32_t> near_from = neighbors_;
    move_vertices(from, to);
    for (const std::uint32_t v : near_from) {
      List& list = lists_[v];
      std::span<std::uint32_t> own = triangles_at(v);
      list.count = static_cast<std::uint32_t>(
          std::remove_if(own.begin(), own.end(), [&](std::uint32_t i) { return is_dead_[i] != 0; }) -
          own.begin());
    }
    const auto begin = static_cast<std::uint32_t>(arena_.size());
    for (const std::uint32_t v : {to, from})
      for (std::uint32_t k = 0; k < lists_[v].count; ++k) {
        const std::uint32_t i = arena_[lists_[v].begin + k];
        if (is_dead_[i] == 0) arena_.push_back(i);
      }
    lists_[to] = {begin, static_cast<std::uint32_t>(arena_.size()) - begin};
    lists_[from].count = 0;
    wait_no_more(from);
    has_more_[to] = 1;
    faces_[to] += faces_[from];
    if (feature_of_[from] != kNone) {
      const Quadric own = features_[feature_of_[from]];
      feature_quadric(to) += own;
    }
    find_neighbors(to);
    const std::vector<std::uint32_t> changed = neighbors_;
    enqueue(to);
    for (const std::uint32_t v : changed) update(v, from, to);
  }

  /// The triangles' corners at `from` go to `to`; those of both are dead.
  void move_vertices(std::uint32_t from, std::uint32_t to) {
    moves_.clear();  // the vertices there that follow those here
    for (const std::uint32_t i : triangles_at(from)) {
      const std::size_t c = corner_of(triangle(i), to);
      if (c == 3) continue;
      is_dead_[i] = 1;
      moves_.emplace_back(mesh_.vertices[i][corner_of(triangle(i), from)], mesh_.vertices[i][c]);
    }
    for (const std::uint32_t i : triangles_at(from)) {
      if (is_dead_[i] != 0) continue;
      const std::size_t c = corner_of(triangle(i), from);
      const auto same = std::find_if(moves_.begin(), moves_.end(),
                                     [&](const auto& m) { return m.first == mesh_.vertices[i][c]; });
      mesh_.vertices[i][c] = (same == moves_.end() ? moves_.front() : *same).second;
      triangle(i)[c] = to;
    }
  }

  /// Moves a vertex to where its error is least, but for those of feature edges, which keep to the scan's.
  void settle(std::uint32_t v) {
    if (mesh_.stays[v] != 0 || feature_of_[v] != kNone) return;
    const Quadric& q = faces_[v];
    const std::optional<Vec3d> p = q.least_near(at_[v], kPlaceWeight);
    if (!p || !(length(*p - at_[v]) < kMostMove * std::sqrt(most_)) || !(q.at(*p) < q.at(at_[v]))) return;
    for (const std::uint32_t i : triangles_at(v)) {
      const Triangle& t = triangle(i);
      const std::size_t c = corner_of(t, v);
      const Vec3d a = at_[t[(c + 1) % 3]], b = at_[t[(c + 2) % 3]];
      if (cosine(cross(b - a, at_[v] - a), cross(b - a, *p - a)) < kLeastTurn) return;
    }
    at_[v] = *p;
    mesh_.places[v] = static_cast<Vec3f>(*p) + middle_;
  }

  void drop_dead() {
    std::size_t left = 0;
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
      if (is_dead_[i] != 0) continue;
      mesh_.triangles[left] = mesh_.triangles[i];
      mesh_.vertices[left++] = mesh_.vertices[i];
    }
    mesh_.triangles.resize(left);
    mesh_.vertices.resize(left);
  }

  CollapseMesh& mesh_;
  const double most_;  ///< the error squared
  double length_weight_ = 0;
  Vec3f middle_;
  std::vector<Vec3d> at_;    ///< places, from the middle
  std::vector<List> lists_;  ///< of each place: its triangles, in the arena
  std::vector<std::uint32_t> arena_;
  std::vector<std::uint8_t> is_dead_;  ///< triangles
  std::vector<Vec3f> normals_;         ///< triangles' at first, unit
  std::vector<Quadric> faces_, features_;
  std::vector<std::uint32_t> feature_of_;  ///< of each place its number among features_, if any
  std::vector<std::uint8_t> is_boundary_;  ///< places at edges that not as many triangles pass both ways
  std::vector<std::uint32_t> stamps_;      ///< steps with older ones are out of date
  std::vector<Candidate> waits_for_;       ///< of each vertex: its step in the queue, if any
  std::vector<std::uint8_t> has_more_;     ///< others were drawn onto it
  std::priority_queue<Step> queue_;
  // Of the vertex at hand:
  std::vector<std::uint32_t> marks_, neighbors_, apexes_;
  std::uint32_t mark_ = 0;
  std::vector<Spoke> spokes_;
  std::vector<Candidate> candidates_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> moves_;
};

}  // namespace

void collapse_edges(CollapseMesh& mesh, float error) { Collapse(mesh, error).run(); }

}  // namespace rbvh
