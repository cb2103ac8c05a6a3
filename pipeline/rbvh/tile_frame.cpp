#include "pipeline/rbvh/tile_frame.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/leaf_policy.h"
#include "pipeline/rbvh/leaf_rounding.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kMaxSide = 4096;
/// A tile's rectangle is assumed to be so much larger than the part of it that is covered.
constexpr float kFill = 1.5f;

/// A right-handed frame with w along the area-weighted mean normal (the direction of largest projected area);
/// where there is none, as for a small closed piece, along the box's shortest side.
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

std::vector<TileExtents> find_extents(const TileRaster& raster, const Runs& own,
                                      const std::vector<TileAxes>& axes) {
  const Buffer<TileExtents> partial(raster.device(), own.count());
  run_over(raster.device(), own, "build/tile_frame", "tile_frame_extents",
           Buffer<TileAxes>(raster.device(), axes), raster.partition.references, raster.primitives.shape,
           raster.discs(), partial);
  const std::vector<TileExtents> parts = partial.read();
  std::vector<TileExtents> extents(raster.nodes.size(), no_extents());
  for (std::size_t r = 0; r < parts.size(); ++r) add(extents[own.list[r].owner], parts[r]);
  return extents;
}

Vec3d vec(const float* p) { return Vec3d(Vec3f{p[0], p[1], p[2]}); }

int smallest_rectangle(const TileExtents& e) {
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
  return best;
}

void set_row(float* row, Vec3d direction, Vec3d origin, double scale, double offset) {
  row[0] = static_cast<float>(direction.x * scale);
  row[1] = static_cast<float>(direction.y * scale);
  row[2] = static_cast<float>(direction.z * scale);
  // Computed from the rounded row, so that the tile's centre lands where it should.
  row[3] = static_cast<float>(offset - (row[0] * origin.x + row[1] * origin.y + row[2] * origin.z));
}

/// The texel's side in scan units. All tiles have the paper's density, whatever part of their rectangle is
/// covered; but the rectangle of a sliver must not become a single row of endless texels.
double texel_side(const PartitionNode& node, float rho, double longest) {
  const NodeFacts node_facts = facts(node);
  const double area = node.sums.area, resolution = tile_resolution(node_facts, rho);
  double texel = std::sqrt(kFill / rho) * (area > 0 ? std::min(1.0, covered_area(node_facts) / area) : 1.0);
  texel = std::max(texel, longest / (16 * resolution + 4));
  texel = std::max(texel, longest / (kMaxSide - 16));
  return round_texel(std::max(texel, longest * 1e-6));
}

/// The smallest rectangle among the angles, with as many texels as the paper's square tile.
RasterTile make_raster_tile(const PartitionNode& node, const TileAxes& axes, const TileExtents& e, float rho,
                            float dilation) {
  const int best = smallest_rectangle(e);
  const double angle = best * (std::numbers::pi / 2) / RBVH_FRAME_ANGLES;
  const Vec3d u = vec(axes.u) * std::cos(angle) + vec(axes.v) * std::sin(angle);
  const Vec3d v = vec(axes.v) * std::cos(angle) - vec(axes.u) * std::sin(angle);
  const double width = std::max(0.0f, e.u_hi[best] - e.u_lo[best]),
               height = std::max(0.0f, e.v_hi[best] - e.v_lo[best]);
  const double longest = std::max({width, height, static_cast<double>(e.w_hi) - e.w_lo, 1e-30});
  const double texel = texel_side(node, rho, longest);

  const double border = std::ceil(dilation) - 1;
  RasterTile tile{};
  tile.width = static_cast<std::uint32_t>(std::ceil(width / texel - 1e-3) + 1 + 2 * border);
  tile.height = static_cast<std::uint32_t>(std::ceil(height / texel - 1e-3) + 1 + 2 * border);
  tile.width = std::max(2u, tile.width);
  tile.height = std::max(2u, tile.height);
  // The range of the fine quanta leaves room for extrapolation at the border.
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

}  // namespace

std::vector<TileAxes> tile_axes(const Partition& partition, const std::vector<std::uint32_t>& nodes) {
  std::vector<TileAxes> axes;
  axes.reserve(nodes.size());
  for (const std::uint32_t n : nodes) axes.push_back(initial_axes(partition.nodes[n]));
  return axes;
}

void place_tiles(TileRaster& raster, const Runs& own, const std::vector<TileAxes>& axes) {
  const std::vector<TileExtents> extents = find_extents(raster, own, axes);
  raster.tiles.resize(raster.nodes.size());
  for (std::size_t k = 0; k < raster.tiles.size(); ++k) {
    RasterTile& tile = raster.tiles[k];
    tile = make_raster_tile(raster.node(k), axes[k], extents[k], raster.config.rho, kDilation.border);
    tile.offset = static_cast<std::uint32_t>(raster.texel_count);
    raster.texel_count += static_cast<std::uint64_t>(tile.width) * tile.height;
    if (raster.texel_count > 0xffffffffu)
      throw Error(ErrorKind::kBudget, "",
                  "a level needs more than 4 billion texels; a coarser level is wanted");
  }
}

float texel_size(const RasterTile& tile) {
  return 1.0f / length(Vec3f{tile.to_tile[0], tile.to_tile[1], tile.to_tile[2]});
}

}  // namespace rbvh
