#include "pipeline/rbvh/tile.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/overlaps.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kRunLength = 128;
constexpr std::uint32_t kMaxSide = 4096;
constexpr float kQuantaPerTexel = 256;

/// A right-handed frame with w along the area-weighted mean normal (the direction of largest projected area);
/// for what has none, a closed crumb say, along the box's shortest side.
TileAxes initial_axes(const PartitionNode& node) {
  const Bounds3f b = node.bounds();
  Vec3d w = normalized(Vec3d{node.sums.area_normal[0], node.sums.area_normal[1], node.sums.area_normal[2]});
  if (node.projected_area() <= 1e-6f * node.sums.area || !is_finite(w)) {
    const Vec3f e = b.extent();
    w = e.x <= e.y && e.x <= e.z ? Vec3d{1, 0, 0} : e.y <= e.z ? Vec3d{0, 1, 0} : Vec3d{0, 0, 1};
  }
  const Vec3d helper = std::abs(w.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d u = normalized(cross(helper, w)), v = cross(w, u);
  const Vec3f c = b.center();
  const auto put = [](float* to, Vec3d from) {
    to[0] = static_cast<float>(from.x);
    to[1] = static_cast<float>(from.y);
    to[2] = static_cast<float>(from.z);
    to[3] = 0;
  };
  TileAxes axes{};
  put(axes.origin, Vec3d(c));
  put(axes.u, u);
  put(axes.v, v);
  put(axes.w, w);
  return axes;
}

TileExtents no_extents() {
  TileExtents e{};
  std::fill(std::begin(e.u_lo), std::end(e.u_lo), std::numeric_limits<float>::max());
  std::fill(std::begin(e.v_lo), std::end(e.v_lo), std::numeric_limits<float>::max());
  std::fill(std::begin(e.u_hi), std::end(e.u_hi), std::numeric_limits<float>::lowest());
  std::fill(std::begin(e.v_hi), std::end(e.v_hi), std::numeric_limits<float>::lowest());
  e.w_lo = std::numeric_limits<float>::max();
  e.w_hi = std::numeric_limits<float>::lowest();
  return e;
}

void add(TileExtents& to, const TileExtents& from) {
  for (int k = 0; k < RBVH_FRAME_ANGLES; ++k) {
    to.u_lo[k] = std::min(to.u_lo[k], from.u_lo[k]);
    to.u_hi[k] = std::max(to.u_hi[k], from.u_hi[k]);
    to.v_lo[k] = std::min(to.v_lo[k], from.v_lo[k]);
    to.v_hi[k] = std::max(to.v_hi[k], from.v_hi[k]);
  }
  to.w_lo = std::min(to.w_lo, from.w_lo);
  to.w_hi = std::max(to.w_hi, from.w_hi);
}

Vec3d vec(const float* p) { return {p[0], p[1], p[2]}; }

void set_row(float* row, Vec3d direction, Vec3d origin, double scale, double offset) {
  row[0] = static_cast<float>(direction.x * scale);
  row[1] = static_cast<float>(direction.y * scale);
  row[2] = static_cast<float>(direction.z * scale);
  // Computed from the rounded row, so that the tile's centre lands where it should.
  row[3] = static_cast<float>(offset - (row[0] * origin.x + row[1] * origin.y + row[2] * origin.z));
}

/// What the primitives cover of the tile's plane; folded noise is not allowed to make it small without bound.
float covered_area(const PartitionNode& node) {
  return std::max(node.projected_area(), 0.5f * node.sums.area);
}

/// The smallest rectangle among the angles, sampled so that its texels are as many as the paper's square tile
/// has.
RasterTile make_raster_tile(const PartitionNode& node, const TileAxes& axes, const TileExtents& e,
                            const RasterConfig& config) {
  int best = 0;
  double best_area = std::numeric_limits<double>::max();
  for (int k = 0; k < RBVH_FRAME_ANGLES; ++k) {
    const double area =
        (static_cast<double>(e.u_hi[k]) - e.u_lo[k]) * (static_cast<double>(e.v_hi[k]) - e.v_lo[k]);
    if (area < best_area) {
      best_area = area;
      best = k;
    }
  }
  const double angle = best * (std::numbers::pi / 2) / RBVH_FRAME_ANGLES;
  const Vec3d u = vec(axes.u) * std::cos(angle) + vec(axes.v) * std::sin(angle);
  const Vec3d v = vec(axes.v) * std::cos(angle) - vec(axes.u) * std::sin(angle);
  const double width = std::max(0.0f, e.u_hi[best] - e.u_lo[best]),
               height = std::max(0.0f, e.v_hi[best] - e.v_lo[best]);
  const double longest = std::max({width, height, static_cast<double>(e.w_hi) - e.w_lo, 1e-30});
  // All tiles have the paper's density, whatever part of their rectangle is covered; a sliver of a rectangle
  // must not become a single row of endless texels.
  const double area = node.sums.area, resolution = tile_resolution(node, config.rho);
  double texel =
      std::sqrt(config.fill / config.rho) * (area > 0 ? std::min(1.0, covered_area(node) / area) : 1.0);
  texel = std::max(texel, longest / (16 * resolution + 4));
  texel = std::max(texel, longest / (kMaxSide - 16));
  texel = std::max(texel, longest * 1e-6);

  const double border = std::ceil(config.reach) - 1;
  RasterTile tile{};
  tile.width = static_cast<std::uint32_t>(std::ceil(width / texel - 1e-3) + 1 + 2 * border);
  tile.height = static_cast<std::uint32_t>(std::ceil(height / texel - 1e-3) + 1 + 2 * border);
  tile.width = std::max(2u, tile.width);
  tile.height = std::max(2u, tile.height);
  // Fine quanta leave room for extrapolation at the rim.
  const double w_lo = e.w_lo - 2 * texel, w_hi = e.w_hi + 2 * texel, fine = RBVH_FINE_MAX / (w_hi - w_lo);
  const Vec3d origin = vec(axes.origin);
  const double u_mid = 0.5 * (static_cast<double>(e.u_lo[best]) + e.u_hi[best]);
  const double v_mid = 0.5 * (static_cast<double>(e.v_lo[best]) + e.v_hi[best]);
  set_row(tile.to_tile, u, origin, 1 / texel, 0.5 * (tile.width - 1) - u_mid / texel);
  set_row(tile.to_tile + 4, v, origin, 1 / texel, 0.5 * (tile.height - 1) - v_mid / texel);
  set_row(tile.to_tile + 8, vec(axes.w), origin, fine, -w_lo * fine);
  tile.texel_w = static_cast<float>(texel * fine);
  return tile;
}

/// In scan units.
float texel_size(const RasterTile& tile) {
  return 1.0f / length(Vec3f{tile.to_tile[0], tile.to_tile[1], tile.to_tile[2]});
}

}  // namespace

