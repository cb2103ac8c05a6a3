#include "io/level_codec.h"

#include <meshoptimizer.h>
#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "io/max_expansion.h"
#include "pipeline/base/error.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/vertex_normals.h"

namespace rbvh {
namespace {

[[noreturn]] void refuse(const std::string& path, const Level& level, const char* what) {
  throw Error(ErrorKind::kInput, path,
              "is malformed: level " + level.name + ": its stream of " + what +
                  " cannot be decoded; build the pair again");
}

// --- vertices and triangles

struct LatticePoint {
  std::uint32_t bits[3];  ///< whole numbers, or floats where there is no lattice
};

LatticePoint to_lattice(const Lattice& lattice, Vec3f p) {
  LatticePoint point;
  for (int axis = 0; axis < 3; ++axis)
    point.bits[static_cast<std::size_t>(axis)] =
        lattice.step > 0 ? static_cast<std::uint32_t>(lattice_number(lattice, p, axis))
                         : std::bit_cast<std::uint32_t>(p[axis]);
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
    p[axis] = lattice.step > 0 ? lattice_place(lattice, static_cast<std::int32_t>(bits), axis)
                               : std::bit_cast<float>(bits);
  }
  return p;
}

/// What is added to the guesses; without a lattice the floats.
ByteVector encode_positions(const Scan& primitives, const Lattice& lattice) {
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

bool decode_positions(const ByteVector& packed, std::size_t count, const Lattice& lattice, Scan& primitives) {
  std::vector<LatticePoint> points;
  if (!(lattice.step > 0)) {
    if (!decode_vertices(packed, count, points)) return false;
  } else {
    ByteVector raw;
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

ByteVector encode_columns(const std::vector<std::uint16_t>& values) {
  Columns columns;
  columns.add(values);
  return compress(columns.raw);
}

bool decode_columns(const ByteVector& packed, std::size_t count, std::vector<std::uint16_t>& values) {
  ByteVector raw;
  if (!decompress(packed, 2 * count, raw) || raw.size() != 2 * count) return false;
  values = ColumnReader(raw).take<std::uint16_t>(count);
  return true;
}

/// Without a lattice, normals are the floats that they are.
ByteVector encode_normals(const Scan& primitives, const Lattice& lattice) {
  return lattice.step > 0 ? encode_columns(stored_normals(primitives)) : encode_vertices(primitives.normals);
}

/// The radii and triangles are known.
bool decode_normals(const ByteVector& packed, std::size_t count, const Lattice& lattice, Scan& primitives) {
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
ByteVector encode_radii(const std::vector<float>& radii, const Lattice& lattice) {
  if (!(lattice.step > 0)) return encode_vertices(radii);
  std::vector<std::uint16_t> codes;
  codes.reserve(radii.size());
  for (const float r : radii) codes.push_back(round_radius(r));
  return encode_columns(codes);
}

bool decode_radii(const ByteVector& packed, std::size_t count, const Lattice& lattice,
                  std::vector<float>& radii) {
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

ByteVector encode_triangles(const Scan& primitives) {
  const auto* indices = reinterpret_cast<const unsigned int*>(primitives.triangles.data());
  const std::size_t count = 3 * primitives.triangles.size();
  ByteVector raw(meshopt_encodeIndexBufferBound(count, primitives.positions.size()));
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
void pad(ByteVector& packed, std::uint64_t bytes) {
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
    ByteVector raw;
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
