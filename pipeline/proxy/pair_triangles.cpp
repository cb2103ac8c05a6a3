// Greedy pairs, the best first; what stays alone is paired along alternating paths (Edmonds, "Paths, trees,
// and flowers", 1965, with blossoms); then pairs around a vertex are exchanged where that makes better quads.
#include "pipeline/proxy/pair_triangles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kNone = TrianglePair::kNone;
constexpr double kFoldWeight = 0.5;  // of the angle between the two triangles, beside those at the corners
constexpr int kTurnRounds = 12;

std::size_t next(std::size_t side) { return side == 2 ? 0 : side + 1; }

struct Neighbors {
  std::vector<std::array<std::uint32_t, 3>> across;  ///< of each side: the triangle, or kNone
  std::vector<std::array<std::uint8_t, 3>> side;     ///< and which of its sides that is
};

Neighbors find_neighbors(const std::vector<Triangle>& triangles) {
  struct Side {
    std::uint64_t key;
    std::uint32_t triangle;
    std::uint8_t side;
  };
  std::vector<Side> sides;
  sides.reserve(triangles.size() * 3);
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::uint8_t k = 0; k < 3; ++k) {
      const std::uint64_t a = triangles[t][k], b = triangles[t][next(k)];
      sides.push_back({std::min(a, b) << 32 | std::max(a, b), t, k});
    }
  std::stable_sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.key < b.key; });
  Neighbors n;
  n.across.assign(triangles.size(), {kNone, kNone, kNone});
  n.side.resize(triangles.size());
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const Side &a = sides[i - 1], &b = sides[i];
    if (a.key != b.key) continue;
    n.across[a.triangle][a.side] = b.triangle;
    n.side[a.triangle][a.side] = b.side;
    n.across[b.triangle][b.side] = a.triangle;
    n.side[b.triangle][b.side] = a.side;
  }
  return n;
}

double angle(Vec3d a, Vec3d b) { return std::atan2(length(cross(a, b)), dot(a, b)); }

// 0 for a flat square; about 1 for a quad with a corner of 180 degrees.
double pair_cost(const BaseMesh& mesh, const Neighbors& n, std::uint32_t triangle, std::size_t side) {
  const Triangle& a = mesh.triangles[triangle];
  const Triangle& b = mesh.triangles[n.across[triangle][side]];
  const auto point = [&](std::uint32_t v) { return Vec3d(mesh.positions[v]); };
  const Vec3d p = point(a[side]), q = point(a[next(side)]), r = point(a[next(next(side))]);
  const Vec3d s = point(b[next(next(n.side[triangle][side]))]);
  const double at_p = angle(r - p, q - p) + angle(s - p, q - p);
  const double at_q = angle(r - q, p - q) + angle(s - q, p - q);
  double worst = 0;
  for (const double corner : {at_p, at_q, angle(p - r, q - r), angle(p - s, q - s)})
    worst = std::max(worst, std::abs(corner - std::numbers::pi / 2));
  const double fold = angle(cross(q - p, r - p), cross(p - q, s - q));
  return (worst + kFoldWeight * fold) / (std::numbers::pi / 2);
}

// Matches triangles. A triangle at a boundary may also be matched with its boundary edge, a node of its own.
class Matching {
 public:
  explicit Matching(const Neighbors& neighbors)
      : n_(neighbors), count_(static_cast<std::uint32_t>(neighbors.across.size())) {
    const std::size_t nodes = 2 * std::size_t{count_};
    partner.assign(nodes, kNone);
    parent_.assign(nodes, kNone);
    base_.resize(nodes);
    for (std::uint32_t i = 0; i < nodes; ++i) base_[i] = i;
    is_used_.assign(nodes, 0);
    is_touched_.assign(nodes, 0);
    in_blossom_.assign(nodes, 0);
    seen_.assign(nodes, 0);
  }

  std::vector<std::uint32_t> partner;  ///< triangle i's boundary edge is node count + i