float tile_resolution(const PartitionNode& node, float rho) {
  const float area = node.sums.area;
  return std::sqrt(rho * area * area / std::max(covered_area(node), 1e-30f));
}

namespace {

/// Some nodes' tiles while their texels are on the device. Texels keep their places from first to last.
struct Raster {
  const Primitives& primitives;
  const Partition& partition;
  const RasterConfig& config;
  std::vector<std::uint32_t> nodes;  ///< one a tile
  std::vector<RasterTile> tiles;
  Buffer<std::uint32_t> keys;
  std::uint64_t texel_count = 0;

  const Device& device() const { return primitives.device; }
  std::size_t group() const { return job_group_size(primitives.device); }
  std::uint32_t discs() const { return primitives.discs ? 1 : 0; }
  std::uint32_t tile_count() const { return static_cast<std::uint32_t>(tiles.size()); }
  const PartitionNode& node(std::size_t k) const { return partition.nodes[nodes[k]]; }
};

/// Primitives by tile, in runs for work-items of their own.
struct Runs {
  Buffer<Run> runs;
  std::uint32_t count = 0;
};

Runs own_runs(const Raster& raster) {
  std::vector<Run> runs;
  for (std::uint32_t k = 0; k < raster.nodes.size(); ++k)
    append_runs(runs, k, raster.node(k).begin, raster.node(k).end, kRunLength);
  return {Buffer<Run>(raster.device(), runs), static_cast<std::uint32_t>(runs.size())};
}

std::vector<TileExtents> find_extents(const Raster& raster, const Runs& own,
                                      const std::vector<TileAxes>& axes) {
  const Buffer<TileExtents> partial(raster.device(), own.count);
  raster.device()
      .kernel("build/rasterize", "rasterize_extents")
      .run(own.count, raster.group(), own.runs, own.count, Buffer<TileAxes>(raster.device(), axes),
           raster.partition.references, raster.primitives.shape, raster.discs(), partial);
  const std::vector<Run> runs = own.runs.read();
  const std::vector<TileExtents> parts = partial.read();
  std::vector<TileExtents> extents(raster.nodes.size(), no_extents());
  for (std::size_t r = 0; r < runs.size(); ++r) add(extents[runs[r].owner], parts[r]);
  return extents;
}

void place_texels(Raster& raster, const std::vector<TileAxes>& axes,
                  const std::vector<TileExtents>& extents) {
  raster.tiles.resize(raster.nodes.size());
  for (std::size_t k = 0; k < raster.tiles.size(); ++k) {
    RasterTile& tile = raster.tiles[k];
    tile = make_raster_tile(raster.node(k), axes[k], extents[k], raster.config);
    tile.offset = static_cast<std::uint32_t>(raster.texel_count);
    raster.texel_count += static_cast<std::uint64_t>(tile.width) * tile.height;
    if (raster.texel_count > 0xffffffffu)
      throw Error(ErrorKind::kBudget, "", "a level needs more than 4 billion texels; lower rho");
  }
}

/// The tiles' own primitives, and what they alone show to be wrong.
std::vector<Tile> rasterize_heights(Raster& raster, const Runs& own, const std::vector<TileAxes>& axes) {
  const Device& device = raster.device();
  const Buffer<RasterTile> tiles(device, raster.tiles);
  raster.keys = Buffer<std::uint32_t>(device, raster.texel_count);
  Buffer<std::uint32_t> lowest(device, raster.texel_count), highest(device, raster.texel_count);
  for (Buffer<std::uint32_t>* buffer : {&raster.keys, &lowest, &highest}) buffer->fill(0);
  const Buffer<TileFaults> device_faults(device, std::vector<TileFaults>(raster.tiles.size()));
  const RasterConfig& config = raster.config;
  device.kernel("build/rasterize", "rasterize")
      .run(own.count, raster.group(), own.runs, own.count, tiles, raster.partition.references,
           raster.primitives.shape, raster.discs(), raster.config.own_reach, config.reach, raster.keys,
           lowest, highest, device_faults);
  device.kernel("build/rasterize", "rasterize_faults")
      .run(raster.tiles.size(), raster.group(), tiles, raster.tile_count(), raster.keys, lowest, highest,
           config.layer_gap, config.step_limit, device_faults);
  if (!raster.primitives.discs)
    device.kernel("build/rasterize", "rasterize_misses")
        .run(own.count, raster.group(), own.runs, own.count, tiles, raster.partition.references,
             raster.primitives.shape, config.miss_limit, raster.keys, device_faults);
  const std::vector<TileFaults> faults = device_faults.read();
  std::vector<Tile> drafts(raster.tiles.size());
  for (std::size_t k = 0; k < drafts.size(); ++k) {
    Tile& draft = drafts[k];
    draft.node = raster.nodes[k];
    draft.leaf.width = static_cast<std::uint16_t>(raster.tiles[k].width);
    draft.leaf.height = static_cast<std::uint16_t>(raster.tiles[k].height);
    draft.leaf.primitives = raster.node(k).count();
    draft.has_back = faults[k].backs > 0;
    draft.is_steep = static_cast<float>(faults[k].steep) > 16 * config.steep_limit;
    draft.is_faulty = draft.has_back || draft.is_steep || faults[k].layered > 0 || faults[k].steps > 0 ||
                      faults[k].misses > 0;
    draft.w = Vec3f(vec(axes[k].w));
  }
  return drafts;
}

/// Leaves the tiles that are not final behind; their texels stay where they are.
void drop_tiles(Raster& raster, const std::vector<Tile>& drafts) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < drafts.size(); ++k) {
    if (!drafts[k].is_final) continue;
    raster.nodes[kept] = raster.nodes[k];
    raster.tiles[kept++] = raster.tiles[k];
  }
  raster.nodes.resize(kept);
  raster.tiles.resize(kept);
}

