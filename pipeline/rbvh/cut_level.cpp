#include "pipeline/rbvh/cut_level.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <utility>

#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_policy.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/compact.h"

namespace rbvh {
namespace {

Bounds3d intersection(const Bounds3d& a, const Bounds3d& b) {
  Bounds3d both;
  for (int axis = 0; axis < 3; ++axis) {
    both.lo[axis] = std::max(a.lo[axis], b.lo[axis]);
    both.hi[axis] = std::min(a.hi[axis], b.hi[axis]);
  }
  return both;
}

/// What is left of `from` without `hole`, which meets it: at most six boxes.
std::vector<Bounds3d> without(Bounds3d from, const Bounds3d& hole) {
  std::vector<Bounds3d> parts;
  for (int axis = 0; axis < 3; ++axis) {
    if (from.lo[axis] < hole.lo[axis]) {
      parts.push_back(from);
      parts.back().hi[axis] = from.lo[axis] = hole.lo[axis];
    }
    if (from.hi[axis] > hole.hi[axis]) {
      parts.push_back(from);
      parts.back().lo[axis] = from.hi[axis] = hole.hi[axis];
    }
  }
  return parts;
}

/// In floats, and as files store it.
Bounds3f stored_box(const LeafGrid& grid, const Bounds3d& box) {
  const Bounds3f narrow{Vec3f(box.lo), Vec3f(box.hi)};
  return grid.box_step > 0 ? unround_box(grid, round_box(grid, narrow)) : narrow;
}

/// Whether the tile has a surface in the box or within a texel of it; texels from there on.
struct TexelRange {
  std::uint32_t x0 = 65536, y0 = 65536, x1 = 0, y1 = 0;
  bool empty() const { return x0 > x1; }
};
TexelRange surface_in(const Level& level, const RbvhLeaf& leaf, const Bounds3d& box) {
  const TileFrame frame(leaf);
  const double texel = length(frame.u) + length(frame.v);
  const Vec3d margin{texel, texel, texel};
  TexelRange range;
  for_each_leaf_quad(level, leaf, {Vec3f(box.lo - margin), Vec3f(box.hi + margin)},
                     [&](std::uint32_t x, std::uint32_t y, std::size_t) {
                       range.x0 = std::min(range.x0, x);
                       range.y0 = std::min(range.y0, y);
                       range.x1 = std::max(range.x1, x + 1);
                       range.y1 = std::max(range.y1, y + 1);
                     });
  return range;
}

/// Leaves the tile with these texels and one around them, where that saves half of them.
void crop(const LeafGrid& grid, TexelRange range, RbvhLeaf& leaf) {
  range = {range.x0 > 0 ? range.x0 - 1 : 0, range.y0 > 0 ? range.y0 - 1 : 0,
           std::min<std::uint32_t>(range.x1 + 1, leaf.width - 1u),
           std::min<std::uint32_t>(range.y1 + 1, leaf.height - 1u)};
  const std::uint32_t width = range.x1 - range.x0 + 1, height = range.y1 - range.y0 + 1;
  if (2 * width * height > std::uint32_t{leaf.width} * leaf.height) return;
  leaf.to_tile[3] -= static_cast<float>(range.x0);
  leaf.to_tile[7] -= static_cast<float>(range.y0);
  if (grid.frame_step > 0) unround_frame(grid, round_frame(grid, leaf.to_tile), leaf.to_tile);
  leaf.x = static_cast<std::uint16_t>(leaf.x + range.x0);
  leaf.y = static_cast<std::uint16_t>(leaf.y + range.y0);
  leaf.width = static_cast<std::uint16_t>(width);
  leaf.height = static_cast<std::uint16_t>(height);
}

/// The leaves and primitives that are kept.
class Cut {
 public:
  Cut(LooseLevel& loose, CutCounts& counts) : loose_(loose), counts_(counts) {
    loose_.level.leaves.swap(leaves_);
    loose_.boxes.swap(boxes_);
    loose_.from.swap(from_);
    loose_.is_new.swap(is_new_);
    firsts_.assign(leaves_.size(), RBVH_NO_LEAF);
    for (const RbvhPrimitiveLeaf& leaf : loose_.level.primitive_leaves) firsts_[leaf.leaf] = leaf.first;
    loose_.level.primitive_leaves.clear();
  }

