#include "pipeline/rbvh/mesh_texture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/layer_grid.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/pack_atlas.h"
#include "pipeline/rbvh/texture_layer.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 10;
/// Texels around each tile, which are those at its edge: what mipmaps mix with it.
constexpr std::uint16_t kGutter = 2;

/// From a point to the leaf's surface over it, scan units; infinite where its tile does not reach. `slack`:
/// texels that it may lie beside the tile.
float distance_to(const Level& level, std::uint32_t leaf, std::uint32_t first, Vec3f point, float slack) {
  constexpr float kNowhere = std::numeric_limits<float>::infinity();
  const RbvhLeaf& tile = level.leaves[leaf];
  const Vec3f at = to_tile(tile, point);
  if (!(at.x >= -slack) || !(at.y >= -slack) || !(at.x <= static_cast<float>(tile.width - 1) + slack) ||
      !(at.y <= static_cast<float>(tile.height - 1) + slack))
    return kNowhere;
  if (first != RBVH_NO_LEAF) return nearest_primitive(level, first, tile.primitives, point).distance;
  const std::optional<Vec3f> over = LeafSurface(level, leaf, first).point(at.x, at.y, slack);
  return over ? length(*over - point) : kNowhere;
}

/// The nearest of the leaves whose boxes are within `reach` of the point; RBVH_NO_LEAF: there is none.
std::uint32_t nearest_leaf(const Level& level, const std::vector<std::uint32_t>& firsts, Vec3f point,
                           float reach) {
  constexpr float kSlack = 2;
  std::uint32_t found = RBVH_NO_LEAF;
  float least = std::numeric_limits<float>::infinity();
  std::vector<std::uint32_t> open = {0};
  while (!open.empty()) {
    const RbvhNode& node = level.nodes[open.back()];
    open.pop_back();
    bool is_near = true;
    for (int axis = 0; axis < 3; ++axis)
      is_near = is_near && point[axis] >= node.lo[axis] - reach && point[axis] <= node.hi[axis] + reach;
    if (!is_near) continue;
    if (node.count == 0) {
      open.push_back(node.first);
      open.push_back(node.first + 1);
      continue;
    }
    const float distance = distance_to(level, node.first, firsts[node.first], point, kSlack);
    if (distance < least || (distance == least && node.first < found)) {
      least = distance;
      found = node.first;
    }
  }
  return found;
}

/// Gives texels without a value the mean of those around that have one, until all have.
void fill_gaps(std::vector<Color8>& texels, std::vector<std::uint8_t>& known, std::size_t width) {
  const auto height = static_cast<std::ptrdiff_t>(texels.size() / width);
  const auto row = static_cast<std::ptrdiff_t>(width);
  std::vector<std::size_t> open, still_open;
  for (std::size_t i = 0; i < known.size(); ++i)
    if (known[i] == 0) open.push_back(i);
  while (!open.empty() && open.size() < known.size()) {
    still_open.clear();
    std::vector<std::pair<std::size_t, Color8>> found;
    for (const std::size_t i : open) {
      const auto x = static_cast<std::ptrdiff_t>(i) % row, y = static_cast<std::ptrdiff_t>(i) / row;
      int sum[3] = {}, count = 0;
      for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        if (x + dx < 0 || x + dx >= row || y + dy < 0 || y + dy >= height) continue;
        const auto k = static_cast<std::size_t>((y + dy) * row + x + dx);
        if (known[k] == 0) continue;
        for (std::size_t c = 0; c < 3; ++c) sum[c] += texels[k][c];
        ++count;
      }
      if (count == 0) {
        still_open.push_back(i);
        continue;
      }
      Color8 mean;
      for (std::size_t c = 0; c < 3; ++c) mean[c] = static_cast<std::uint8_t>(sum[c] / count);
      found.emplace_back(i, mean);
    }
    for (const auto& [i, color] : found) {
      texels[i] = color;
      known[i] = 1;
    }
    std::swap(open, still_open);
  }
}

