// Blocks of up to 16 primitives, which wide hierarchies over primitives have for leaves
// (kernels/bvh/leaf_block.h).
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "kernels/bvh/bvh_layout.h"
#include "pipeline/base/error.h"
#include "pipeline/bvh/bvh.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Of trees whose leaves are blocks.
inline constexpr BvhConfig kLeafBlockConfig{.leaf_size = LEAF_BLOCK_WIDTH, .test_width = LEAF_BLOCK_WIDTH};

/// The vertices of some triangles, each position once, in the order of first use.
std::vector<std::uint32_t> vertices_of(const Scan& scan, std::span<const std::uint32_t> triangles);

/// Which of these is at the vertex's position.
std::uint8_t vertex_number(const Scan& scan, const std::vector<std::uint32_t>& vertices,
                           std::uint32_t vertex);

/// Splits leaves whose triangles have more vertices than a cluster. Leaves hold at most LEAF_BLOCK_WIDTH
/// triangles.
void split_for_clusters(const Scan& scan, Bvh& bvh);

/// Puts the triangles' corners into a cluster, by number; returns the vertices that they count, repeated up
/// to LEAF_BLOCK_WIDTH. Unused lanes repeat the last triangle.
template <class Cluster>
std::vector<std::uint32_t> put_corners(const Scan& scan, std::span<const std::uint32_t> triangles,
                                       Cluster& cluster) {
  std::vector<std::uint32_t> vertices = vertices_of(scan, triangles);
  RBVH_CHECK(vertices.size() <= LEAF_BLOCK_WIDTH);
  for (std::size_t lane = 0; lane < LEAF_BLOCK_WIDTH; ++lane) {
    const Triangle& t = scan.triangles[triangles[std::min(lane, triangles.size() - 1)]];
    for (std::size_t k = 0; k < 3; ++k) cluster.corners[k][lane] = vertex_number(scan, vertices, t[k]);
  }
  vertices.resize(LEAF_BLOCK_WIDTH, vertices.back());
  return vertices;
}

/// Two planes that the triangles lie between, across their mean normal.
BlockSlab slab_of_triangles(const Scan& scan, std::span<const std::uint32_t> triangles);

/// Everything but places and leaf. The primitives' numbers ascend.
void fill_cluster(const Scan& scan, std::span<const std::uint32_t> triangles, FloatCluster& cluster);
void fill_discs(const Scan& scan, std::span<const std::uint32_t> discs, DiscBlock& block);

/// Block i holds the primitives of leaf leaves[i], whose places are their indices in the scan. There is at
/// least one.
std::vector<FloatCluster> make_clusters(const Bvh& bvh, std::span<const std::uint32_t> leaves,
                                        const Scan& scan);
std::vector<DiscBlock> make_disc_blocks(const Bvh& bvh, std::span<const std::uint32_t> leaves,
                                        const Scan& scan);

}  // namespace rbvh
