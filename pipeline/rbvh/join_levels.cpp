#include "pipeline/rbvh/join_levels.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/atlas_space.h"
#include "pipeline/rbvh/height_normals.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_grid.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/snap_primitives.h"
#include "pipeline/scan/vertex_normals.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr std::uint16_t kWhite = 0xffff;

LayerTile rectangle(const RbvhLeaf& leaf) { return {leaf.x, leaf.y, leaf.width, leaf.height}; }

/// A leaf's texels in one layer, before they are put into the new atlas.
struct TileTexelsOf {
  const std::uint16_t* texels = nullptr;  ///< of the atlas they are in; nullptr: no values
  std::size_t row = 0;                    ///< that atlas's width
  LayerTile at;
};

void copy_tile(const TileTexelsOf& from, const LayerTile& to, Layer& layer, std::size_t row) {
  if (from.texels == nullptr) return;
  const std::size_t channels = layer.channels;
  for (std::size_t y = 0; y < to.height; ++y)
    std::copy_n(from.texels + ((from.at.y + y) * from.row + from.at.x) * channels, to.width * channels,
                layer.texels.begin() + static_cast<std::ptrdiff_t>(((to.y + y) * row + to.x) * channels));
}

/// Its figures alone.
Level without_content(const Level& of) {
  Level level;
  level.name = of.name;
  level.rho = of.rho;
  level.alpha = of.alpha;
  level.phi_degrees = of.phi_degrees;
  level.error = of.error;
  level.reached = of.reached;
  level.lattice = of.lattice;
  level.grid = of.grid;
  level.derived_from = of.derived_from;
  return level;
}

class LevelJoin {
 public:
  LevelJoin(const Level& before, const std::vector<std::uint32_t>& untouched, LooseLevel& kept,
            LooseLevel& added, float texel, JoinCounts& counts)
      : before_(before), untouched_(untouched), kept_(kept), added_(added), texel_(texel), counts_(counts) {}

  Level run() {
    match_standard_layers();
    Level& level = result_;
    level = without_content(before_);
    const std::vector<Bounds3f> all = leaf_boxes(before_);
    std::vector<Bounds3f> boxes;
    for (const std::uint32_t leaf : untouched_) boxes.push_back(all[leaf]);
    boxes.insert(boxes.end(), kept_.boxes.begin(), kept_.boxes.end());
    boxes.insert(boxes.end(), added_.boxes.begin(), added_.boxes.end());
    LeafHierarchy tree = build_leaf_hierarchy(boxes);
    level.nodes = std::move(tree.nodes);
    order_ = std::move(tree.order);
    for (const Bounds3f& box : boxes) level.bounds.add(box);
    gather_leaves();
    place_heights();
    for (const Layer& layer : before_.layers)
      if (layer_kind(layer.name) == LayerKind::kUser && (!layer.tiles.empty() || has_primitives_))
        join_own_layer(layer);
      else
        join_shared_layer(layer);
    count_texels();
    return std::move(level);
  }

 private:
  bool is_untouched(std::uint32_t leaf) const { return order_[leaf] < untouched_.size(); }
  /// Untouched, or cut from the level.
  bool is_kept(std::uint32_t leaf) const { return order_[leaf] < untouched_.size() + kept_.boxes.size(); }
  /// The leaf's number in its part.
  std::uint32_t number(std::uint32_t leaf) const {
    if (is_untouched(leaf)) return untouched_[order_[leaf]];
    return order_[leaf] -
           static_cast<std::uint32_t>(untouched_.size() + (is_kept(leaf) ? 0 : kept_.boxes.size()));
  }
  const LooseLevel& part(std::uint32_t leaf) const { return is_kept(leaf) ? kept_ : added_; }
  const Level& level_of(std::uint32_t leaf) const { return is_untouched(leaf) ? before_ : part(leaf).level; }
  const RbvhLeaf& leaf_before(std::uint32_t leaf) const { return level_of(leaf).leaves[number(leaf)]; }
  bool is_new(std::uint32_t leaf) const {
    return !is_untouched(leaf) && part(leaf).is_new[number(leaf)] != 0;
  }
  /// The leaf of `before` that one which is kept comes from.
  std::uint32_t origin(std::uint32_t leaf) const {
    return is_untouched(leaf) ? number(leaf) : kept_.from[number(leaf)];
  }

