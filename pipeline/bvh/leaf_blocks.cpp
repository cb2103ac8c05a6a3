#include "pipeline/bvh/leaf_blocks.h"

#include <cmath>
#include <limits>

#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 12;

std::vector<std::uint32_t>::const_iterator find_vertex(const Scan& scan,
                                                       const std::vector<std::uint32_t>& vertices,
                                                       std::uint32_t vertex) {
  return std::find_if(vertices.begin(), vertices.end(), [&](std::uint32_t other) {
    return other == vertex || scan.positions[other] == scan.positions[vertex];
  });
}

Bounds3f triangle_box(const Scan& scan, std::uint32_t triangle) {
  Bounds3f box;
  for (const std::uint32_t vertex : scan.triangles[triangle]) box.add(scan.positions[vertex]);
  return box;
}

std::span<std::uint32_t> elements_of(Bvh& bvh, const BvhNode& leaf) {
  return std::span(bvh.order).subspan(leaf.first, leaf.count);
}

/// Orders the triangles so that each half of them lies together.
void halve(const Scan& scan, std::span<std::uint32_t> triangles) {
  Bounds3f centers;
  for (const std::uint32_t i : triangles) centers.add(triangle_box(scan, i).center());
  const Vec3f e = centers.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  std::stable_sort(triangles.begin(), triangles.end(), [&](std::uint32_t a, std::uint32_t b) {
    return triangle_box(scan, a).center()[axis] < triangle_box(scan, b).center()[axis];
  });
}

/// In 127ths of the largest component.
void set_normal(Vec3d sum, BlockSlab& slab) {
  const double largest = std::max({std::abs(sum.x), std::abs(sum.y), std::abs(sum.z)});
  const double scale = largest > 0 && std::isfinite(largest) ? 127 / largest : 0.0;
  for (int axis = 0; axis < 3; ++axis)
    slab.normal[axis] = static_cast<signed char>(std::lround(sum[axis] * scale));
}

Vec3d normal_of(const BlockSlab& slab) {
  return Vec3d{static_cast<double>(slab.normal[0]), static_cast<double>(slab.normal[1]),
               static_cast<double>(slab.normal[2])} *
         (1.0 / 128);
}

void set_planes(double lo, double hi, BlockSlab& slab) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  slab.slab[0] = std::nextafter(static_cast<float>(lo), -kInfinity);
  slab.slab[1] = std::nextafter(static_cast<float>(hi), kInfinity);
}

BlockSlab slab_of_discs(const Scan& scan, std::span<const std::uint32_t> discs) {
  BlockSlab slab{};
  slab.count = static_cast<std::uint8_t>(discs.size());
  Vec3d sum{};
  for (const std::uint32_t i : discs) sum = sum + normalized(static_cast<Vec3d>(scan.normals[i]));
  set_normal(sum, slab);
  const Vec3d n = normal_of(slab);
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  for (const std::uint32_t i : discs) {
    const double at = dot(n, static_cast<Vec3d>(scan.positions[i])),
                 half = static_cast<double>(scan.radii[i]) *
                        length(cross(n, normalized(static_cast<Vec3d>(scan.normals[i]))));
    lo = std::min(lo, at - half);
    hi = std::max(hi, at + half);
  }
  set_planes(lo, hi, slab);
  return slab;
}

/// The numbers of a leaf's elements, ascending.
std::vector<std::uint32_t> sorted_elements(const Bvh& bvh, const BvhNode& leaf) {
  const auto first = bvh.order.begin() + leaf.first;
  std::vector<std::uint32_t> elements(first, first + leaf.count);
  std::sort(elements.begin(), elements.end());
  return elements;
}

/// At least one block.
template <class Block, class Fill>
std::vector<Block> make_blocks(const Bvh& bvh, std::span<const std::uint32_t> leaves, const Fill& fill) {
  std::vector<Block> blocks(std::max<std::size_t>(1, leaves.size()));
  parallel_for(leaves.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::vector<std::uint32_t> elements = sorted_elements(bvh, bvh.nodes[leaves[i]]);
      for (std::size_t lane = 0; lane < LEAF_BLOCK_WIDTH; ++lane)
        blocks[i].places[lane] = elements[std::min(lane, elements.size() - 1)];
      fill(elements, blocks[i]);
    }
  });
  return blocks;
}

}  // namespace