Overlaps overlaps_of(const Raster& raster) {
  std::vector<OverlapQuery> queries(raster.tiles.size());
  for (std::size_t k = 0; k < raster.tiles.size(); ++k) {
    const PartitionNode& node = raster.node(k);
    const float reach = raster.config.reach * texel_size(raster.tiles[k]);
    for (int c = 0; c < 3; ++c) {
      queries[k].lo[c] = node.sums.lo[c] - reach;
      queries[k].hi[c] = node.sums.hi[c] + reach;
    }
    queries[k].begin = node.begin;
    queries[k].end = node.end;
  }
  return find_overlaps(raster.partition, raster.primitives, queries);
}

Runs overlap_runs(const Raster& raster, const Overlaps& overlaps) {
  std::vector<Run> runs;
  for (std::uint32_t k = 0; k < raster.tiles.size(); ++k)
    append_runs(runs, k, overlaps.firsts[k], overlaps.firsts[k + 1], kRunLength);
  return {Buffer<Run>(raster.device(), runs), static_cast<std::uint32_t>(runs.size())};
}

/// The tiles' rims, by what their neighbours have there.
void merge_overlaps(const Raster& raster, const Buffer<RasterTile>& tiles, const Overlaps& overlaps,
                    const Runs& runs) {
  const RasterConfig& config = raster.config;
  Buffer<std::uint32_t> overlap_keys(raster.device(), raster.texel_count);
  overlap_keys.fill(0);
  raster.device()
      .kernel("build/rasterize", "rasterize_widen")
      .run(raster.tiles.size(), raster.group(), tiles, raster.tile_count(), raster.keys);
  raster.device()
      .kernel("build/rasterize", "rasterize_overlaps")
      .run(runs.count, raster.group(), runs.runs, runs.count, tiles, overlaps.primitives,
           raster.primitives.shape, raster.primitives.area_normal,
           config.boundary_apart ? config.boundary_reach : 2 * config.reach, config.reach, config.layer_gap,
           raster.keys, overlap_keys);
  raster.device()
      .kernel("build/rasterize", "rasterize_merge")
      .run(raster.tiles.size(), raster.group(), tiles, raster.tile_count(), raster.keys, overlap_keys,
           config.reach, config.turn_reach, config.open_reach);
}

