#include "io/level_codec.h"

#include <meshoptimizer.h>
#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "pipeline/base/error.h"
#include "pipeline/bvh/top_tree.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/vertex_normals.h"

namespace rbvh {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Measured on the dragon's five levels: level 9 gives 1% more than 19 in a tenth of the time.
constexpr int kZstdLevel = 9;
/// What a byte of a stream can become at most, as of the atlas.
constexpr std::uint64_t kMaxExpansion = 1100;

[[noreturn]] void refuse(const std::string& path, const Level& level, const char* what) {
  throw Error(ErrorKind::kInput, path,
              "is malformed: level " + level.name + ": its stream of " + what +
                  " cannot be decoded; build the pair again");
}

Bytes compress(const Bytes& raw) {
  Bytes packed(ZSTD_compressBound(raw.size()));
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), raw.data(), raw.size(), kZstdLevel);
  if (ZSTD_isError(size) != 0) throw std::bad_alloc();
  packed.resize(size);
  return packed;
}

/// False where the stream is not whole, or would have more than `most` bytes.
bool decompress(const Bytes& packed, std::size_t most, Bytes& raw) {
  const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN || size > most) return false;
  raw.resize(static_cast<std::size_t>(size));
  return ZSTD_decompress(raw.data(), raw.size(), packed.data(), packed.size()) == size;
}

/// Values as columns of bytes, the lowest of all values first: like bytes lie together and compress well.
class Columns {
 public:
  /// `bytes`: of each value.
  template <class T>
  void add(const std::vector<T>& values, std::size_t bytes = sizeof(T)) {
    for (std::size_t byte = 0; byte < bytes; ++byte)
      for (const T value : values)
        raw.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * byte)));
  }
  Bytes raw;
};

class ColumnReader {
 public:
  explicit ColumnReader(const Bytes& raw) : raw_(raw) {}

  template <class T>
  std::vector<T> take(std::size_t count) {
    std::vector<T> values(count);
    for (std::size_t byte = 0; byte < sizeof(T); ++byte)
      for (T& value : values)
        value = static_cast<T>(value | static_cast<T>(static_cast<T>(raw_.at(at_++)) << (8 * byte)));
    return values;
  }

 private:
  const Bytes& raw_;
  std::size_t at_ = 0;
};

/// Differences to the value before, small ones of either sign as small numbers.
std::uint32_t zigzag(std::int32_t value, std::int32_t before) {
  const auto difference = static_cast<std::uint32_t>(value) - static_cast<std::uint32_t>(before);
  return (difference << 1) ^ (0u - (difference >> 31));
}
std::int32_t unzigzag(std::uint32_t code, std::int32_t before) {
  const std::uint32_t difference = (code >> 1) ^ (0u - (code & 1));
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(before) + difference);
}

/// The count behind the values in four bytes: the codec alone pads to groups of 16 and would take a wrong
/// one.
template <class T>
Bytes encode_vertices(const std::vector<T>& values) {
  static_assert(sizeof(T) % 4 == 0);
  Bytes raw(meshopt_encodeVertexBufferBound(values.size(), sizeof(T)));
  raw.resize(meshopt_encodeVertexBuffer(raw.data(), raw.size(), values.data(), values.size(), sizeof(T)));
  for (int byte = 0; byte < 4; ++byte) raw.push_back(static_cast<std::uint8_t>(values.size() >> (8 * byte)));
  return compress(raw);
}

template <class T>
bool decode_vertices(const Bytes& packed, std::size_t count, std::vector<T>& values) {
  Bytes raw;
  if (!decompress(packed, meshopt_encodeVertexBufferBound(count, sizeof(T)) + 4, raw) || raw.size() < 4)
    return false;
  for (int byte = 3; byte >= 0; --byte) {
    if (raw.back() != static_cast<std::uint8_t>(count >> (8 * byte))) return false;
    raw.pop_back();
  }
  values.resize(count);
  return meshopt_decodeVertexBuffer(values.data(), count, sizeof(T), raw.data(), raw.size()) == 0;
}

// --- the tree: for each node, depth first and left child first, one bit: 1 inner, 0 leaf

