#include "pipeline/rbvh/leaf_policy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace rbvh {
namespace {

/// Nodes of no more texels or primitives are not split for their shape: noise would be split for ever.
constexpr float kFloorTexels = 16;
constexpr std::uint32_t kFloorPrimitives = 4;
/// A faulty tile is split further, down to this many texels.
constexpr float kFaultFloorTexels = 4;
/// A node whose parts want texels so different in number is split.
constexpr float kMostRhoRange = 4;

/// A leaf of no more primitives holds them where its tile is faulty.
constexpr std::uint32_t kMostFaulty = 32;
/// Texels that take as many bytes in the file as a primitive, measured: 3.4 bytes each against 36.
constexpr std::uint32_t kTexelsPerPrimitive = 11;
/// A leaf of uncovered triangles is not spread over more texels for each: its box would be mostly empty.
constexpr std::uint32_t kMaxUncoveredTexels = 64;

/// Of the diagonal.
constexpr float kWidestTexel = 9e-4f;
/// Texels that take as many bytes as a triangle of the scan, simplified to the error of Q0, measured: 1.1
/// bytes each against 2.1 (dragon). Rays take triangles faster as well.
constexpr float kTexelsPerSimplified = 2;
/// Texels that a point of a cloud is worth.
constexpr float kTexelsPerPoint = 1.45f;
constexpr double kNoisyArea = 1.1;
/// More of the primitives at boundary edges: a soup. Fewer texels for each primitive: too coarse a level.
constexpr float kMostBoundary = 0.25f, kLeastBoundaryTexels = 0.5f;

/// In noisy meshes only steps and misses of more texels are worth a split.
constexpr float kNoisyStep = 8;

}  // namespace

float optimal_resolution(float rho, RaysKind rays) {
  return std::max(
      8.0f, rays == RaysKind::kCoherent ? 5.76f * std::log(rho) - 42.99f : 1.23f * std::log(rho) - 0.17f);
}

float covered_area(const NodeFacts& node) { return std::max(node.projected_area, 0.5f * node.area); }

float tile_resolution(const NodeFacts& node, float texels_per_area) {
  return std::sqrt(texels_per_area * node.area * node.area / std::max(covered_area(node), 1e-30f));
}

bool wants_split(const NodeFacts& node, const LeafQuality& quality, Refinement refinement,
                 float largest_tile) {
  if (node.objects == 2) return true;  // one tile would fuse them
  if (tile_resolution(node, quality.texels_per_area) > largest_tile) return true;
  if (node.primitives <= kFloorPrimitives || quality.texels_per_area * node.area <= kFloorTexels)
    return false;
  if (quality.rho > kMostRhoRange * quality.farthest_rho) return true;
  if (refinement == Refinement::kConeOfNormals)
    return node.cone_cosine < std::cos(quality.phi_degrees * std::numbers::pi_v<float> / 180);
  return node.projected_area < quality.alpha * node.area;
}

bool holds_primitives(Hybrid hybrid, const LevelFacts& level) {
  if (hybrid != Hybrid::kAuto || level.is_cloud || level.error == 0) return hybrid == Hybrid::kAlways;
  return level.texel > kWidestTexel ||
         level.rho > kTexelsPerSimplified * static_cast<float>(level.primitives);
}

bool gives_up_tiles(Hybrid hybrid, const LevelFacts& level, float reached) {
  return hybrid == Hybrid::kAuto && !level.is_cloud && level.error > 0 && reached > level.error;
}

float cloud_rho(float rho, std::uint32_t points) {
  const float most = kTexelsPerPoint * static_cast<float>(points);
  return std::min(rho * std::min(1.0f, most / standard_levels().front().rho), most);
}

bool is_noisy_mesh(double area, double smooth_area) { return area > kNoisyArea * smooth_area; }

bool separates_boundary(Hybrid hybrid, const BoundaryFacts& scan) {
  return hybrid == Hybrid::kAuto && scan.boundary > 0 && scan.boundary < kMostBoundary * scan.primitives &&
         scan.texels > kLeastBoundaryTexels * scan.primitives;
}

bool has_mixed_boundary(float boundary, std::uint32_t primitives) {
  return boundary > 0 && boundary < static_cast<float>(primitives);
}

FaultLimits fault_limits(const SurfaceFacts& surface) {
  FaultLimits limits;
  if (surface.is_cloud) {
    limits.layer_gap = std::max(limits.layer_gap, surface.thickness);
    limits.step_limit = std::max(limits.step_limit, surface.thickness);
  } else if (surface.is_noisy) {
    // How single triangles stand is noise.
    limits.step_limit = limits.miss_limit = kNoisyStep;
    limits.steep_area = std::numeric_limits<float>::infinity();
  }
  return limits;
}

TileFlaws find_flaws(const TileFaults& counts, const FaultLimits& limits) {
  return {.has_back = counts.backs > 0,
          .is_steep = static_cast<float>(counts.steep) > 16 * limits.steep_area,
          .is_uneven = counts.layered > 0 || counts.steps > 0 || counts.misses > 0};
}

LeafDecision decide_leaf(const TileFacts& tile, Hybrid hybrid) {
  const std::uint32_t n = tile.primitives;
  if (tile.is_uncovered_group)
    return n == 1 || (n <= kMostLeafPrimitives && tile.texels <= kMaxUncoveredTexels * n)
               ? LeafDecision::kPrimitives
               : LeafDecision::kSplit;
  if (hybrid != Hybrid::kOff && n <= kMostLeafPrimitives) {
    const bool is_poor_fit = tile.is_faulty && n <= kMostFaulty,
               takes_more_bytes = tile.texels >= kTexelsPerPrimitive * n;
    if (hybrid == Hybrid::kAlways || is_poor_fit || takes_more_bytes) return LeafDecision::kPrimitives;
  }
  if (n == 1) return LeafDecision::kRasterize;
  if (hybrid == Hybrid::kAlways) return LeafDecision::kSplit;
  return tile.is_faulty && tile.surface_texels > kFaultFloorTexels ? LeafDecision::kSplit
                                                                   : LeafDecision::kRasterize;
}

LeafDecision decide_uncovered(std::uint32_t uncovered, std::uint32_t primitives) {
  if (uncovered == 0) return LeafDecision::kRasterize;
  if (uncovered < primitives) return LeafDecision::kSplit;
  return primitives <= kMostLeafPrimitives ? LeafDecision::kPrimitives : LeafDecision::kRasterize;
}

FaultSplit choose_fault_split(const TileFlaws& flaws) {
  if (flaws.has_back) return {SplitBy::kFacing, 0};
  if (flaws.has_layers) return {SplitBy::kHeight, 0};
  if (flaws.is_steep) return {SplitBy::kFacing, RBVH_STEEP_COSINE};
  return {};
}

std::uint32_t split_kind(SplitBy by, std::uint32_t objects) {
  if (by == SplitBy::kFirst) return RBVH_SPLIT_COUNT;
  if (objects == 2) return RBVH_SPLIT_OBJECT;
  switch (by) {
    case SplitBy::kFacing:
      return RBVH_SPLIT_FACING;
    case SplitBy::kBoundary:
      return RBVH_SPLIT_BOUNDARY;
    default:
      return RBVH_SPLIT_PLANE;
  }
}

std::uint32_t next_split_kind(std::uint32_t kind) {
  return kind == RBVH_SPLIT_FACING ? RBVH_SPLIT_PLANE : RBVH_SPLIT_COUNT;
}

}  // namespace rbvh
