#include "io/leaf_codec.h"

#include <algorithm>
#include <bit>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"

namespace rbvh {
namespace {

/// Of a level without a grid, as older pairs have it: a leaf as it is in memory.
struct WholeLeaf {
  RbvhLeaf leaf;
  float lo[3], hi[3];
  std::uint32_t first;  ///< primitive; RBVH_NO_LEAF: it has a tile
};
static_assert(sizeof(WholeLeaf) == 92);

ByteVector encode_whole_leaves(const Level& level) {
  const std::vector<Bounds3f> boxes = leaf_boxes(level);
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::vector<WholeLeaf> leaves(level.leaves.size());
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    leaves[i].leaf = level.leaves[i];
    std::copy_n(&boxes[i].lo.x, 3, leaves[i].lo);
    std::copy_n(&boxes[i].hi.x, 3, leaves[i].hi);
    leaves[i].first = firsts[i];
  }
  return encode_vertices(leaves);
}

bool decode_whole_leaves(const ByteVector& packed, const LevelCounts& counts, Level& level,
                         std::vector<Bounds3f>& boxes) {
  std::vector<WholeLeaf> leaves;
  if (!decode_vertices(packed, counts.leaves, leaves)) return false;
  for (std::uint32_t i = 0; i < leaves.size(); ++i) {
    level.leaves.push_back(leaves[i].leaf);
    boxes.push_back({{leaves[i].lo[0], leaves[i].lo[1], leaves[i].lo[2]},
                     {leaves[i].hi[0], leaves[i].hi[1], leaves[i].hi[2]}});
    if (leaves[i].first != RBVH_NO_LEAF) level.primitive_leaves.push_back({i, leaves[i].first});
  }
  return level.primitive_leaves.size() == counts.primitive_leaves;
}

/// The columns of a tile's numbers that differ little from leaf to leaf.
constexpr std::size_t kSigned = 9;  // corner, box

constexpr std::size_t kLeafBytes = 9, kTileBytes = 4 + 3 * 2 + 2 * 2 + 4 * 2 + kSigned * 4;

}  // namespace

// --- the tree: for each node, depth first and left child first, one bit: 1 inner, 0 leaf

ByteVector encode_tree(const Level& level, const std::string& path) {
  std::vector<bool> bits;
  std::vector<std::uint32_t> stack = {0};
  std::uint32_t next_leaf = 0;
  while (!stack.empty()) {
    const RbvhNode& node = level.nodes[stack.back()];
    stack.pop_back();
    bits.push_back(node.count == 0);
    if (node.count == 0) {
      stack.push_back(node.first + 1);
      stack.push_back(node.first);
    } else if (node.first != next_leaf++) {
      throw Error(ErrorKind::kFailure, path,
                  "cannot be written: the leaves of level " + level.name +
                      " are not numbered from left to right; build the pair again");
    }
  }
  ByteVector raw((bits.size() + 7) / 8);
  for (std::size_t i = 0; i < bits.size(); ++i)
    if (bits[i]) raw[i / 8] |= static_cast<std::uint8_t>(1 << (i % 8));
  return compress(raw);
}

bool decode_tree(const ByteVector& packed, const std::vector<Bounds3f>& boxes, Level& level) {
  const std::size_t nodes = 2 * boxes.size() - 1;
  ByteVector raw;
  if (!decompress(packed, (nodes + 7) / 8, raw) || raw.size() != (nodes + 7) / 8) return false;
  level.nodes.assign(1, {});
  struct Open {
    std::uint32_t node;
    int depth;
  };
  std::vector<Open> stack = {{0, 0}};
  std::uint32_t next_leaf = 0;
  for (std::size_t i = 0; i < nodes; ++i) {
    if (stack.empty()) return false;
    const auto [number, depth] = stack.back();
    stack.pop_back();
    RbvhNode& node = level.nodes[number];
    if ((raw[i / 8] >> (i % 8) & 1) == 0) {
      if (next_leaf >= boxes.size()) return false;
      node.first = next_leaf++;
      node.count = 1;
      continue;
    }
    const auto left = static_cast<std::uint32_t>(level.nodes.size());
    if (depth >= kMaxLeafHierarchyDepth || left + 2 > nodes) return false;
    node.first = left;
    level.nodes.resize(left + 2);
    stack.push_back({left + 1, depth + 1});
    stack.push_back({left, depth + 1});
  }
  if (!stack.empty() || next_leaf != boxes.size()) return false;
  for (std::size_t i = nodes; i-- > 0;) {  // children come after their parents
    RbvhNode& node = level.nodes[i];
    Bounds3f box;
    if (node.count == 1) {
      box = boxes[node.first];
    } else {
      for (const std::uint32_t child : {node.first, node.first + 1}) {
        const RbvhNode& c = level.nodes[child];
        box.add(Bounds3f{{c.lo[0], c.lo[1], c.lo[2]}, {c.hi[0], c.hi[1], c.hi[2]}});
      }
    }
    std::copy_n(&box.lo.x, 3, node.lo);
    std::copy_n(&box.hi.x, 3, node.hi);
  }
  return true;
}

// --- leaves