  void complete(bool with_boundary) {
    with_boundary_ = with_boundary;
    for (std::uint32_t root = 0; root < count_; ++root) {
      if (partner[root] != kNone) continue;
      for (std::uint32_t v = find_path(root); v != kNone;) {
        const std::uint32_t before = parent_[v], after = partner[before];
        partner[v] = before;
        partner[before] = v;
        v = after;
      }
      forget();
    }
  }

 private:
  bool has_boundary(std::uint32_t t) const {
    return std::find(n_.across[t].begin(), n_.across[t].end(), kNone) != n_.across[t].end();
  }
  template <class Visit>
  void for_each_neighbor(std::uint32_t v, const Visit& visit) const {
    if (v >= count_) {
      visit(v - count_);
      return;
    }
    for (const std::uint32_t t : n_.across[v])
      if (t != kNone) visit(t);
    if (with_boundary_ && has_boundary(v)) visit(v + count_);
  }
  void touch(std::uint32_t v) {
    if (is_touched_[v]) return;
    is_touched_[v] = 1;
    touched_.push_back(v);
  }
  void use(std::uint32_t v) {
    touch(v);
    is_used_[v] = 1;
    queue_.push_back(v);
  }
  void forget() {
    for (const std::uint32_t v : touched_) {
      parent_[v] = kNone;
      base_[v] = v;
      is_used_[v] = is_touched_[v] = in_blossom_[v] = 0;
    }
    touched_.clear();
    queue_.clear();
  }

  std::uint32_t common_base(std::uint32_t a, std::uint32_t b) {
    ++stamp_;
    for (;;) {
      a = base_[a];
      seen_[a] = stamp_;
      if (partner[a] == kNone) break;
      a = parent_[partner[a]];
    }
    for (;; b = parent_[partner[b]]) {
      b = base_[b];
      if (seen_[b] == stamp_) return b;
    }
  }
  void mark_path(std::uint32_t v, std::uint32_t to, std::uint32_t child) {
    for (; base_[v] != to; v = parent_[partner[v]]) {
      in_blossom_[base_[v]] = in_blossom_[base_[partner[v]]] = 1;
      touch(base_[v]);
      touch(base_[partner[v]]);
      touch(v);
      parent_[v] = child;
      child = partner[v];
    }
  }
  void contract(std::uint32_t v, std::uint32_t to) {
    const std::uint32_t base = common_base(v, to);
    mark_path(v, base, to);
    mark_path(to, base, v);
    for (std::size_t i = 0; i < touched_.size(); ++i) {
      const std::uint32_t u = touched_[i];
      if (!in_blossom_[base_[u]]) continue;
      base_[u] = base;
      if (!is_used_[u]) use(u);
    }
    for (const std::uint32_t u : touched_) in_blossom_[u] = 0;
  }

  std::uint32_t find_path(std::uint32_t root) {
    use(root);
    std::uint32_t found = kNone;
    for (std::size_t head = 0; head < queue_.size() && found == kNone; ++head) {
      const std::uint32_t v = queue_[head];
      for_each_neighbor(v, [&](std::uint32_t to) {
        if (found != kNone || base_[v] == base_[to] || partner[v] == to) return;
        if (to == root || (partner[to] != kNone && parent_[partner[to]] != kNone)) {
          contract(v, to);
        } else if (parent_[to] == kNone) {
          touch(to);
          parent_[to] = v;
          if (partner[to] == kNone)
            found = to;
          else
            use(partner[to]);
        }
      });
    }
    return found;
  }

  const Neighbors& n_;
  std::uint32_t count_;
  bool with_boundary_ = false;
  std::vector<std::uint32_t> parent_, base_, touched_, queue_, seen_;
  std::vector<std::uint8_t> is_used_, is_touched_, in_blossom_;
  std::uint32_t stamp_ = 0;
};

using Costs = std::vector<std::array<double, 3>>;