  void cut(const Bounds3d& box, BoxSide side) {
    loose_.cuts.clear();
    const std::vector<std::uint32_t> origins = keep_primitives(box, side);
    std::size_t next = 0;  // of the primitives that are left
    auto edge = loose_.cuts.begin();
    for (std::uint32_t k = 0; k < leaves_.size(); ++k) {
      if (firsts_[k] == RBVH_NO_LEAF) {
        cut_tile(k, box, side);
        continue;
      }
      const std::size_t begin = next;
      while (next < origins.size() && origins[next] < firsts_[k] + leaves_[k].primitives) ++next;
      while (edge != loose_.cuts.end() && edge->of < firsts_[k] + leaves_[k].primitives)
        (edge++)->of = leaves_[k].object_id;
      add_primitive_leaves(k, begin, next);
    }
  }

 private:
  RbvhLeaf& add(std::uint32_t k, const Bounds3f& box, bool is_new) {
    loose_.boxes.push_back(box);
    loose_.from.push_back(from_[k]);
    loose_.is_new.push_back(is_new ? 1 : 0);
    return loose_.level.leaves.emplace_back(leaves_[k]);
  }

  /// Returns for each that is left its number before.
  std::vector<std::uint32_t> keep_primitives(const Bounds3d& box, BoxSide side) {
    Scan& primitives = loose_.level.primitives;
    if (!holds_discs(loose_.level)) {
      before_ = primitives.triangles;
      return clip_triangles(primitives, box, side, loose_.level.lattice, &loose_.cuts);
    }
    std::vector<std::uint8_t> keep(primitives.positions.size());
    std::vector<std::uint32_t> origins;
    for (std::uint32_t i = 0; i < keep.size(); ++i) {
      keep[i] = side == BoxSide::kBoth ||
                        contains(box, Vec3d(primitives.positions[i])) == (side == BoxSide::kInside)
                    ? 1
                    : 0;
      if (keep[i] != 0) origins.push_back(i);
    }
    keep_vertex_entries(primitives, keep);
    if (!loose_.vertices_from.empty()) keep_entries(loose_.vertices_from, keep);
    return origins;
  }

  /// Of primitives [begin, end) of those that are left: one leaf, or several where cuts made many of them.
  void add_primitive_leaves(std::uint32_t k, std::size_t begin, std::size_t end) {
    const Scan& primitives = loose_.level.primitives;
    const std::uint32_t count = leaves_[k].primitives;
    const auto is_as_before = [&] {
      if (end - begin != count) return false;
      if (before_.empty()) return true;
      const auto first = before_.begin() + firsts_[k];
      return std::equal(first, first + count,
                        primitives.triangles.begin() + static_cast<std::ptrdiff_t>(begin));
    };
    const bool is_new = !is_as_before();
    if (is_new) ++(begin == end ? counts_.removed : counts_.cut);
    const std::size_t most = std::max(count, kMostLeafPrimitives);
    for (; begin < end; begin = std::min(begin + most, end)) {
      const std::size_t last = std::min(begin + most, end);
      Bounds3f box = boxes_[k];
      if (is_new) {
        box = {};
        for (std::size_t i = begin; i < last; ++i)
          box.add(primitive_bounds(primitives, static_cast<std::uint32_t>(i)));
      }
      loose_.level.primitive_leaves.push_back(
          {static_cast<std::uint32_t>(loose_.level.leaves.size()), static_cast<std::uint32_t>(begin)});
      add(k, box, is_new || is_new_[k] != 0).primitives = static_cast<std::uint32_t>(last - begin);
    }
  }

  void cut_tile(std::uint32_t k, const Bounds3d& box, BoxSide side) {
    const Bounds3d own = to_double(boxes_[k]);
    const Level& level = loose_.atlas != nullptr ? *loose_.atlas : loose_.level;
    const bool meets = overlap(own, box);
    if (side == BoxSide::kBoth ||
        (side == BoxSide::kOutside &&
         (!meets || surface_in(level, leaves_[k], intersection(own, box)).empty()))) {
      add(k, boxes_[k], false);
      return;
    }
    std::vector<Bounds3d> parts;
    if (side == BoxSide::kOutside)
      parts = without(own, box);
    else if (meets)
      parts = {intersection(own, box)};
    // A layer's tile of another resolution cannot be cropped with the heights'.
    const bool may_crop = std::all_of(level.layers.begin(), level.layers.end(),
                                      [](const Layer& layer) { return layer.tiles.empty(); });
    bool is_left = false;
    for (const Bounds3d& part : parts) {
      const TexelRange range = surface_in(level, leaves_[k], part);
      if (range.empty()) continue;
      is_left = true;
      RbvhLeaf& leaf = add(k, stored_box(level.grid, part), false);
      if (may_crop) crop(level.grid, range, leaf);
    }
    ++(is_left ? counts_.cut : counts_.removed);
  }