Bytes encode_tree(const Level& level, const std::string& path) {
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
  Bytes raw((bits.size() + 7) / 8);
  for (std::size_t i = 0; i < bits.size(); ++i)
    if (bits[i]) raw[i / 8] |= static_cast<std::uint8_t>(1 << (i % 8));
  return compress(raw);
}

/// Nodes with the boxes of the leaves, numbered as build_top_tree() does.
bool decode_tree(const Bytes& packed, const std::vector<Bounds3f>& boxes, Level& level) {
  const std::size_t nodes = 2 * boxes.size() - 1;
  Bytes raw;
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
    if (depth >= kMaxTopTreeDepth || left + 2 > nodes) return false;
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

std::vector<Bounds3f> leaf_boxes(const Level& level) {
  std::vector<Bounds3f> boxes(level.leaves.size());
  for (const RbvhNode& node : level.nodes)
    if (node.count == 1)
      boxes[node.first] = {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
  return boxes;
}

/// Of a level without a grid, as older pairs have it: a leaf as it is in memory.
struct WholeLeaf {
  RbvhLeaf leaf;
  float lo[3], hi[3];
  std::uint32_t first;  ///< primitive; RBVH_NO_LEAF: it has a tile
};
static_assert(sizeof(WholeLeaf) == 92);

Bytes encode_whole_leaves(const Level& level) {
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

bool decode_whole_leaves(const Bytes& packed, const LevelCounts& counts, Level& level,
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

Bytes encode_leaves(const Level& level) {
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

constexpr std::size_t kLeafBytes = 9, kTileBytes = 4 + 3 * 2 + 2 * 2 + 4 * 2 + kSigned * 4;

/// `boxes`: of the tiles; those of leaves of primitives are left empty.
bool decode_leaves(const Bytes& packed, const LevelCounts& counts, Level& level,
                   std::vector<Bounds3f>& boxes) {
  if (!(level.grid.box_step > 0)) return decode_whole_leaves(packed, counts, level, boxes);
  const std::size_t tiles = counts.leaves - counts.primitive_leaves,
                    size = counts.leaves * kLeafBytes + tiles * kTileBytes;
  Bytes raw;
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

// --- vertices and triangles

struct LatticePoint {
  std::uint32_t bits[3];  ///< whole numbers, or floats where there is no lattice
};

LatticePoint to_lattice(const Lattice& lattice, Vec3f p) {
  LatticePoint point;
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    if (!(lattice.step > 0)) {
      point.bits[k] = std::bit_cast<std::uint32_t>(p[axis]);
      continue;
    }
    const float at = std::round((p[axis] - lattice.origin[axis]) / lattice.step);
    point.bits[k] = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::clamp(at, -2e9f, 2e9f)));
  }
  return point;
}

/// Where a vertex is guessed to be: at a + b - c, of vertices that are known.
struct Guess {
  std::uint32_t a, b, c;

  std::int32_t along(const std::vector<LatticePoint>& points, std::size_t axis) const {
    const auto at = [&](std::uint32_t i) { return points[i].bits[axis]; };  // whole numbers, modulo 2^32
    return a == RBVH_NO_LEAF ? 0 : static_cast<std::int32_t>(at(a) + at(b) - at(c));
  }
};

/// Calls `visit(vertex, guess)` for each vertex in the order of first use, and then for those that no
/// triangle uses. Across an edge of a triangle that is known lies the corner of a parallelogram (Touma &
/// Gotsman 1998); a vertex without such an edge lies near the one before it.
template <class Visit>
void for_each_vertex(const std::vector<Triangle>& triangles, std::uint32_t vertices, Visit&& visit) {
  struct Edge {
    std::uint32_t from = RBVH_NO_LEAF, to = RBVH_NO_LEAF, opposite = 0;  // as seen from its other side
  };
  // Of the edges that share a slot the last one: a table of all would take more memory than the level.
  std::vector<Edge> edges(1 << 16);
  const auto slot = [&](std::uint32_t from, std::uint32_t to) -> Edge& {
    return edges[(from * 0x9e3779b1u ^ to * 0x85ebca6bu) >> 16];
  };
  std::vector<bool> is_known(vertices);
  std::uint32_t before = RBVH_NO_LEAF;
  const auto visit_next = [&](std::uint32_t vertex, const Guess& guess) {
    visit(vertex, guess);
    is_known[vertex] = true;
    before = vertex;
  };
  for (const Triangle& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (is_known[t[k]]) continue;
      const std::uint32_t a = t[(k + 1) % 3], b = t[(k + 2) % 3];
      const Edge& edge = slot(a, b);
      const bool is_across = edge.from == a && edge.to == b;
      visit_next(t[k], is_across ? Guess{a, b, edge.opposite} : Guess{before, before, before});
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = t[(k + 1) % 3], to = t[k];
      slot(from, to) = {from, to, t[(k + 2) % 3]};
    }
  }
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex)
    if (!is_known[vertex]) visit_next(vertex, {before, before, before});
}

Vec3f from_lattice(const Lattice& lattice, const LatticePoint& point) {
  Vec3f p;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t bits = point.bits[static_cast<std::size_t>(axis)];
    p[axis] = lattice.step > 0
                  ? lattice.origin[axis] + static_cast<float>(static_cast<std::int32_t>(bits)) * lattice.step
                  : std::bit_cast<float>(bits);
  }
  return p;
}

