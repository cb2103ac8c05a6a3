#include "pipeline/scan/neighbors.h"

#include <atomic>
#include <memory>

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_single_index.h>
#include <flann/util/matrix.h>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/scan/pca.h"

namespace rbvh {
namespace {

/// Neighbours whose middle variance is less than this part of the largest lie along a line.
constexpr double kLine = 1.0 / 8;
/// Neighbours whose least variance is more than this part of the sum fill a volume.
constexpr double kVolume = 0.15;
/// How many times more are looked at then.
constexpr std::size_t kWidest = 4;
constexpr std::size_t kGrain = 4096;

using Tree = flann::KDTreeSingleIndex<flann::L2_3D<float>>;

bool spans_surface(const PrincipalComponents& shape) {
  const auto [least, middle, largest] = shape.variances;
  return middle >= kLine * largest && least <= kVolume * (least + middle + largest);
}

/// The `k` nearest to point `self`, without itself.
void nearest(const Tree& tree, std::span<const Vec3f> points, std::size_t self, std::size_t k,
             std::vector<std::size_t>& found, std::vector<float>& distances,
             std::vector<std::uint32_t>& out) {
  flann::KNNSimpleResultSet<float> result(k + 1);
  tree.findNeighbors(result, &points[self].x, flann::SearchParams(-1));
  found.resize(k + 1);
  distances.resize(k + 1);
  const std::size_t count = result.size();
  result.copy(found.data(), distances.data(), count);
  out.clear();
  // Among more than k equal points the point itself may be missing.
  for (std::size_t i = 0; i < count && out.size() < k; ++i)
    if (found[i] != self) out.push_back(static_cast<std::uint32_t>(found[i]));
}

}  // namespace

Neighbors find_neighbors(std::span<const Vec3f> points, std::size_t k, const Progress& progress,
                         std::size_t step) {
  RBVH_CHECK(points.size() < UINT32_MAX);
  Neighbors neighbors;
  neighbors.offsets.assign(points.size() + 1, 0);
  k = std::min(k, points.empty() ? 0 : points.size() - 1);
  if (k == 0) return neighbors;

  // FLANN takes the points as a matrix that it does not change.
  const flann::Matrix<float> matrix(const_cast<float*>(&points[0].x), points.size(), 3);
  Tree tree(matrix, flann::KDTreeSingleIndexParams(10, true));
  tree.buildIndex();

  const std::size_t pieces = (points.size() + kGrain - 1) / kGrain;
  std::vector<std::vector<std::uint32_t>> found(pieces);
  std::atomic<std::size_t> done{0};
  parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<std::size_t> indices;
    std::vector<float> distances;
    std::vector<std::uint32_t> others;
    std::vector<std::uint32_t>& mine = found[begin / kGrain];
    mine.reserve((end - begin) / step * k);
    for (std::size_t i = (begin + step - 1) / step * step; i < end; i += step) {
      for (std::size_t wanted = k;; wanted = std::min(2 * wanted, points.size() - 1)) {
        nearest(tree, points, i, wanted, indices, distances, others);
        if (wanted >= kWidest * k || wanted == points.size() - 1) break;
        const PrincipalComponents shape = principal_components(points, i, others);
        if (spans_surface(shape)) break;
      }
      mine.insert(mine.end(), others.begin(), others.end());
      neighbors.offsets[i + 1] = others.size();
    }
    report(progress, "neighbours", static_cast<double>(++done) / static_cast<double>(pieces));
  });
  for (std::size_t i = 0; i < points.size(); ++i) neighbors.offsets[i + 1] += neighbors.offsets[i];
  neighbors.indices.reserve(neighbors.offsets.back());
  for (std::vector<std::uint32_t>& piece : found) {
    neighbors.indices.insert(neighbors.indices.end(), piece.begin(), piece.end());
    piece = {};
  }
  return neighbors;
}

}  // namespace rbvh