  /// Gives what is added the level's own layers.
  void match_standard_layers() {
    if (added_.boxes.empty()) return;
    Level& added = added_.level;
    if (find_layer(before_, "normal") != nullptr && find_layer(added, "normal") == nullptr)
      added.layers.push_back(make_normal_layer(added));
    const bool has_colors = find_layer(before_, "color") != nullptr,
               brings_colors = find_layer(added, "color") != nullptr;
    counts_.lacks_colors = has_colors && !brings_colors;
    counts_.drops_colors = !has_colors && brings_colors;
    if (!has_colors) added.primitives.colors.clear();
    if (!counts_.lacks_colors) return;
    added.primitives.colors.assign(added.primitives.positions.size(), {255, 255, 255});
    Layer& white = added.layers.emplace_back(Layer{"color", 1, added.layers[0].texels});
    for (std::uint16_t& texel : white.texels) texel = texel != 0 ? kWhite : std::uint16_t{0};
  }

  void gather_leaves() {
    const std::vector<std::uint32_t> firsts[3] = {first_primitives(before_), first_primitives(kept_.level),
                                                  first_primitives(added_.level)};
    // Vertices that untouched leaves share with others stay shared.
    std::vector<std::uint32_t> numbers[3] = {
        std::vector<std::uint32_t>(before_.primitives.positions.size(), kNone),
        std::vector<std::uint32_t>(kept_.level.primitives.positions.size(), kNone),
        std::vector<std::uint32_t>(added_.level.primitives.positions.size(), kNone)};
    reserve();
    Level& level = result_;
    for (std::uint32_t k = 0; k < order_.size(); ++k) {
      level.leaves.push_back(leaf_before(k));
      const std::size_t side = is_untouched(k) ? 0 : is_kept(k) ? 1 : 2;
      const std::uint32_t first = firsts[side][number(k)];
      if (first == RBVH_NO_LEAF) continue;
      level.primitive_leaves.push_back({k, count_});
      count_ += leaf_before(k).primitives;
      for (std::uint32_t i = first; i < first + leaf_before(k).primitives; ++i)
        add_primitive(level_of(k), i, [&](std::uint32_t vertex) -> std::uint32_t& {
          const bool is_old = side == 1 && vertex < kept_.vertices_from.size();
          return is_old ? numbers[0][kept_.vertices_from[vertex]] : numbers[side][vertex];
        });
    }
    has_primitives_ = !level.primitive_leaves.empty();
    Scan& primitives = level.primitives;
    if (!primitives.triangles.empty()) rotate_as_stored(primitives);
    if (!primitives.triangles.empty() && level.lattice.step > 0) {
      const std::vector<Vec3f> own = vertex_normals(primitives);
      for (std::size_t i = 0; i < own.size(); ++i)
        if (dot(own[i], primitives.normals[i]) >= kSameNormal) primitives.normals[i] = own[i];
    }
    for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves)
      if (is_new(leaf.leaf) || !is_kept(leaf.leaf))
        fit_frame(primitives, leaf.first, texel_, level.leaves[leaf.leaf]);
  }

  /// For more than there will be.
  void reserve() {
    const Scan* const parts[3] = {&before_.primitives, &kept_.level.primitives, &added_.level.primitives};
    std::size_t vertices = 0, triangles = 0;
    for (const Scan* part : parts) {
      vertices += part->positions.size();
      triangles += part->triangles.size();
    }
    Scan& to = result_.primitives;
    to.positions.reserve(vertices);
    to.normals.reserve(vertices);
    to.triangles.reserve(triangles);
    result_.leaves.reserve(order_.size());
  }

  /// `number`: the vertex's in the result, or kNone.
  template <class Number>
  void add_primitive(const Level& from, std::uint32_t i, Number&& number) {
    Scan& to = result_.primitives;
    const auto add_vertex = [&](std::uint32_t vertex) {
      std::uint32_t& own = number(vertex);
      if (own != kNone) return own;
      to.positions.push_back(from.primitives.positions[vertex]);
      to.normals.push_back(from.primitives.normals[vertex]);
      if (!from.primitives.colors.empty()) to.colors.push_back(from.primitives.colors[vertex]);
      if (holds_discs(from)) to.radii.push_back(from.primitives.radii[vertex]);
      return own = static_cast<std::uint32_t>(to.positions.size() - 1);
    };
    if (holds_discs(from)) {
      add_vertex(i);
      return;
    }
    Triangle t = from.primitives.triangles[i];
    for (std::uint32_t& corner : t) corner = add_vertex(corner);
    to.triangles.push_back(t);
  }

  /// Places for tiles, of which the first of those that were cut from one keeps its own.
  AtlasSize place(std::vector<LayerTile>& tiles, std::span<const std::uint32_t> leaves,
                  AtlasSize size) const {
    std::vector<std::uint8_t> has_place(tiles.size()), is_claimed(before_.leaves.size());
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      const std::uint32_t leaf = leaves[i];
      if (!is_kept(leaf) || (is_new(leaf) && has_primitives_ && is_primitive(leaf))) continue;
      has_place[i] = std::exchange(is_claimed[origin(leaf)], std::uint8_t{1}) == 0 ? 1 : 0;
    }
    return place_tiles(tiles, has_place, size);
  }

  bool is_primitive(std::uint32_t leaf) const {
    return std::binary_search(
        result_.primitive_leaves.begin(), result_.primitive_leaves.end(), RbvhPrimitiveLeaf{leaf, 0},
        [](const RbvhPrimitiveLeaf& a, const RbvhPrimitiveLeaf& b) { return a.leaf < b.leaf; });
  }

  void place_heights() {
    std::vector<LayerTile> tiles;
    for (std::uint32_t k = 0; k < order_.size(); ++k)
      if (!is_primitive(k)) {
        tile_leaves_.push_back(k);
        tiles.push_back(rectangle(leaf_before(k)));
      }
    const AtlasSize size = place(tiles, tile_leaves_, {before_.atlas_width, before_.atlas_height});
    result_.atlas_width = size.width;
    result_.atlas_height = size.height;
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      result_.leaves[tile_leaves_[i]].x = tiles[i].x;
      result_.leaves[tile_leaves_[i]].y = tiles[i].y;
    }
  }

  void join_shared_layer(const Layer& layer) {
    Layer& to = result_.layers.emplace_back(layer);
    to.texels.assign(std::size_t{result_.atlas_width} * result_.atlas_height * layer.channels, 0);
    const Layer brought = brought_layer(layer, to);
    Layer own = layer;
    regrade(layer, to, own.texels);
    for (const std::uint32_t k : tile_leaves_) {
      const TileTexelsOf from =
          is_kept(k) ? TileTexelsOf{own.texels.data(), before_.atlas_width, rectangle(leaf_before(k))}
                     : TileTexelsOf{brought.texels.empty() ? nullptr : brought.texels.data(),
                                    added_.level.atlas_width, rectangle(leaf_before(k))};
      copy_tile(from, rectangle(result_.leaves[k]), to, result_.atlas_width);
    }
  }

  /// The layer of what is added, in the codes of `to`, whose range grows to hold both; empty: there is none.
  Layer brought_layer(const Layer& layer, Layer& to) {
    const Layer* from = find_layer(added_.level, layer.name);
    if (from == nullptr || from->channels != layer.channels) {
      if (!added_.boxes.empty()) counts_.lacking.push_back(layer.name);
      return {};
    }
    Layer brought = *from;
    const bool has_range = from->lo < from->hi;
    if (has_range && !(layer.lo < layer.hi)) {  // no values there
      to.lo = from->lo;
      to.hi = from->hi;
    } else if (has_range) {
      to.lo = std::min(layer.lo, from->lo);
      to.hi = std::max(layer.hi, from->hi);
    }
    if (std::isinf(to.hi - to.lo)) {  // too far apart for a float: theirs are clamped
      to.lo = layer.lo;
      to.hi = layer.hi;
    }
    regrade(*from, to, brought.texels);
    return brought;
  }

  static void regrade(const Layer& from, const Layer& to, std::vector<std::uint16_t>& codes) {
    if (from.lo == to.lo && from.hi == to.hi) return;
    for (std::uint16_t& code : codes)
      if (code != 0) code = encode(to, decode(from, code));
  }

  /// Of a layer with tiles of its own for each leaf.
  void join_own_layer(const Layer& layer) {
    Layer& to = result_.layers.emplace_back(layer);
    const Layer brought = brought_layer(layer, to);
    Layer own = layer;
    regrade(layer, to, own.texels);
    const double scale = mean_scale(before_, layer);
    std::vector<std::vector<std::uint16_t>> sampled(order_.size());
    std::vector<TileTexelsOf> from(order_.size());
    std::vector<std::uint32_t> leaves(order_.size());
    to.tiles.clear();
    for (std::uint32_t k = 0; k < order_.size(); ++k) {
      leaves[k] = k;
      const LayerTile sized = scaled_tile(result_.leaves[k], scale);
      if (is_kept(k) && is_new(k)) {
        sampled[k] = sample(own, k, sized);
        from[k] = {sampled[k].data(), sized.width, sized};
      } else if (is_kept(k)) {
        from[k] = {own.texels.data(), atlas_size(before_, layer)[0],
                   layer.tiles.empty() ? rectangle(leaf_before(k)) : layer.tiles[origin(k)]};
      } else if (!brought.texels.empty()) {
        from[k] = {brought.texels.data(), atlas_size(added_.level, brought)[0],
                   layer_tile(added_.level, brought, number(k))};
      } else {
        from[k] = {nullptr, 0, sized};
      }
      to.tiles.push_back(from[k].at);
    }
    const auto [width, height] = atlas_size(before_, layer);
    const AtlasSize size = place(to.tiles, leaves, {width, height});
    to.width = size.width;
    to.height = size.height;
    to.texels.assign(std::size_t{size.width} * size.height * layer.channels, 0);
    for (std::uint32_t k = 0; k < order_.size(); ++k) copy_tile(from[k], to.tiles[k], to, size.width);
  }

  static LayerTile scaled_tile(const RbvhLeaf& leaf, double scale) {
    const auto side = [&](std::uint16_t texels) {
      return static_cast<std::uint16_t>(std::clamp(std::round((texels - 1) * scale), 1.0, 65534.0) + 1);
    };
    return {0, 0, side(leaf.width), side(leaf.height)};
  }

  /// The values of `before` at the texels of a leaf of primitives whose frame is another.
  std::vector<std::uint16_t> sample(const Layer& own, std::uint32_t leaf, const LayerTile& tile) const {
    const auto at = std::lower_bound(result_.primitive_leaves.begin(), result_.primitive_leaves.end(), leaf,
                                     [](const RbvhPrimitiveLeaf& a, std::uint32_t b) { return a.leaf < b; });
    const LeafSurface surface(result_, leaf, at->first);
    const std::uint32_t old = origin(leaf);
    const LayerGrid grid(before_, own, old);
    const RbvhLeaf& now = result_.leaves[leaf];
    std::vector<std::uint16_t> codes(std::size_t{tile.width} * tile.height * own.channels);
    for (std::uint32_t y = 0; y < tile.height; ++y)
      for (std::uint32_t x = 0; x < tile.width; ++x) {
        const float u = static_cast<float>(x) * static_cast<float>(now.width - 1) /
                        static_cast<float>(tile.width - 1),
                    v = static_cast<float>(y) * static_cast<float>(now.height - 1) /
                        static_cast<float>(tile.height - 1);
        const std::optional<Vec3f> point = surface.point(u, v, 0);
        if (!point) continue;
        const Vec3f there = to_tile(before_.leaves[old], *point);
        const TexelQuad quad = grid.quad(there.x, there.y);
        for (std::size_t c = 0; c < own.channels; ++c) {
          float sum = 0, weight = 0;
          for (std::size_t i = 0; i < 4; ++i) {
            const std::uint16_t code = own.texels[quad.texels[i] * own.channels + c];
            if (code == 0 || quad.weights[i] <= 1e-6f) continue;
            sum += quad.weights[i] * static_cast<float>(code);
            weight += quad.weights[i];
          }
          if (weight > 0)
            codes[(std::size_t{y} * tile.width + x) * own.channels + c] =
                static_cast<std::uint16_t>(std::clamp(std::round(sum / weight), 1.0f, 65535.0f));
        }
      }
    return codes;
  }

  void count_texels() {
    Level& level = result_;
    level.texels_used = 0;
    for (const std::uint32_t k : tile_leaves_) {
      const RbvhLeaf& leaf = level.leaves[k];
      for (std::size_t y = 0; y < leaf.height; ++y) {
        const auto row = level.layers[0].texels.begin() +
                         static_cast<std::ptrdiff_t>((leaf.y + y) * level.atlas_width + leaf.x);
        level.texels_used += static_cast<std::uint64_t>(leaf.width - std::count(row, row + leaf.width, 0));
      }
    }
  }

  const Level& before_;
  const std::vector<std::uint32_t>& untouched_;
  LooseLevel &kept_, &added_;
  float texel_;
  JoinCounts& counts_;
  Level result_;
  std::vector<std::uint32_t> order_;        ///< leaf -> number among those untouched, kept, added
  std::vector<std::uint32_t> tile_leaves_;  ///< those with tiles
  std::uint32_t count_ = 0;                 ///< of primitives
  bool has_primitives_ = false;
};

}  // namespace

Level join_levels(const Level& before, const std::vector<std::uint32_t>& untouched, LooseLevel&& kept,
                  LooseLevel&& added, float texel, JoinCounts& counts) {
  RBVH_CHECK(!untouched.empty() || !kept.boxes.empty() || !added.boxes.empty());
  return LevelJoin(before, untouched, kept, added, texel, counts).run();
}

}  // namespace rbvh
