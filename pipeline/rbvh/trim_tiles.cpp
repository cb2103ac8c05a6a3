#include "pipeline/rbvh/trim_tiles.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/rbvh/texel.h"

namespace rbvh {
namespace {

/// Texels between two tiles' heights, or a tile's and a primitive, up to which they are one surface.
constexpr double kSameSurface = 1.0;
/// And between a point and the edge of the primitives, beyond which they do not cover it.
constexpr double kBeside = 0.05;
/// The cosine between normals below which two surfaces are the two sides of a sheet.
constexpr double kOtherSide = -0.3;

/// A leaf that has a tile.
struct PlacedTile {
  std::uint32_t leaf;
  TileFrame frame;
  Vec3d outside;  ///< unit
  double texel;   ///< side, scan units
  Bounds3f box;
};

struct Quad {
  std::uint32_t x, y;
  std::size_t texel;
};

bool overlap(const Bounds3f& a, const Bounds3f& b) {
  for (int axis = 0; axis < 3; ++axis)
    if (a.lo[axis] > b.hi[axis] || b.lo[axis] > a.hi[axis]) return false;
  return true;
}

Bounds3f grown(Bounds3f box, float by) {
  box.lo = box.lo - Vec3f{by, by, by};
  box.hi = box.hi + Vec3f{by, by, by};
  return box;
}

class Trimmer {
 public:
  explicit Trimmer(const Level& level)
      : level_(level),
        heights_(level.layers.at(0).texels),
        firsts_(first_primitives(level)),
        tile_of_(level.leaves.size(), kNone),
        kept_(heights_.size(), 0),
        gaps_(level.primitives.positions.size(), 0) {
    for (const RbvhNode& node : level.nodes) {
      if (node.count == 0 || firsts_[node.first] != RBVH_NO_LEAF) continue;
      const TileFrame frame(level.leaves[node.first]);
      tiles_.push_back({node.first,
                        frame,
                        normalized(frame.w),
                        length(frame.u),
                        {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}}});
      reach_ = std::max(reach_, static_cast<float>(length(frame.u) + length(frame.v)));
    }
    std::sort(tiles_.begin(), tiles_.end(),
              [](const PlacedTile& a, const PlacedTile& b) { return a.leaf < b.leaf; });
    for (std::uint32_t k = 0; k < tiles_.size(); ++k) tile_of_[tiles_[k].leaf] = k;
    quads_.resize(tiles_.size());
    for_each_quad(level, [&](std::uint32_t leaf, std::uint32_t x, std::uint32_t y, std::size_t texel) {
      quads_[tile_of_[leaf]].push_back({x, y, texel});
      kept_[texel] = 1;
    });
  }