ByteVector encode_leaves(const Level& level) {
  if (!(level.grid.box_step > 0)) return encode_whole_leaves(level);
  const LeafGrid& grid = level.grid;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::vector<std::uint8_t> kinds;  // 0: primitives; else 1 + largest + 4 * left-handed
  std::vector<std::uint32_t> primitives, objects, quanta, numbers[kSigned];
  std::vector<std::uint16_t> rotation[3], texels[2], places[4];
  std::int32_t before[kSigned] = {};
  const std::vector<Bounds3f> boxes = leaf_boxes(level);
  for (std::size_t i = 0; i < level.leaves.size(); ++i) {
    const RbvhLeaf& leaf = level.leaves[i];
    primitives.push_back(leaf.primitives);
    objects.push_back(leaf.object_id);
    if (firsts[i] != RBVH_NO_LEAF) {
      kinds.push_back(0);
      continue;
    }
    const RoundedFrame frame = round_frame(grid, leaf.to_tile);
    kinds.push_back(static_cast<std::uint8_t>(1 + frame.largest + 4 * frame.is_left_handed));
    for (std::size_t k = 0; k < 3; ++k) rotation[k].push_back(static_cast<std::uint16_t>(frame.rotation[k]));
    for (std::size_t k = 0; k < 2; ++k) texels[k].push_back(frame.texels[k]);
    quanta.push_back(std::bit_cast<std::uint32_t>(frame.quantum));
    const std::uint16_t place[4] = {leaf.x, leaf.y, leaf.width, leaf.height};
    for (std::size_t k = 0; k < 4; ++k) places[k].push_back(place[k]);
    const RoundedBox box = round_box(grid, boxes[i]);
    for (std::size_t k = 0; k < kSigned; ++k) {
      // A box's upper end as its extent; its lower end and the frame's corner beside those of the leaf
      // before.
      const std::int32_t value = k < 3 ? frame.corner[k] : box[k - 3];
      numbers[k].push_back(zigzag(value, k < 6 ? before[k] : box[k - 6]));
      before[k] = value;
    }
  }
  Columns columns;
  columns.add(kinds);
  columns.add(primitives);
  columns.add(objects);
  columns.add(quanta);
  for (const auto& column : rotation) columns.add(column);
  for (const auto& column : texels) columns.add(column);
  for (const auto& column : places) columns.add(column);
  for (const auto& column : numbers) columns.add(column);
  return compress(columns.raw);
}

bool decode_leaves(const ByteVector& packed, const LevelCounts& counts, Level& level,
                   std::vector<Bounds3f>& boxes) {
  if (!(level.grid.box_step > 0)) return decode_whole_leaves(packed, counts, level, boxes);
  const std::size_t tiles = counts.leaves - counts.primitive_leaves,
                    size = counts.leaves * kLeafBytes + tiles * kTileBytes;
  ByteVector raw;
  if (!decompress(packed, size, raw) || raw.size() != size) return false;
  const LeafGrid& grid = level.grid;
  ColumnReader reader(raw);
  const auto kinds = reader.take<std::uint8_t>(counts.leaves);
  const auto primitives = reader.take<std::uint32_t>(counts.leaves),
             objects = reader.take<std::uint32_t>(counts.leaves);
  const auto quanta = reader.take<std::uint32_t>(tiles);
  std::vector<std::uint16_t> rotation[3], texels[2], places[4];
  std::vector<std::uint32_t> numbers[kSigned];
  for (auto& column : rotation) column = reader.take<std::uint16_t>(tiles);
  for (auto& column : texels) column = reader.take<std::uint16_t>(tiles);
  for (auto& column : places) column = reader.take<std::uint16_t>(tiles);
  for (auto& column : numbers) column = reader.take<std::uint32_t>(tiles);
  std::int32_t before[kSigned] = {};
  std::uint64_t first = 0;
  std::size_t t = 0;
  for (std::uint32_t i = 0; i < counts.leaves; ++i) {
    RbvhLeaf& leaf = level.leaves.emplace_back();
    leaf.primitives = primitives[i];
    leaf.object_id = objects[i];
    boxes.emplace_back();
    if (kinds[i] == 0) {
      if (level.primitive_leaves.size() == counts.primitive_leaves || first > 0xffffffffu) return false;
      level.primitive_leaves.push_back({i, static_cast<std::uint32_t>(first)});
      first += leaf.primitives;
      continue;
    }
    if (t == tiles || kinds[i] > 8) return false;
    RoundedFrame frame;
    frame.largest = static_cast<std::uint8_t>((kinds[i] - 1) & 3);
    frame.is_left_handed = static_cast<std::uint8_t>((kinds[i] - 1) >> 2);
    for (std::size_t k = 0; k < 3; ++k) frame.rotation[k] = static_cast<std::int16_t>(rotation[k][t]);
    frame.texels = {texels[0][t], texels[1][t]};
    frame.quantum = std::bit_cast<float>(quanta[t]);
    RoundedBox box{};
    for (std::size_t k = 0; k < kSigned; ++k) {
      const std::int32_t value = unzigzag(numbers[k][t], k < 6 ? before[k] : box[k - 6]);
      (k < 3 ? frame.corner[k] : box[k - 3]) = value;
      before[k] = value;
    }
    unround_frame(grid, frame, leaf.to_tile);
    boxes.back() = unround_box(grid, box);
    leaf.x = places[0][t];
    leaf.y = places[1][t];
    leaf.width = places[2][t];
    leaf.height = places[3][t++];
  }
  return t == tiles && level.primitive_leaves.size() == counts.primitive_leaves;
}

}  // namespace rbvh