void pair_greedily(const Neighbors& n, const Costs& costs, std::vector<std::uint32_t>& partner) {
  struct Candidate {
    double cost;
    std::uint32_t triangle, side;
  };
  std::vector<Candidate> order;
  for (std::uint32_t t = 0; t < costs.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k)
      if (n.across[t][k] != kNone && t < n.across[t][k]) order.push_back({costs[t][k], t, k});
  std::stable_sort(order.begin(), order.end(),
                   [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  for (const Candidate& c : order) {
    const std::uint32_t other = n.across[c.triangle][c.side];
    if (partner[c.triangle] != kNone || partner[other] != kNone) continue;
    partner[c.triangle] = other;
    partner[other] = c.triangle;
  }
}

// Where the triangles around a vertex are paired among themselves, the other way of doing that is tried.
bool turn_around(const Neighbors& n, const Costs& costs, std::uint32_t triangle, std::size_t corner,
                 std::vector<std::uint32_t>& partner) {
  struct Spoke {
    std::uint32_t triangle;
    double cost;  ///< of a pair with the next one around
  };
  Spoke ring[32];
  std::size_t count = 0;
  std::uint32_t t = triangle;
  do {
    const std::size_t side = next(next(corner));  // that comes back to the vertex
    if (count == std::size(ring) || n.across[t][side] == kNone) return false;
    ring[count++] = {t, costs[t][side]};
    corner = n.side[t][side];
    t = n.across[t][side];
  } while (t != triangle);
  if (count % 2 != 0 || count < 4) return false;
  const std::size_t start = partner[ring[0].triangle] == ring[1].triangle ? 0 : 1;
  double now = 0, turned = 0;
  for (std::size_t i = start; i < count + start; i += 2) {
    const Spoke &a = ring[i % count], &b = ring[(i + 1) % count];
    if (partner[a.triangle] != b.triangle) return false;
    now += a.cost * a.cost;
    turned += b.cost * b.cost;
  }
  if (!(turned < now * (1 - 1e-9))) return false;
  for (std::size_t i = start + 1; i < count + start + 1; i += 2) {
    const std::uint32_t a = ring[i % count].triangle, b = ring[(i + 1) % count].triangle;
    partner[a] = b;
    partner[b] = a;
  }
  return true;
}

}  // namespace

std::vector<TrianglePair> pair_triangles(const BaseMesh& mesh, std::uint64_t& alone) {
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  const Neighbors n = find_neighbors(mesh.triangles);
  Costs costs(count);
  for (std::uint32_t t = 0; t < count; ++t)
    for (std::size_t k = 0; k < 3; ++k) costs[t][k] = n.across[t][k] == kNone ? 0 : pair_cost(mesh, n, t, k);
  Matching matching(n);
  std::vector<std::uint32_t>& partner = matching.partner;
  pair_greedily(n, costs, partner);
  matching.complete(/*with_boundary=*/false);
  matching.complete(/*with_boundary=*/true);

  bool has_changed = true;
  for (int round = 0; round < kTurnRounds && has_changed; ++round) {
    has_changed = false;
    std::vector<bool> is_done(mesh.positions.size());
    for (std::uint32_t t = 0; t < count; ++t)
      for (std::size_t k = 0; k < 3; ++k)
        if (!is_done[mesh.triangles[t][k]]) {
          is_done[mesh.triangles[t][k]] = true;
          has_changed |= turn_around(n, costs, t, k, partner);
        }
  }

  std::vector<TrianglePair> pairs;
  alone = 0;
  for (std::uint32_t t = 0; t < count; ++t) {
    RBVH_CHECK(partner[t] != kNone);
    const std::uint32_t other = partner[t] < count ? partner[t] : kNone;
    if (other < t) continue;
    alone += other == kNone;
    const auto side = static_cast<std::uint8_t>(std::find(n.across[t].begin(), n.across[t].end(), other) -
                                                n.across[t].begin());
    pairs.push_back({t, other, side, other == kNone ? std::uint8_t{0} : n.side[t][side]});
  }
  return pairs;
}

}  // namespace rbvh
