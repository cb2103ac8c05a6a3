#include "io/rbvh_file_v1.h"

#include <algorithm>
#include <cmath>

#include "io/rbvh_tables.h"
#include "pipeline/base/error.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/vertex_normals.h"
#include "rbvh_file_v1_generated.h"

namespace rbvh {
namespace {

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::kInput, path, "is malformed: " + what + "; build the pair again");
}

// FlatBuffers lets many tables share one vector: what they hold in all must still be bounded by the file.
bool fits_file(const file_v1::Pair& pair, std::uint64_t file_bytes) {
  constexpr std::size_t kMost = 32;
  if (pair.levels()->size() > kMost) return false;
  std::uint64_t bytes = 0;
  for (const file_v1::Level* level : *pair.levels()) {
    if (level->layers()->size() > kMost) return false;
    bytes += std::uint64_t{level->nodes()->size()} * sizeof(file_v1::Node) +
             std::uint64_t{level->leaves()->size()} * sizeof(file_v1::Leaf);
    if (level->exact_leaves() != nullptr)
      bytes += std::uint64_t{level->exact_leaves()->size()} * sizeof(file_v1::ExactLeaf);
    if (level->exact_primitives() != nullptr)
      bytes += std::uint64_t{level->exact_primitives()->size()} * sizeof(file_v1::Primitive);
    for (const file_v1::Layer* layer : *level->layers())
      if (layer->tiles() != nullptr) bytes += std::uint64_t{layer->tiles()->size()} * sizeof(LayerTile);
  }
  return bytes <= file_bytes;
}

/// A primitive is nine floats: a triangle's corners, or a disc's centre, radius, normal and two zeros.
void take_primitives(const std::vector<RbvhPrimitive>& shapes, bool discs, Scan& primitives) {
  for (const RbvhPrimitive& primitive : shapes) {
    const float* s = primitive.shape;
    if (discs) {
      primitives.positions.push_back({s[0], s[1], s[2]});
      primitives.radii.push_back(s[3]);
      primitives.normals.push_back({s[4], s[5], s[6]});
      continue;
    }
    const auto first = static_cast<std::uint32_t>(primitives.positions.size());
    for (const auto* corner = s; corner < s + 9; corner += 3)
      primitives.positions.push_back({corner[0], corner[1], corner[2]});
    primitives.triangles.push_back({first, first + 1, first + 2});
  }
  if (!discs) primitives.normals.resize(primitives.positions.size());
}

/// What follows relies on: leaves of primitives are there, and have a place in the atlas as all others.
const char* find_place_fault(const Level& level) {
  for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves)
    if (leaf.leaf >= level.leaves.size()) return "a leaf has primitives that is not there";
  for (const RbvhLeaf& leaf : level.leaves)
    if (leaf.width < 2 || leaf.height < 2 || std::uint32_t{leaf.x} + leaf.width > level.atlas_width ||
        std::uint32_t{leaf.y} + leaf.height > level.atlas_height)
      return "a leaf has a tile that is too small or extends beyond the atlas";
  return nullptr;
}

std::uint64_t tile_texels(const Level& level) {
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::uint64_t texels = 0;
  for (std::size_t i = 0; i < level.leaves.size(); ++i)
    if (firsts[i] == RBVH_NO_LEAF) texels += std::uint64_t{level.leaves[i].width} * level.leaves[i].height;
  return texels;
}

/// A user's layer may have had the level's atlas, in which leaves of primitives had places then.
void give_layers_tiles(Level& level) {
  if (level.primitive_leaves.empty()) return;
  for (Layer& layer : level.layers) {
    if (layer_kind(layer.name) != LayerKind::kUser || !layer.tiles.empty()) continue;
    layer.width = level.atlas_width;
    layer.height = level.atlas_height;
    for (const RbvhLeaf& leaf : level.leaves)
      layer.tiles.push_back({leaf.x, leaf.y, leaf.width, leaf.height});
  }
}

}  // namespace