/// Copies the leaf's tile of the layer into the image, with its gutter, to `to`.
void copy_tile(const Layer& layer, const LayerGrid& grid, const RbvhLeaf& to, TextureImage& image) {
  const std::size_t width = grid.tile.width, height = grid.tile.height;
  std::vector<Color8> texels(width * height);
  std::vector<std::uint8_t> known(texels.size());
  for (std::size_t i = 0; i < texels.size(); ++i) {
    const std::uint16_t* codes =
        &layer.texels[3 * grid.texel(static_cast<int>(i % width), static_cast<int>(i / width))];
    known[i] = codes[0] != 0;
    if (known[i] != 0) texels[i] = texture_bytes(layer, codes);
  }
  fill_gaps(texels, known, width);
  const auto inside = [](std::size_t at, std::size_t size) {
    return std::clamp<std::size_t>(at, kGutter, kGutter + size - 1) - kGutter;
  };
  for (std::size_t y = 0; y < to.height; ++y)
    for (std::size_t x = 0; x < to.width; ++x)
      image.texels[(to.y + y) * image.width + to.x + x] =
          texels[inside(y, height) * width + inside(x, width)];
}

}  // namespace

std::vector<std::uint32_t> textured_leaves(const Level& level, const Scan& mesh) {
  std::vector<std::uint32_t> leaves;
  if (texture_layer(level) == nullptr || mesh.is_cloud()) return leaves;
  leaves.assign(mesh.triangles.size(), RBVH_NO_LEAF);
  if (level.primitive_leaves.size() == level.leaves.size()) {  // the mesh is these, in their order
    for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves)
      std::fill_n(leaves.begin() + leaf.first, level.leaves[leaf.leaf].primitives, leaf.leaf);
    return leaves;
  }
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  const auto side = static_cast<float>(texel_side(level));
  parallel_for(leaves.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Vec3f middle{};
      for (const std::uint32_t v : mesh.triangles[i]) middle = middle + mesh.positions[v] * (1.0f / 3);
      leaves[i] = nearest_leaf(level, firsts, middle, 4 * side);
    }
  });
  return leaves;
}

void add_texture(const Level& level, std::span<const std::uint32_t> leaves, Scan& mesh) {
  const Layer* layer = texture_layer(level);
  RBVH_CHECK(layer != nullptr && leaves.size() == mesh.triangles.size());
  std::vector<std::uint32_t> used(leaves.begin(), leaves.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  if (!used.empty() && used.back() == RBVH_NO_LEAF) used.pop_back();
  if (used.empty()) return;

  std::vector<RbvhLeaf> places(used.size());  // of the tiles in the image
  std::vector<RbvhLeaf*> to_pack;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const LayerTile tile = layer_tile(level, *layer, used[i]);
    places[i].width = static_cast<std::uint16_t>(tile.width + 2 * kGutter);
    places[i].height = static_cast<std::uint16_t>(tile.height + 2 * kGutter);
    to_pack.push_back(&places[i]);
  }
  const AtlasSize size = pack_tiles(to_pack);
  const auto image = std::make_shared<TextureImage>();
  image->name = level.name;
  image->width = size.width;
  image->height = size.height;
  image->texels.assign(std::size_t{size.width} * size.height, Color8{});
  parallel_for(used.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      copy_tile(*layer, LayerGrid(level, *layer, used[i]), places[i], *image);
  });

  mesh.textures = {{.image = image, .wrap_u = TextureWrap::kClamp, .wrap_v = TextureWrap::kClamp}};
  mesh.face_textures.assign(mesh.triangles.size(), {});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (leaves[t] == RBVH_NO_LEAF) continue;
    const auto i =
        static_cast<std::size_t>(std::lower_bound(used.begin(), used.end(), leaves[t]) - used.begin());
    const LayerGrid grid(level, *layer, leaves[t]);
    FaceTexture& face = mesh.face_textures[t];
    face.texture = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const Vec3f at = to_tile(level.leaves[leaves[t]], mesh.positions[mesh.triangles[t][c]]);
      const auto [u, v] = grid.place(at.x, at.y);
      // Texels' centres are half a texel inside, and v goes up.
      const float x = static_cast<float>(places[i].x + kGutter) + u + 0.5f,
                  y = static_cast<float>(places[i].y + kGutter) + v + 0.5f;
      face.corners[c] = {x / static_cast<float>(size.width), 1 - y / static_cast<float>(size.height)};
    }
  }
}

}  // namespace rbvh