  TrimmedTiles run() {
    if (tiles_.empty()) return {std::move(kept_), std::move(gaps_)};
    drop_under_primitives();
    TriangleSoup soup;
    for (const Triangle& t : level_.primitives.triangles)
      add_triangle(soup, level_.primitives.positions[t[0]], level_.primitives.positions[t[1]],
                   level_.primitives.positions[t[2]]);
    const ClosestPoint primitives(soup);
    for (std::uint32_t k = 0; k < tiles_.size(); ++k) {
      std::vector<std::uint32_t> lower, higher;
      bool has_primitives = false;
      for_each_leaf_near(tiles_[k].box, [&](std::uint32_t leaf) {
        const std::uint32_t other = tile_of_[leaf];
        if (object(leaf) != object(tiles_[k].leaf)) return;
        if (other == kNone)
          has_primitives = true;
        else if (other != k)
          (other < k ? lower : higher).push_back(other);
      });
      for (const Quad& quad : quads_[k]) {
        for (int j = 0; j < 9 && kept_[quad.texel] != 0; ++j) {
          const int row = j / 3;
          const Vec3f p = point(tiles_[k], quad, 0.5 * (j % 3), 0.5 * row);
          const bool is_covered = (has_primitives && is_on(primitives, soup, tiles_[k], p)) ||
                                  std::any_of(lower.begin(), lower.end(), [&](std::uint32_t other) {
                                    return find_quad(tiles_[other], p, tiles_[k].outside).has_value();
                                  });
          if (is_covered) kept_[quad.texel] = 0;
        }
        if (kept_[quad.texel] == 0) continue;
        for (const auto& [i, j] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}})
          for (const std::uint32_t other : higher)
            drop(tiles_[other], point(tiles_[k], quad, i, j), tiles_[k].outside);
      }
    }
    return {std::move(kept_), std::move(gaps_)};
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  template <class Visit>
  void for_each_leaf_near(const Bounds3f& box, const Visit& visit) const {
    const Bounds3f near = grown(box, reach_);
    std::vector<std::uint32_t> stack = {0};
    while (!stack.empty()) {
      const RbvhNode& node = level_.nodes[stack.back()];
      stack.pop_back();
      if (!overlap(near, {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}}))
        continue;
      if (node.count != 0) {
        visit(node.first);
      } else {
        stack.push_back(node.first + 1);
        stack.push_back(node.first);
      }
    }
  }

  std::uint32_t object(std::uint32_t leaf) const { return level_.leaves[leaf].object_id; }

  double bilinear(std::size_t texel, double s, double t) const {
    const auto h = [&](std::size_t at) { return static_cast<double>(heights_[at]); };
    const std::size_t below = texel + level_.atlas_width;
    return (1 - t) * ((1 - s) * h(texel) + s * h(texel + 1)) + t * ((1 - s) * h(below) + s * h(below + 1));
  }

  /// s, t: across the quad, 0 to 1.
  Vec3f point(const PlacedTile& tile, const Quad& quad, double s, double t) const {
    return tile.frame.at(quad.x + s, quad.y + t, bilinear(quad.texel, s, t));
  }

  /// The tile's quad that `p`, of a surface that faces `facing`, lies on: its first texel.
  std::optional<std::size_t> find_quad(const PlacedTile& tile, Vec3f p, Vec3d facing) const {
    const RbvhLeaf& leaf = level_.leaves[tile.leaf];
    const Vec3f q = to_tile(leaf, p);
    if (!(q.x >= 0 && q.y >= 0 && q.x < static_cast<float>(leaf.width - 1) &&
          q.y < static_cast<float>(leaf.height - 1)))
      return {};
    const auto x = static_cast<std::uint32_t>(q.x), y = static_cast<std::uint32_t>(q.y);
    const std::size_t texel = (std::size_t{leaf.y} + y) * level_.atlas_width + leaf.x + x;
    if (kept_[texel] == 0 || dot(facing, tile.outside) < kOtherSide) return {};
    const double above = std::abs(static_cast<double>(q.z) - bilinear(texel, static_cast<double>(q.x) - x,
                                                                      static_cast<double>(q.y) - y)) *
                         length(tile.frame.w);
    if (above > kSameSurface * tile.texel) return {};
    return texel;
  }

  void drop(const PlacedTile& tile, Vec3f p, Vec3d facing) {
    if (const auto texel = find_quad(tile, p, facing)) kept_[*texel] = 0;
  }

  void drop_under_primitives() {
    const Scan& primitives = level_.primitives;
    std::vector<std::size_t> covered;
    for (const RbvhPrimitiveLeaf& leaf : level_.primitive_leaves) {
      const std::uint32_t end = leaf.first + level_.leaves[leaf.leaf].primitives;
      Bounds3f box;
      for (std::uint32_t i = leaf.first; i < end; ++i) box.add(primitive_bounds(primitives, i));
      std::vector<std::uint32_t> near;
      for_each_leaf_near(box, [&](std::uint32_t other) {
        if (tile_of_[other] != kNone && object(other) == object(leaf.leaf)) near.push_back(tile_of_[other]);
      });
      if (near.empty()) continue;
      for (std::uint32_t i = leaf.first; i < end; ++i) {
        const Triangle& t = primitives.triangles[i];
        const Vec3f a = primitives.positions[t[0]], b = primitives.positions[t[1]],
                    c = primitives.positions[t[2]];
        const auto facing = static_cast<Vec3d>(normalized(cross(b - a, c - a)));
        const Vec3f points[4] = {a, b, c, (a + b + c) * (1.0f / 3)};
        for (std::size_t j = 0; j < 4; ++j)
          for (const std::uint32_t k : near)
            if (const auto texel = find_quad(tiles_[k], points[j], facing)) {
              covered.push_back(*texel);
              if (j < 3) gaps_[t[j]] = std::max(gaps_[t[j]], static_cast<float>(tiles_[k].texel));
            }
      }
    }
    for (const std::size_t texel : covered) kept_[texel] = 0;
  }

  static bool is_on(const ClosestPoint& primitives, const TriangleSoup& soup, const PlacedTile& tile,
                    Vec3f p) {
    const ClosestPoint::Nearest near = primitives.find(p);
    if (static_cast<double>(near.distance) > kSameSurface * tile.texel) return false;
    const Vec3f* t = soup.data() + 3 * std::size_t{near.triangle};
    const auto normal = static_cast<Vec3d>(normalized(cross(t[1] - t[0], t[2] - t[0])));
    if (dot(normal, tile.outside) < kOtherSide) return false;
    const auto d = static_cast<Vec3d>(p - near.point);
    return length(d - normal * dot(normal, d)) <= kBeside * tile.texel;
  }

  const Level& level_;
  const std::vector<std::uint16_t>& heights_;
  std::vector<std::uint32_t> firsts_, tile_of_;
  std::vector<PlacedTile> tiles_;  ///< by leaf
  std::vector<std::vector<Quad>> quads_;
  std::vector<std::uint8_t> kept_;
  std::vector<float> gaps_;
  float reach_ = 0;  ///< how far a tile may extend past its box
};

}  // namespace

TrimmedTiles trim_tiles(const Level& level) { return Trimmer(level).run(); }

}  // namespace rbvh
