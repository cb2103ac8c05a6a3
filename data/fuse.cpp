#include "fuse.h"

#include <algorithm>
#include <unordered_map>

#include "pipeline/base/parallel_for.h"

namespace rbvh::demo {
namespace {

constexpr int kBlock = 8;  // cells a side
constexpr int kBlockCells = kBlock * kBlock * kBlock;
constexpr float kBand = 3;             // cells on either side of a measurement that it affects
constexpr float kLeastCosine = 0.28f;  // measurements at a lower angle are ignored

using Coordinate = std::array<int, 3>;

/// The distances at a block's grid points, and the vertices of the cells whose lowest corners these points
/// are.
struct Block {
  Coordinate origin;  ///< in cells
  std::array<float, kBlockCells> distance;
  std::array<float, kBlockCells> weight;         ///< 0: never measured
  std::array<std::int32_t, kBlockCells> vertex;  ///< within the block, -1: none
  std::vector<Vec3f> vertices;
  std::uint32_t first_vertex = 0;
};

std::uint64_t block_key(int x, int y, int z) {
  const auto bits = [](int v) { return static_cast<std::uint64_t>(v + (1 << 20)) & 0x1fffffu; };
  return bits(x) << 42 | bits(y) << 21 | bits(z);
}

int floor_block(int cell) { return cell >= 0 ? cell / kBlock : -((kBlock - 1 - cell) / kBlock); }

std::size_t cell_index(int x, int y, int z) {
  return static_cast<std::size_t>((z * kBlock + y) * kBlock + x);
}

struct Grid {
  std::vector<Block> blocks;
  std::unordered_map<std::uint64_t, std::size_t> index;