  LooseLevel& loose_;
  CutCounts& counts_;
  std::vector<RbvhLeaf> leaves_;  // before
  std::vector<Bounds3f> boxes_;
  std::vector<std::uint32_t> from_, firsts_;
  std::vector<std::uint8_t> is_new_;
  std::vector<Triangle> before_;
};

}  // namespace

LooseLevel loosen(Level&& level) {
  LooseLevel loose;
  loose.boxes = leaf_boxes(level);
  loose.level = std::move(level);
  loose.level.nodes.clear();
  loose.from.resize(loose.boxes.size());
  std::iota(loose.from.begin(), loose.from.end(), 0u);
  loose.is_new.resize(loose.boxes.size());
  return loose;
}

LooseLevel take_leaves(const Level& level, const std::vector<Bounds3f>& boxes,
                       const std::vector<std::uint32_t>& leaves) {
  constexpr std::uint32_t kNone = 0xffffffffu;
  LooseLevel loose;
  loose.atlas = &level;
  loose.from = leaves;
  loose.is_new.resize(leaves.size());
  loose.level.lattice = level.lattice;
  loose.level.grid = level.grid;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  const Scan& all = level.primitives;
  Scan& own = loose.level.primitives;
  std::vector<std::uint32_t> numbers(all.positions.size(), kNone);
  const auto number = [&](std::uint32_t vertex) {
    if (numbers[vertex] != kNone) return numbers[vertex];
    loose.vertices_from.push_back(vertex);
    own.positions.push_back(all.positions[vertex]);
    own.normals.push_back(all.normals[vertex]);
    if (!all.colors.empty()) own.colors.push_back(all.colors[vertex]);
    if (!all.radii.empty()) own.radii.push_back(all.radii[vertex]);
    return numbers[vertex] = static_cast<std::uint32_t>(own.positions.size() - 1);
  };
  for (const std::uint32_t leaf : leaves) {
    loose.boxes.push_back(boxes[leaf]);
    const auto at = static_cast<std::uint32_t>(loose.level.leaves.size());
    loose.level.leaves.push_back(level.leaves[leaf]);
    if (firsts[leaf] == RBVH_NO_LEAF) continue;
    loose.level.primitive_leaves.push_back({at, static_cast<std::uint32_t>(primitive_count(loose.level))});
    for (std::uint32_t i = firsts[leaf]; i < firsts[leaf] + level.leaves[leaf].primitives; ++i) {
      Triangle t = primitive_corners(all, i);
      for (std::uint32_t& corner : t) corner = number(corner);
      if (all.radii.empty()) own.triangles.push_back(t);
    }
  }
  return loose;
}

CutCounts cut_level(LooseLevel& loose, const Bounds3d& box, BoxSide side) {
  CutCounts counts;
  Cut(loose, counts).cut(box, side);
  return counts;
}

namespace {

double surface_area(const Level& level, const Level& atlas, const std::vector<Bounds3f>& boxes) {
  const Scan& primitives = level.primitives;
  double area = 0;
  for (const float r : primitives.radii) area += static_cast<double>(r) * static_cast<double>(r);
  const auto half_cross = [](Vec3d a, Vec3d b, Vec3d c) { return 0.5 * length(cross(b - a, c - a)); };
  for (const Triangle& t : primitives.triangles)
    area += half_cross(Vec3d(primitives.positions[t[0]]), Vec3d(primitives.positions[t[1]]),
                       Vec3d(primitives.positions[t[2]]));
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (std::size_t k = 0; k < level.leaves.size(); ++k) {
    if (firsts[k] != RBVH_NO_LEAF) continue;
    const std::vector<std::uint16_t>& heights = atlas.layers.at(0).texels;
    const TileFrame frame(level.leaves[k]);
    for_each_leaf_quad(atlas, level.leaves[k], boxes[k], [&](std::uint32_t, std::uint32_t, std::size_t at) {
      const double along_u = heights[at + 1] - heights[at],
                   along_v = heights[at + atlas.atlas_width] - heights[at];
      area += length(cross(frame.u + frame.w * along_u, frame.v + frame.w * along_v));
    });
  }
  return area;
}

}  // namespace

double surface_area(const LooseLevel& loose) {
  return surface_area(loose.level, loose.atlas != nullptr ? *loose.atlas : loose.level, loose.boxes);
}

double surface_area(const Level& level, const std::vector<Bounds3f>& boxes) {
  return surface_area(level, level, boxes);
}

}  // namespace rbvh
