#include "pipeline/rbvh/tile.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/guests.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kRunLength = 128;
constexpr std::uint32_t kMaxSide = 4096;
constexpr float kQuantaPerTexel = 512;

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
  double texel = std::sqrt(config.fill / config.rho) * (area > 0 ? covered_area(node) / area : 1.0);
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

std::vector<Tile> rasterize_tiles(const Primitives& primitives, const Partition& partition,
                                  const std::vector<std::uint32_t>& nodes, const RasterConfig& config,
                                  TileTexels& texels) {
  if (nodes.empty()) return {};
  const Device& device = primitives.device;
  const std::size_t group = job_group_size(device);
  std::vector<Run> runs;
  std::vector<TileAxes> axes(nodes.size());
  for (std::uint32_t k = 0; k < nodes.size(); ++k) {
    const PartitionNode& node = partition.nodes[nodes[k]];
    axes[k] = initial_axes(node);
    append_runs(runs, k, node.begin, node.end, kRunLength);
  }
  const auto run_count = static_cast<std::uint32_t>(runs.size());
  const Buffer<Run> device_runs(device, runs);
  std::vector<TileExtents> extents(nodes.size(), no_extents());
  {
    const Buffer<TileExtents> device_extents(device, runs.size());
    device.kernel("rasterize", "rasterize_extents")
        .run(runs.size(), group, device_runs, run_count, Buffer<TileAxes>(device, axes), partition.references,
             primitives.shape, primitives.discs ? 1u : 0u, device_extents);
    const std::vector<TileExtents> partial = device_extents.read();
    for (std::size_t r = 0; r < runs.size(); ++r) add(extents[runs[r].owner], partial[r]);
  }

  std::vector<RasterTile> tiles(nodes.size());
  std::uint64_t texel_count = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    tiles[k] = make_raster_tile(partition.nodes[nodes[k]], axes[k], extents[k], config);
    tiles[k].offset = static_cast<std::uint32_t>(texel_count);
    texel_count += static_cast<std::uint64_t>(tiles[k].width) * tiles[k].height;
    if (texel_count > 0xffffffffu)
      throw Error(ExitCode::kBudget, "", "a level needs more than 4 billion texels; lower rho");
  }
  const auto tile_count = static_cast<std::uint32_t>(tiles.size());
  const Buffer<RasterTile> device_tiles(device, tiles);
  Buffer<std::uint32_t> keys(device, texel_count), lowest(device, texel_count), highest(device, texel_count);
  Buffer<std::uint32_t> backs(device, tiles.size());
  backs.fill(0);
  keys.fill(0);
  lowest.fill(0);
  highest.fill(0);
  const std::uint32_t discs = primitives.discs ? 1 : 0;
  device.kernel("rasterize", "rasterize")
      .run(runs.size(), group, device_runs, run_count, device_tiles, partition.references, primitives.shape,
           discs, config.reach, keys, lowest, highest, backs);

  const Buffer<TileFaults> device_faults(device, tiles.size());
  device.kernel("rasterize", "rasterize_faults")
      .run(tiles.size(), group, device_tiles, tile_count, keys, lowest, highest, config.layer_gap,
           config.step_limit, device_faults);

  std::vector<GuestQuery> queries(tiles.size());
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    const PartitionNode& node = partition.nodes[nodes[k]];
    const float reach = config.reach * texel_size(tiles[k]);
    for (int c = 0; c < 3; ++c) {
      queries[k].lo[c] = node.sums.lo[c] - reach;
      queries[k].hi[c] = node.sums.hi[c] + reach;
    }
    queries[k].begin = node.begin;
    queries[k].end = node.end;
  }
  const Guests guests = find_guests(partition, primitives, queries);
  std::vector<Run> guest_run_list;
  for (std::uint32_t k = 0; k < tiles.size(); ++k)
    append_runs(guest_run_list, k, guests.firsts[k], guests.firsts[k + 1], kRunLength);
  const auto guest_run_count = static_cast<std::uint32_t>(guest_run_list.size());
  const Buffer<Run> guest_runs(device, guest_run_list);
  {
    Buffer<std::uint32_t> guest_keys(device, texel_count);
    guest_keys.fill(0);
    device.kernel("rasterize", "rasterize_guests")
        .run(guest_run_count, group, guest_runs, guest_run_count, device_tiles, guests.primitives,
             primitives.shape, discs, config.reach, config.layer_gap, keys, guest_keys);
    // Of discs the rim is the scan's own roughness: it stays, lest it have holes.
    device.kernel("rasterize", "rasterize_merge")
        .run(texel_count, 256, keys, guest_keys, static_cast<std::uint32_t>(texel_count), config.reach,
             primitives.discs ? 2 * config.reach : config.turn_reach,
             primitives.discs ? 2 * config.reach : config.open_reach);
  }

  const Buffer<TileRange> device_ranges(device, tiles.size());
  device.kernel("rasterize", "rasterize_range")
      .run(tiles.size(), group, device_tiles, tile_count, keys, device_ranges);
  const std::vector<TileRange> ranges = device_ranges.read();
  const std::vector<TileFaults> faults = device_faults.read();
  const std::vector<std::uint32_t> back_texels = backs.read();

  // lowest and highest have served: the signals take their place.
  lowest.fill(0);
  highest.fill(0);
  const auto signals = [&](const Buffer<Run>& of, std::uint32_t count,
                           const Buffer<std::uint32_t>& references) {
    device.kernel("rasterize", "rasterize_signals")
        .run(count, group, of, count, device_tiles, references, primitives.shape, discs, config.reach, keys,
             primitives.order, primitives.indices, primitives.normals, primitives.colors,
             primitives.has_colors ? 1u : 0u, lowest, highest);
  };
  signals(device_runs, run_count, partition.references);
  signals(guest_runs, guest_run_count, guests.primitives);
  std::vector<std::uint32_t> bases(tiles.size());
  std::vector<float> scales(tiles.size());
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    RBVH_CHECK(ranges[k].used > 0);
    bases[k] = ranges[k].lo;
    // Finer quanta than this fraction of a texel would store noise, and noise does not compress.
    const auto range = static_cast<float>(ranges[k].hi - ranges[k].lo);
    scales[k] = std::min(65534.0f / std::max(range, 1.0f), kQuantaPerTexel / tiles[k].texel_w);
  }
  const Buffer<std::uint16_t> heights(device, texel_count);
  device.kernel("rasterize", "rasterize_quantize")
      .run(tiles.size(), group, device_tiles, tile_count, Buffer<std::uint32_t>(device, bases),
           Buffer<float>(device, scales), keys, heights);

  const std::size_t first = texels.heights.size();
  texels.heights.resize(first + texel_count);
  heights.read(std::span(texels.heights).subspan(first));
  const auto narrow = [&](const Buffer<std::uint32_t>& from, std::vector<std::uint16_t>& to) {
    const std::vector<std::uint32_t> wide = from.read();
    to.resize(first + texel_count);
    std::transform(wide.begin(), wide.end(), to.begin() + static_cast<std::ptrdiff_t>(first),
                   [](std::uint32_t value) { return static_cast<std::uint16_t>(value); });
  };
  narrow(lowest, texels.normals);
  if (primitives.has_colors) narrow(highest, texels.colors);

  std::vector<Tile> finished(tiles.size());
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    const PartitionNode& node = partition.nodes[nodes[k]];
    Tile& tile = finished[k];
    tile.node = nodes[k];
    std::copy(std::begin(tiles[k].to_tile), std::end(tiles[k].to_tile), tile.leaf.to_tile);
    float* row = tile.leaf.to_tile + 8;
    for (int c = 0; c < 3; ++c) row[c] *= scales[k];
    row[3] = (row[3] - static_cast<float>(bases[k])) * scales[k] + 1.0f;
    tile.leaf.width = static_cast<std::uint16_t>(tiles[k].width);
    tile.leaf.height = static_cast<std::uint16_t>(tiles[k].height);
    tile.leaf.primitives = node.count();
    tile.texels_used = ranges[k].used;
    tile.first_texel = first + tiles[k].offset;
    tile.has_back = back_texels[k] > 0;
    tile.is_faulty = tile.has_back || faults[k].layered > 0 || faults[k].steps > 0;
    tile.w = Vec3f(vec(axes[k].w));
    const float rim = 0.25f * texel_size(tiles[k]);
    const Vec3f pad{rim, rim, rim};
    tile.bounds = node.bounds();
    tile.bounds.lo = tile.bounds.lo - pad;
    tile.bounds.hi = tile.bounds.hi + pad;
  }
  return finished;
}

}  // namespace rbvh