  const Block* find(Coordinate cell, std::size_t& at) const {
    const int bx = floor_block(cell[0]), by = floor_block(cell[1]), bz = floor_block(cell[2]);
    const auto found = index.find(block_key(bx, by, bz));
    if (found == index.end()) return nullptr;
    at = cell_index(cell[0] - bx * kBlock, cell[1] - by * kBlock, cell[2] - bz * kBlock);
    return &blocks[found->second];
  }
};

/// The blocks within the band of any measurement, in a fixed order.
Grid blocks_near(const std::vector<RangeImage>& images, float cell) {
  std::vector<std::vector<std::uint64_t>> keys(images.size());
  parallel_for(images.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const RangeImage& image = images[i];
      const auto width = static_cast<std::size_t>(image.width);
      for (std::size_t pixel = 0; pixel < image.ranges.size(); ++pixel) {
        if (image.ranges[pixel] == 0) continue;
        const std::size_t row = pixel / width, column = pixel % width;
        const Vec3f direction = image.direction(static_cast<float>(column), static_cast<float>(row));
        const Vec3f p = (image.eye + direction * image.ranges[pixel]) * (1 / cell);
        const auto block = [](float v) { return static_cast<int>(std::floor(v * (1.0f / kBlock))); };
        for (int z = block(p.z - kBand); z <= block(p.z + kBand); ++z)
          for (int y = block(p.y - kBand); y <= block(p.y + kBand); ++y)
            for (int x = block(p.x - kBand); x <= block(p.x + kBand); ++x) {
              const std::uint64_t key = block_key(x, y, z);
              if (keys[i].empty() || keys[i].back() != key) keys[i].push_back(key);
            }
      }
      std::sort(keys[i].begin(), keys[i].end());
      keys[i].erase(std::unique(keys[i].begin(), keys[i].end()), keys[i].end());
    }
  });
  std::vector<std::uint64_t> all;
  for (const auto& some : keys) all.insert(all.end(), some.begin(), some.end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  Grid grid;
  grid.blocks.resize(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto origin = [&](int shift) {
      return (static_cast<int>(all[i] >> shift & 0x1fffffu) - (1 << 20)) * kBlock;
    };
    grid.blocks[i].origin = {origin(42), origin(21), origin(0)};
    grid.index.emplace(all[i], i);
  }
  return grid;
}

/// One view's measurement at a point: the signed distance along its ray, and its weight (0: no
/// measurement).
void look_up(const RangeImage& image, Vec3f p, float band, float& distance, float& weight) {
  weight = 0;
  const Vec3f offset = p - image.eye;
  const float depth = dot(offset, image.forward);
  const float half = 0.5f * static_cast<float>(image.width - 1);
  const float x = half + dot(offset, image.right) / (dot(image.right, image.right) * depth);
  const float y = half - dot(offset, image.up) / (dot(image.up, image.up) * depth);
  if (!(x >= 0 && y >= 0 && x < static_cast<float>(image.width - 1) &&
        y < static_cast<float>(image.width - 1)))
    return;
  const auto ix = static_cast<std::size_t>(x), iy = static_cast<std::size_t>(y);
  const auto width = static_cast<std::size_t>(image.width);
  const std::size_t at = iy * width + ix;
  const float r[4] = {image.ranges[at], image.ranges[at + 1], image.ranges[at + width],
                      image.ranges[at + width + 1]};
  const auto [lo, hi] = std::minmax({r[0], r[1], r[2], r[3]});
  const float cosine = std::min(
      {image.cosines[at], image.cosines[at + 1], image.cosines[at + width], image.cosines[at + width + 1]});
  // The edge of a hole, or of something in front of something else.
  if (lo == 0 || cosine < kLeastCosine || hi - lo > 1.3f * band) return;
  const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
  const float range = (r[0] * (1 - fx) + r[1] * fx) * (1 - fy) + (r[2] * (1 - fx) + r[3] * fx) * fy;
  const float d = range - length(offset);
  if (std::abs(d) > band) return;
  distance = d;
  weight = cosine - kLeastCosine;
}

void average_distances(Block& block, const std::vector<RangeImage>& images, float cell) {
  for (int z = 0; z < kBlock; ++z)
    for (int y = 0; y < kBlock; ++y)
      for (int x = 0; x < kBlock; ++x) {
        const Vec3f p =
            Vec3f{static_cast<float>(block.origin[0] + x), static_cast<float>(block.origin[1] + y),
                  static_cast<float>(block.origin[2] + z)} *
            cell;
        float sum = 0, weights = 0;
        for (const RangeImage& image : images) {
          float distance = 0, weight = 0;
          look_up(image, p, kBand * cell, distance, weight);
          sum += distance * weight;
          weights += weight;
        }
        const std::size_t at = cell_index(x, y, z);
        block.weight[at] = weights;
        block.distance[at] = weights > 0 ? sum / weights : 0;
      }
}

/// One vertex for every cell that the surface crosses and whose eight corners were all measured: the mean of
/// the crossings of its twelve edges.
void place_vertices(Block& block, const Grid& grid, float cell) {
  block.vertex.fill(-1);
  for (int z = 0; z < kBlock; ++z)
    for (int y = 0; y < kBlock; ++y)
      for (int x = 0; x < kBlock; ++x) {
        float corner[8];
        bool measured = true;
        int inside = 0;
        for (int c = 0; c < 8 && measured; ++c) {
          const int cx = x + (c & 1), cy = y + (c >> 1 & 1), cz = z + (c >> 2);
          std::size_t at = 0;
          const Block* from = &block;
          if (cx < kBlock && cy < kBlock && cz < kBlock)
            at = cell_index(cx, cy, cz);
          else
            from = grid.find({block.origin[0] + cx, block.origin[1] + cy, block.origin[2] + cz}, at);
          measured = from != nullptr && from->weight[at] > 0;
          if (!measured) break;
          corner[c] = from->distance[at];
          inside += corner[c] < 0;
        }
        if (!measured || inside == 0 || inside == 8) continue;
        Vec3f sum{};
        float crossings = 0;
        for (int a = 0; a < 8; ++a)
          for (int axis = 0; axis < 3; ++axis) {
            const int b = a | 1 << axis;
            if (b == a || (corner[a] < 0) == (corner[b] < 0)) continue;
            Vec3f at{static_cast<float>(a & 1), static_cast<float>(a >> 1 & 1), static_cast<float>(a >> 2)};
            at[axis] = corner[a] / (corner[a] - corner[b]);
            sum = sum + at;
            crossings += 1;
          }
        const Vec3f low{static_cast<float>(block.origin[0] + x), static_cast<float>(block.origin[1] + y),
                        static_cast<float>(block.origin[2] + z)};
        block.vertex[cell_index(x, y, z)] = static_cast<std::int32_t>(block.vertices.size());
        block.vertices.push_back((low + sum * (1 / crossings)) * cell);
      }
}

/// Two triangles for every grid edge that the surface crosses and whose four cells all have a vertex.
void draw_quads(const Block& block, const Grid& grid, const std::vector<Vec3f>& positions,
                std::vector<std::array<std::uint32_t, 3>>& triangles) {
  for (int index = 0; index < kBlockCells; ++index) {
    if (block.weight[static_cast<std::size_t>(index)] == 0) continue;
    const Coordinate here{block.origin[0] + index % kBlock, block.origin[1] + index / kBlock % kBlock,
                          block.origin[2] + index / kBlock / kBlock};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Coordinate there = here;
      ++there[axis];
      std::size_t at = 0;
      const Block* other = grid.find(there, at);
      if (other == nullptr || other->weight[at] == 0) continue;
      const bool starts_inside = block.distance[static_cast<std::size_t>(index)] < 0;
      if (starts_inside == (other->distance[at] < 0)) continue;
      std::uint32_t quad[4];
      int found = 0;
      for (int k = 0; k < 4; ++k) {
        Coordinate around = here;  // the four cells about the edge, in turn
        around[(axis + 1) % 3] -= k == 1 || k == 2;
        around[(axis + 2) % 3] -= k >= 2;
        const Block* owner = grid.find(around, at);
        if (owner == nullptr || owner->vertex[at] < 0) break;
        quad[k] = owner->first_vertex + static_cast<std::uint32_t>(owner->vertex[at]);
        ++found;
      }
      if (found < 4) continue;
      if (!starts_inside) std::swap(quad[1], quad[3]);
      const bool other_diagonal =
          length(positions[quad[1]] - positions[quad[3]]) < length(positions[quad[0]] - positions[quad[2]]);
      if (other_diagonal) {
        triangles.push_back({quad[0], quad[1], quad[3]});
        triangles.push_back({quad[1], quad[2], quad[3]});
      } else {
        triangles.push_back({quad[0], quad[1], quad[2]});
        triangles.push_back({quad[0], quad[2], quad[3]});
      }
    }
  }
}

}  // namespace

FusedMesh fuse_range_images(const std::vector<RangeImage>& images, float cell) {
  Grid grid = blocks_near(images, cell);
  parallel_for(grid.blocks.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) average_distances(grid.blocks[i], images, cell);
  });
  parallel_for(grid.blocks.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) place_vertices(grid.blocks[i], grid, cell);
  });
  FusedMesh mesh;
  for (Block& block : grid.blocks) {
    block.first_vertex = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), block.vertices.begin(), block.vertices.end());
  }
  constexpr std::size_t kPiece = 64;
  std::vector<std::vector<std::array<std::uint32_t, 3>>> pieces((grid.blocks.size() + kPiece - 1) / kPiece);
  parallel_for(grid.blocks.size(), kPiece, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      draw_quads(grid.blocks[i], grid, mesh.positions, pieces[begin / kPiece]);
  });
  for (const auto& piece : pieces) mesh.triangles.insert(mesh.triangles.end(), piece.begin(), piece.end());
  return mesh;
}

}  // namespace rbvh::demo