Rbvh decode_hierarchy_v1(std::span<const std::byte> file, flatbuffers::Verifier& verifier,
                         const std::string& path, PairHeader& header) {
  if (!file_v1::VerifyPairBuffer(verifier)) refuse(path, "its tables do not hang together");
  const file_v1::Pair& pair = *file_v1::GetPair(file.data());
  if (!fits_file(pair, file.size()))
    refuse(path, "it claims more levels, layers, nodes or leaves than it has room for");
  Rbvh rbvh;
  take_pair(pair, rbvh, header);
  for (const file_v1::Level* from : *pair.levels()) {
    Level& level = rbvh.levels.emplace_back();
    take_level(*from, level);
    level.nodes = to_structs<RbvhNode>(from->nodes());
    level.leaves = to_structs<RbvhLeaf>(from->leaves());
    level.primitive_leaves = to_structs<RbvhPrimitiveLeaf>(from->exact_leaves());
    take_primitives(to_structs<RbvhPrimitive>(from->exact_primitives()), from->exact_discs(),
                    level.primitives);
    level.streams = {.tree = from->nodes()->size() * sizeof(RbvhNode),
                     .leaves = level.leaves.size() * sizeof(RbvhLeaf) +
                               level.primitive_leaves.size() * sizeof(RbvhPrimitiveLeaf),
                     .positions = primitive_count(level) * sizeof(RbvhPrimitive)};
    level.stored_bytes = level.streams.tree + level.streams.leaves + level.streams.positions +
                         layer_tile_bytes(level) + from->atlas_bytes();
    if (find_layer(level, "color") != nullptr)
      level.primitives.colors.resize(level.primitives.positions.size());
    if (const char* fault = find_place_fault(level)) refuse(path, fault);
    give_layers_tiles(level);
    // Those of leaves of primitives were counted as well.
    level.texels_used = std::min(level.texels_used, tile_texels(level));
  }
  return rbvh;
}

void give_vertices_attributes(Rbvh& rbvh) {
  for (Level& level : rbvh.levels) {
    Scan& primitives = level.primitives;
    if (primitives.positions.empty()) continue;
    const Layer *normals = find_layer(level, "normal"), *colors = find_layer(level, "color");
    const std::vector<Vec3f> own = holds_discs(level) ? primitives.normals : vertex_normals(primitives);
    for (const RbvhPrimitiveLeaf& of : level.primitive_leaves) {
      const RbvhLeaf& leaf = level.leaves[of.leaf];  // inside the atlas: find_place_fault()
      for (std::uint32_t i = of.first; i < of.first + leaf.primitives; ++i)
        for (const std::uint32_t vertex : primitive_corners(primitives, i)) {
          const Vec3f at = to_tile(leaf, primitives.positions[vertex]);
          const auto place = [](float value, int size) {
            if (!(value > 0)) return std::size_t{0};  // NaN as well: products may overflow
            return static_cast<std::size_t>(std::min(value + 0.5f, static_cast<float>(size - 1)));
          };
          const std::size_t texel =
              (leaf.y + place(at.y, leaf.height)) * level.atlas_width + leaf.x + place(at.x, leaf.width);
          const Vec3f stored = normals != nullptr && normals->texels[texel] != 0
                                   ? unpack_normal(normals->texels[texel])
                                   : Vec3f{};
          // A leaf has primitives that its texels do not show.
          primitives.normals[vertex] = dot(stored, own[vertex]) > 0.5f ? stored : own[vertex];
          if (colors == nullptr) continue;
          const Vec3f c = unpack_srgb(colors->texels[texel]) * 255.0f + Vec3f{0.5f, 0.5f, 0.5f};
          primitives.colors[vertex] = {static_cast<std::uint8_t>(c.x), static_cast<std::uint8_t>(c.y),
                                       static_cast<std::uint8_t>(c.z)};
        }
    }
  }
}

}  // namespace rbvh