/// Tells the tiles which of their triangles they do not show.
void find_uncovered(const Raster& raster, const Runs& own, const Buffer<RasterTile>& tiles,
                    std::vector<Tile>& finished) {
  const Device& device = raster.device();
  std::uint32_t room = 1 << 12;
  std::vector<std::uint32_t> list;
  for (bool is_whole = false; !is_whole; room = list[0]) {
    Buffer<std::uint32_t> device_list(device, room + 1);
    device_list.fill(0);
    device.kernel("build/rasterize", "rasterize_uncovered")
        .run(own.count, raster.group(), own.runs, own.count, tiles, raster.partition.references,
             raster.primitives.shape, raster.config.uncovered_slack, raster.keys, room, device_list);
    list = device_list.read();
    is_whole = list[0] <= room;
  }
  const auto first = list.begin() + 1, last = first + list[0];
  std::sort(first, last);
  for (std::size_t k = 0; k < finished.size(); ++k)
    finished[k].uncovered.assign(std::lower_bound(first, last, raster.node(k).begin),
                                 std::lower_bound(first, last, raster.node(k).end));
}

/// Heights in the tiles' own quanta; completes the leaves.
std::vector<std::uint16_t> quantize(const Raster& raster, const Buffer<RasterTile>& device_tiles,
                                    std::vector<Tile>& finished) {
  const Device& device = raster.device();
  const Buffer<TileRange> device_ranges(device, raster.tiles.size());
  device.kernel("build/rasterize", "rasterize_range")
      .run(raster.tiles.size(), raster.group(), device_tiles, raster.tile_count(), raster.keys,
           device_ranges);
  const std::vector<TileRange> ranges = device_ranges.read();
  std::vector<std::uint32_t> bases(raster.tiles.size());
  std::vector<float> scales(raster.tiles.size());
  for (std::size_t k = 0; k < raster.tiles.size(); ++k) {
    const RasterTile& from = raster.tiles[k];
    RBVH_CHECK(ranges[k].used > 0);
    bases[k] = ranges[k].lo;
    // Finer quanta than this fraction of a texel would store noise, and noise does not compress.
    const auto range = static_cast<float>(ranges[k].hi - ranges[k].lo);
    scales[k] = std::min(65534.0f / std::max(range, 1.0f), kQuantaPerTexel / from.texel_w);
    Tile& tile = finished[k];
    std::copy(std::begin(from.to_tile), std::end(from.to_tile), tile.leaf.to_tile);
    float* row = tile.leaf.to_tile + 8;
    for (int c = 0; c < 3; ++c) row[c] *= scales[k];
    row[3] = (row[3] - static_cast<float>(bases[k])) * scales[k] + 1.0f;
    tile.texels_used = ranges[k].used;
    const float rim = 0.4f * texel_size(from);
    const Vec3f pad{rim, rim, rim};
    tile.bounds = raster.node(k).bounds();
    tile.bounds.lo = tile.bounds.lo - pad;
    tile.bounds.hi = tile.bounds.hi + pad;
  }
  const Buffer<std::uint16_t> heights(device, raster.texel_count);
  device.kernel("build/rasterize", "rasterize_quantize")
      .run(raster.tiles.size(), raster.group(), device_tiles, raster.tile_count(),
           Buffer<std::uint32_t>(device, bases), Buffer<float>(device, scales), raster.keys, heights);
  return heights.read();
}