/// What is added to the guesses; without a lattice the floats.
Bytes encode_positions(const Scan& primitives, const Lattice& lattice) {
  std::vector<LatticePoint> points;
  for (const Vec3f& p : primitives.positions) points.push_back(to_lattice(lattice, p));
  if (!(lattice.step > 0)) return encode_vertices(points);
  std::vector<std::uint32_t> residuals[3];
  const auto count = static_cast<std::uint32_t>(points.size());
  for_each_vertex(primitives.triangles, count, [&](std::uint32_t vertex, const Guess& guess) {
    for (std::size_t k = 0; k < 3; ++k)
      residuals[k].push_back(
          zigzag(static_cast<std::int32_t>(points[vertex].bits[k]), guess.along(points, k)));
  });
  Columns columns;
  for (const auto& column : residuals) columns.add(column);
  return compress(columns.raw);
}

bool decode_positions(const Bytes& packed, std::size_t count, const Lattice& lattice, Scan& primitives) {
  std::vector<LatticePoint> points;
  if (!(lattice.step > 0)) {
    if (!decode_vertices(packed, count, points)) return false;
  } else {
    Bytes raw;
    if (!decompress(packed, 12 * count, raw) || raw.size() != 12 * count) return false;
    ColumnReader reader(raw);
    std::vector<std::uint32_t> residuals[3];
    for (auto& column : residuals) column = reader.take<std::uint32_t>(count);
    points.resize(count);
    std::size_t next = 0;
    for_each_vertex(primitives.triangles, static_cast<std::uint32_t>(count),
                    [&](std::uint32_t vertex, const Guess& guess) {
                      for (std::size_t k = 0; k < 3; ++k)
                        points[vertex].bits[k] =
                            static_cast<std::uint32_t>(unzigzag(residuals[k][next], guess.along(points, k)));
                      ++next;
                    });
  }
  for (const LatticePoint& point : points) {
    const Vec3f p = from_lattice(lattice, point);
    // Frames and boxes are computed from these before find_fault() sees them.
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(p[axis]) <= kLargestValue)) return false;
    primitives.positions.push_back(p);
  }
  return true;
}

/// Of a mesh, a normal that its triangles do not give; 0: they do.
std::vector<std::uint16_t> stored_normals(const Scan& primitives) {
  const std::vector<Vec3f> own =
      primitives.radii.empty() ? vertex_normals(primitives) : std::vector<Vec3f>(primitives.normals.size());
  std::vector<std::uint16_t> codes(own.size());
  for (std::size_t i = 0; i < own.size(); ++i)
    if (primitives.normals[i] != own[i]) codes[i] = pack_normal(primitives.normals[i]);
  return codes;
}

Bytes encode_columns(const std::vector<std::uint16_t>& values) {
  Columns columns;
  columns.add(values);
  return compress(columns.raw);
}

bool decode_columns(const Bytes& packed, std::size_t count, std::vector<std::uint16_t>& values) {
  Bytes raw;
  if (!decompress(packed, 2 * count, raw) || raw.size() != 2 * count) return false;
  values = ColumnReader(raw).take<std::uint16_t>(count);
  return true;
}

