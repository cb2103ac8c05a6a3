#include "pipeline/scan/normals.h"

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/scan/pca.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 4096;
/// Edges of the graph a point: spread over its neighbours, so that scan lines far apart are joined too.
constexpr std::size_t kEdges = 8;
/// Weights of edges in transport(); those that lead off a plane begin at the first.
constexpr std::size_t kOffPlaneWeight = 512, kWeights = 2 * kOffPlaneWeight;
/// Squared sine of the angle between an edge and a plane from which on it leads off the plane.
constexpr float kOffPlane = 0.25f;

/// Sets of points that know, for each point, whether it is flipped against its set's root.
class ParitySets {
 public:
  explicit ParitySets(std::size_t count) : parent_(count), flipped_(count, 0) {
    for (std::size_t i = 0; i < count; ++i) parent_[i] = static_cast<std::uint32_t>(i);
  }
  struct Place {
    std::uint32_t root;
    bool flipped;
  };
  Place find(std::uint32_t point) {
    std::uint32_t root = point;
    bool flipped = false;
    while (parent_[root] != root) {
      flipped ^= flipped_[root] != 0;
      root = parent_[root];
    }
    // The whole path points at the root from now on.
    bool rest = flipped;
    for (std::uint32_t at = point; parent_[at] != root && at != root;) {
      const std::uint32_t next = parent_[at];
      const bool own = flipped_[at] != 0;
      parent_[at] = root;
      flipped_[at] = rest;
      rest ^= own;
      at = next;
    }
    return {root, flipped};
  }
  /// `opposite`: the two are to be flipped against each other. The lower root stays.
  void join(std::uint32_t a, std::uint32_t b, bool opposite) {
    Place pa = find(a), pb = find(b);
    if (pa.root == pb.root) return;
    if (pb.root < pa.root) std::swap(pa, pb);
    parent_[pb.root] = pa.root;
    flipped_[pb.root] = pa.flipped ^ pb.flipped ^ opposite;
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<std::uint8_t> flipped_;
};

struct Edge {
  std::uint32_t from, to;
};

/// Calls visit(point, neighbour) for the graph's edges.
template <class Visit>
void for_edges(const Neighbors& neighbors, std::size_t begin, std::size_t end, Visit visit) {
  for (std::size_t i = begin; i < end; ++i) {
    const auto others = neighbors.of(i);
    const std::size_t step = (others.size() + kEdges - 1) / kEdges;
    for (std::size_t j = 0; j < others.size(); j += step) visit(static_cast<std::uint32_t>(i), others[j]);
  }
}

/// A normal transported along an edge, against the normal there.
struct Transport {
  bool opposite = false;   ///< the two normals point to different sides
  std::size_t weight = 0;  ///< less: more certain
};

/// Along the surface a normal changes as on a circular arc: the normal that continues `n_from` is its mirror
/// image in the plane halfway. Edges that lead off both points' planes, to another sheet or another return of
/// the same pulse, come last and leave the normal as it is.
Transport transport(Vec3f from, Vec3f to, Vec3f n_from, Vec3f n_to) {
  constexpr float kHalf = static_cast<float>(kOffPlaneWeight - 1);
  const Vec3f d = to - from;
  const float squared = dot(d, d), off_from = dot(d, n_from), off_to = dot(d, n_to);
  const float off = std::max(off_from * off_from, off_to * off_to);
  const bool along = squared > 0 && off < kOffPlane * squared;
  const float agreement = dot(along ? n_from - d * (2 * off_from / squared) : n_from, n_to);
  const float change = 1 - std::min(1.0f, std::abs(agreement));
  return {agreement < 0, static_cast<std::size_t>(change * kHalf) + (along ? 0 : kOffPlaneWeight)};
}

/// All edges, those of least weight first, in a fixed order.
std::vector<Edge> sorted_edges(std::span<const Vec3f> points, const Neighbors& neighbors,
                               std::span<const Vec3f> normals) {
  const auto weight_of = [&](std::uint32_t a, std::uint32_t b) {
    return transport(points[a], points[b], normals[a], normals[b]).weight;
  };
  std::vector<std::size_t> place(kWeights + 1, 0);
  for_edges(neighbors, 0, points.size(),
            [&](std::uint32_t a, std::uint32_t b) { ++place[weight_of(a, b) + 1]; });
  for (std::size_t w = 0; w < kWeights; ++w) place[w + 1] += place[w];
  std::vector<Edge> edges(place[kWeights]);
  for_edges(neighbors, 0, points.size(), [&](std::uint32_t a, std::uint32_t b) {
    edges[place[weight_of(a, b)]++] = {a, b};
  });
  return edges;
}

}  // namespace

void estimate_normals(std::span<const Vec3f> points, const Neighbors& neighbors,
                      std::span<const std::uint8_t> missing, std::span<Vec3f> normals) {
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (missing[i])
        normals[i] = static_cast<Vec3f>(principal_components(points, i, neighbors.of(i)).normal);
  });
}

void propagate_orientation(std::span<const Vec3f> points, const Neighbors& neighbors,
                           std::span<const std::uint8_t> fixed, std::span<Vec3f> normals) {
  ParitySets sets(points.size());
  for (const Edge& edge : sorted_edges(points, neighbors, normals))
    sets.join(edge.from, edge.to,
              transport(points[edge.from], points[edge.to], normals[edge.from], normals[edge.to]).opposite);

  // The sum of n_z times the height above the lowest point is a closed surface's volume, positive when its
  // normals face outwards; over a terrain it is positive when they face up. The square lets the top count
  // more.
  struct Vote {
    float low = std::numeric_limits<float>::max();
    double fixed = 0, outward = 0;
  };
  std::vector<Vote> votes(points.size());  // at the roots
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    Vote& vote = votes[sets.find(i).root];
    vote.low = std::min(vote.low, points[i].z);
  }
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const auto [root, flipped] = sets.find(i);
    Vote& vote = votes[root];
    const double sign = flipped ? -1 : 1;
    const double height = static_cast<double>(points[i].z) - static_cast<double>(vote.low);
    if (fixed[i]) vote.fixed += sign;
    vote.outward += sign * static_cast<double>(normals[i].z) * height * height;
  }
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const auto [root, flipped] = sets.find(i);
    const Vote& vote = votes[root];
    const bool flip_tree = vote.fixed != 0 ? vote.fixed < 0 : vote.outward < 0;
    if (flipped != flip_tree && !fixed[i]) normals[i] = -normals[i];
  }
}

double visible_share(std::span<const Vec3f> points, const Neighbors& neighbors,
                     std::span<const Vec3f> normals, std::span<const std::uint8_t> asked, Vec3f viewpoint) {
  ParitySets sets(points.size());
  for_edges(neighbors, 0, points.size(), [&](std::uint32_t a, std::uint32_t b) { sets.join(a, b, false); });
  std::vector<std::int64_t> facing(points.size(), 0);
  std::size_t count = 0;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (!asked[i]) continue;
    facing[sets.find(i).root] += dot(normals[i], viewpoint - points[i]) >= 0 ? 1 : -1;
    ++count;
  }
  double agreeing = 0;
  for (const std::int64_t sum : facing) agreeing += static_cast<double>(std::abs(sum));
  return count == 0 ? 0 : agreeing / static_cast<double>(count);
}

}  // namespace rbvh