/// Appends the tiles' texels, one tile after the other, as 16 bits each.
template <class T>
void append_texels(const Raster& raster, const std::vector<T>& from, std::vector<std::uint16_t>& to) {
  for (const RasterTile& tile : raster.tiles) {
    const auto first = from.begin() + static_cast<std::ptrdiff_t>(tile.offset);
    std::transform(first, first + static_cast<std::ptrdiff_t>(tile.width) * tile.height,
                   std::back_inserter(to), [](T value) { return static_cast<std::uint16_t>(value); });
  }
}

/// What the final tiles get beyond their own heights.
void finish_tiles(const Raster& raster, std::vector<Tile>& finished, TileTexels& texels) {
  const Device& device = raster.device();
  const Primitives& primitives = raster.primitives;
  const Buffer<RasterTile> tiles(device, raster.tiles);
  const Runs own = own_runs(raster);
  // Of discs there are none: the rim is the scan's own roughness and stays, lest it have holes.
  Overlaps overlaps;
  Runs visiting;
  if (!primitives.discs) {
    overlaps = overlaps_of(raster);
    visiting = overlap_runs(raster, overlaps);
    merge_overlaps(raster, tiles, overlaps, visiting);
    find_uncovered(raster, own, tiles, finished);
  }
  const std::vector<std::uint16_t> heights = quantize(raster, tiles, finished);

  Buffer<std::uint32_t> normals(device, raster.texel_count), colors(device, raster.texel_count);
  normals.fill(0);
  colors.fill(0);
  const auto signals = [&](const Runs& of, const Buffer<std::uint32_t>& references, float reach) {
    device.kernel("build/rasterize", "rasterize_signals")
        .run(of.count, raster.group(), of.runs, of.count, tiles, references, primitives.shape, raster.discs(),
             reach, raster.config.reach, raster.keys, primitives.order, primitives.indices,
             primitives.normals, primitives.colors, primitives.has_colors ? 1u : 0u, normals, colors);
  };
  signals(own, raster.partition.references, raster.config.own_reach);
  if (!primitives.discs) signals(visiting, overlaps.primitives, raster.config.reach);

  std::size_t first = texels.heights.size();
  for (Tile& tile : finished) {
    tile.first_texel = first;
    first += std::size_t{tile.leaf.width} * tile.leaf.height;
  }
  append_texels(raster, heights, texels.heights);
  append_texels(raster, normals.read(), texels.normals);
  if (primitives.has_colors) append_texels(raster, colors.read(), texels.colors);
}

}  // namespace

std::vector<Tile> rasterize_tiles(const Primitives& primitives, const Partition& partition,
                                  const std::vector<std::uint32_t>& nodes, const RasterConfig& config,
                                  const std::function<bool(Tile&)>& is_final, TileTexels& texels) {
  if (nodes.empty()) return {};
  Raster raster{primitives, partition, config, nodes, {}, {}, 0};
  std::vector<Tile> drafts;
  {
    const Runs own = own_runs(raster);
    std::vector<TileAxes> axes(nodes.size());
    for (std::size_t k = 0; k < nodes.size(); ++k) axes[k] = initial_axes(raster.node(k));
    place_texels(raster, axes, find_extents(raster, own, axes));
    drafts = rasterize_heights(raster, own, axes);
  }
  std::vector<Tile> finished;
  for (Tile& draft : drafts) {
    draft.is_final = is_final(draft);
    if (draft.is_final) finished.push_back(draft);
  }
  drop_tiles(raster, drafts);
  if (!finished.empty()) finish_tiles(raster, finished, texels);
  for (const Tile& draft : drafts)
    if (!draft.is_final) finished.push_back(draft);
  return finished;
}

}  // namespace rbvh