/// Without a lattice, normals are the floats that they are.
Bytes encode_normals(const Scan& primitives, const Lattice& lattice) {
  return lattice.step > 0 ? encode_columns(stored_normals(primitives)) : encode_vertices(primitives.normals);
}

/// The radii and triangles are known.
bool decode_normals(const Bytes& packed, std::size_t count, const Lattice& lattice, Scan& primitives) {
  if (!(lattice.step > 0)) {
    if (!decode_vertices(packed, count, primitives.normals)) return false;
    // Frames are computed from these before find_fault() sees them.
    return std::all_of(primitives.normals.begin(), primitives.normals.end(),
                       [](const Vec3f& n) { return dot(n, n) < 2; });
  }
  std::vector<std::uint16_t> codes;
  if (!decode_columns(packed, count, codes)) return false;
  primitives.normals =
      primitives.radii.empty() ? vertex_normals(primitives) : std::vector<Vec3f>(count, Vec3f{0, 0, 1});
  for (std::size_t i = 0; i < codes.size(); ++i)
    if (codes[i] != 0) primitives.normals[i] = unpack_normal(codes[i]);
  return true;
}

/// Without a lattice, radii are the floats that they are.
Bytes encode_radii(const std::vector<float>& radii, const Lattice& lattice) {
  if (!(lattice.step > 0)) return encode_vertices(radii);
  std::vector<std::uint16_t> codes;
  for (const float r : radii) codes.push_back(round_radius(r));
  return encode_columns(codes);
}

bool decode_radii(const Bytes& packed, std::size_t count, const Lattice& lattice, std::vector<float>& radii) {
  if (!(lattice.step > 0)) {
    if (!decode_vertices(packed, count, radii)) return false;
  } else {
    std::vector<std::uint16_t> codes;
    if (!decode_columns(packed, count, codes)) return false;
    for (const std::uint16_t code : codes) radii.push_back(unround_radius(code));
  }
  return std::all_of(radii.begin(), radii.end(), [](float r) { return r >= 0 && r <= kLargestValue; });
}

struct PaddedColor {
  std::uint8_t rgb[4];
};

Bytes encode_triangles(const Scan& primitives) {
  const auto* indices = reinterpret_cast<const unsigned int*>(primitives.triangles.data());
  const std::size_t count = 3 * primitives.triangles.size();
  Bytes raw(meshopt_encodeIndexBufferBound(count, primitives.positions.size()));
  raw.resize(meshopt_encodeIndexBuffer(raw.data(), raw.size(), indices, count));
  return compress(raw);
}

void encode_primitives(const Scan& unrotated, const Lattice& lattice, LevelStreams& streams) {
  Scan primitives = unrotated;
  rotate_as_stored(primitives);  // positions and normals follow from the triangles as a reader has them
  streams.positions = encode_positions(primitives, lattice);
  streams.normals = encode_normals(primitives, lattice);
  if (!primitives.colors.empty()) {
    std::vector<PaddedColor> colors;
    for (const Color8& c : primitives.colors) colors.push_back({{c[0], c[1], c[2], 0}});
    streams.colors = encode_vertices(colors);
  }
  if (!primitives.radii.empty()) {
    streams.radii = encode_radii(primitives.radii, lattice);
  } else {
    streams.triangles = encode_triangles(unrotated);
  }
}

/// In memory.
std::uint64_t decoded_bytes(const LevelCounts& counts) {
  return counts.leaves * std::uint64_t{sizeof(RbvhLeaf) + 2 * sizeof(RbvhNode)} +
         counts.vertices * std::uint64_t{32} + counts.triangles * std::uint64_t{sizeof(Triangle)};
}

/// A frame that decoders skip, of at least that many bytes.
void pad(Bytes& packed, std::uint64_t bytes) {
  constexpr std::uint32_t kSkipped = ZSTD_MAGIC_SKIPPABLE_START;
  const auto size = static_cast<std::uint32_t>(bytes);
  for (const std::uint32_t word : {kSkipped, size})
    for (int byte = 0; byte < 4; ++byte) packed.push_back(static_cast<std::uint8_t>(word >> (8 * byte)));
  packed.resize(packed.size() + size);
}

}  // namespace