std::vector<std::uint32_t> vertices_of(const Scan& scan, std::span<const std::uint32_t> triangles) {
  std::vector<std::uint32_t> vertices;
  for (const std::uint32_t i : triangles)
    for (const std::uint32_t vertex : scan.triangles[i])
      if (find_vertex(scan, vertices, vertex) == vertices.end()) vertices.push_back(vertex);
  return vertices;
}

std::uint8_t vertex_number(const Scan& scan, const std::vector<std::uint32_t>& vertices,
                           std::uint32_t vertex) {
  return static_cast<std::uint8_t>(find_vertex(scan, vertices, vertex) - vertices.begin());
}

void split_for_clusters(const Scan& scan, Bvh& bvh) {
  const auto fits = [&](const BvhNode& node) {
    return node.count == 0 || vertices_of(scan, elements_of(bvh, node)).size() <= LEAF_BLOCK_WIDTH;
  };
  std::vector<std::uint8_t> is_good(bvh.nodes.size());
  parallel_for(bvh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) is_good[n] = fits(bvh.nodes[n]);
  });
  for (std::size_t n = 0; n < bvh.nodes.size(); ++n) {
    const BvhNode node = bvh.nodes[n];
    if (n < is_good.size() ? is_good[n] : fits(node)) continue;
    halve(scan, elements_of(bvh, node));
    const auto left = static_cast<std::uint32_t>(bvh.nodes.size());
    const std::uint32_t half = node.count / 2;
    for (const auto& [first, count] :
         {std::pair{node.first, half}, std::pair{node.first + half, node.count - half}}) {
      BvhNode& child = bvh.nodes.emplace_back(BvhNode{{}, first, count});
      for (const std::uint32_t i : elements_of(bvh, child)) child.bounds.add(triangle_box(scan, i));
    }
    bvh.nodes[n].first = left;
    bvh.nodes[n].count = 0;
  }
}

BlockSlab slab_of_triangles(const Scan& scan, std::span<const std::uint32_t> triangles) {
  BlockSlab slab{};
  slab.count = static_cast<std::uint8_t>(triangles.size());
  const auto corner = [&](std::uint32_t triangle, std::size_t k) {
    return static_cast<Vec3d>(scan.positions[scan.triangles[triangle][k]]);
  };
  Vec3d sum{};
  for (const std::uint32_t i : triangles) {
    const Vec3d a = corner(i, 0);
    sum = sum + cross(corner(i, 1) - a, corner(i, 2) - a);
  }
  set_normal(sum, slab);
  const Vec3d n = normal_of(slab);
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  for (const std::uint32_t i : triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      lo = std::min(lo, dot(n, corner(i, k)));
      hi = std::max(hi, dot(n, corner(i, k)));
    }
  set_planes(lo, hi, slab);
  return slab;
}

void fill_cluster(const Scan& scan, std::span<const std::uint32_t> triangles, FloatCluster& cluster) {
  cluster.between = slab_of_triangles(scan, triangles);
  const std::vector<std::uint32_t> vertices = put_corners(scan, triangles, cluster);
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < LEAF_BLOCK_WIDTH; ++i)
      cluster.vertices[axis][i] = scan.positions[vertices[i]][static_cast<int>(axis)];
}

void fill_discs(const Scan& scan, std::span<const std::uint32_t> discs, DiscBlock& block) {
  block.between = slab_of_discs(scan, discs);
  std::fill_n(&block.rows[0][0], 7 * LEAF_BLOCK_WIDTH, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t lane = 0; lane < discs.size(); ++lane) {
    const std::uint32_t i = discs[lane];
    const Vec3f normal = static_cast<Vec3f>(normalized(static_cast<Vec3d>(scan.normals[i])));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      block.rows[axis][lane] = scan.positions[i][static_cast<int>(axis)];
      block.rows[3 + axis][lane] = normal[static_cast<int>(axis)];
    }
    block.rows[6][lane] = scan.radii[i];
  }
}

std::vector<FloatCluster> make_clusters(const Bvh& bvh, std::span<const std::uint32_t> leaves,
                                        const Scan& scan) {
  return make_blocks<FloatCluster>(bvh, leaves,
                                   [&](const std::vector<std::uint32_t>& elements, FloatCluster& cluster) {
                                     fill_cluster(scan, elements, cluster);
                                   });
}

std::vector<DiscBlock> make_disc_blocks(const Bvh& bvh, std::span<const std::uint32_t> leaves,
                                        const Scan& scan) {
  return make_blocks<DiscBlock>(bvh, leaves,
                                [&](const std::vector<std::uint32_t>& elements, DiscBlock& block) {
                                  fill_discs(scan, elements, block);
                                });
}

}  // namespace rbvh