LevelCounts level_counts(const Level& level) {
  return {static_cast<std::uint32_t>(level.leaves.size()),
          static_cast<std::uint32_t>(level.primitive_leaves.size()),
          static_cast<std::uint32_t>(level.primitives.positions.size()),
          static_cast<std::uint32_t>(level.primitives.triangles.size())};
}

std::uint64_t stream_bytes(const LevelStreams& s) {
  return s.tree.size() + s.leaves.size() + s.positions.size() + s.normals.size() + s.colors.size() +
         s.radii.size() + s.triangles.size();
}

StreamBytes bytes_by_stream(const LevelStreams& s) {
  return {.tree = s.tree.size(),
          .leaves = s.leaves.size(),
          .positions = s.positions.size(),
          .normals = s.normals.size(),
          .colors = s.colors.size(),
          .radii = s.radii.size(),
          .triangles = s.triangles.size()};
}

LevelStreams encode_streams(const Level& level, const std::string& path) {
  LevelStreams streams;
  streams.tree = encode_tree(level, path);
  streams.leaves = encode_leaves(level);
  if (!level.primitives.positions.empty()) encode_primitives(level.primitives, level.lattice, streams);
  const std::uint64_t bytes = stream_bytes(streams),
                      least = decoded_bytes(level_counts(level)) / kMaxExpansion + 1;
  if (bytes < least) pad(streams.leaves, least - bytes);
  return streams;
}

void decode_streams(const LevelStreams& streams, const LevelCounts& counts, double area,
                    const std::string& path, Level& level) {
  if (decoded_bytes(counts) > kMaxExpansion * stream_bytes(streams)) refuse(path, level, "leaves");
  if (counts.leaves == 0 || counts.primitive_leaves > counts.leaves) refuse(path, level, "leaves");
  std::vector<Bounds3f> boxes;
  if (!decode_leaves(streams.leaves, counts, level, boxes)) refuse(path, level, "leaves");
  Scan& primitives = level.primitives;
  if (!streams.colors.empty()) {
    std::vector<PaddedColor> colors;
    if (!decode_vertices(streams.colors, counts.vertices, colors)) refuse(path, level, "colours");
    for (const PaddedColor& c : colors) primitives.colors.push_back({c.rgb[0], c.rgb[1], c.rgb[2]});
  }
  if (!streams.radii.empty() &&
      !decode_radii(streams.radii, counts.vertices, level.lattice, primitives.radii))
    refuse(path, level, "radii");
  if (counts.triangles > 0) {
    Bytes raw;
    const std::size_t indices = 3 * std::size_t{counts.triangles};
    primitives.triangles.resize(counts.triangles);
    if (!decompress(streams.triangles, meshopt_encodeIndexBufferBound(indices, counts.vertices), raw) ||
        meshopt_decodeIndexBuffer(primitives.triangles.data(), indices, sizeof(unsigned int), raw.data(),
                                  raw.size()) != 0)
      refuse(path, level, "triangles");
    for (const Triangle& t : primitives.triangles)
      for (const std::uint32_t vertex : t)
        if (vertex >= counts.vertices) refuse(path, level, "triangles");
  }
  if (counts.vertices > 0 && !decode_positions(streams.positions, counts.vertices, level.lattice, primitives))
    refuse(path, level, "positions");
  if (counts.vertices > 0 && !decode_normals(streams.normals, counts.vertices, level.lattice, primitives))
    refuse(path, level, "normals");
  for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves) {
    RbvhLeaf& own = level.leaves[leaf.leaf];
    if (own.primitives == 0 || std::uint64_t{leaf.first} + own.primitives > primitive_count(level))
      refuse(path, level, "leaves");
    if (!(level.grid.box_step > 0)) continue;
    for (std::uint32_t i = 0; i < own.primitives; ++i)
      boxes[leaf.leaf].add(primitive_bounds(primitives, leaf.first + i));
    fit_frame(primitives, leaf.first, primitive_texel(area, level.rho), own);
  }
  if (!decode_tree(streams.tree, boxes, level)) refuse(path, level, "nodes");
}

}  // namespace rbvh
