// The decisions of a build, apart from its work: which nodes become leaves of a level, which leaves are
// rasterised and which hold primitives, and how the others are split. Plain facts in, a
// decision out. tests/unit/leaf_policy_test.cpp shows why each rule is there.
#pragma once

#include <cstdint>

#include "kernels/common/layout.h"
#include "rbvh/build.h"

namespace rbvh {

// --- nodes of the partition ---

/// The best side of a tile in texels: 5.76 ln rho - 42.99 for coherent rays, 1.23 ln rho - 0.17 for
/// incoherent ones, at least 8. A node is split while its tile would be larger.
float optimal_resolution(float rho, RaysKind rays);

struct NodeFacts {
  std::uint32_t primitives = 0;
  std::uint32_t objects = 1;  ///< 1, 2 or, for more, 3
  float area = 0;             ///< scan units squared
  float projected_area = 0;   ///< along the mean normal
  float cone_cosine = 1;      ///< of the half-angle of the cone of normals
};

/// What a level asks for at a node's place.
struct LeafQuality {
  float rho = 0;  ///< texels for the whole surface
  float texels_per_area = 0;
  float alpha = 0;         ///< least projected area over area
  float phi_degrees = 90;  ///< widest half-angle of the cone of normals
  float farthest_rho = 0;  ///< rho at the node's point farthest from the focus; without a focus: rho
};

/// The area that a tile's texels are spread over: the projected one, but noisy folds must not make it vanish.
float covered_area(const NodeFacts& node);

/// The paper's R = sqrt(rho A^2 / A_projected): the side of a square tile in texels.
float tile_resolution(const NodeFacts& node, float texels_per_area);

/// Whether a node is split further, before anything is rasterised. `largest_tile`: side in texels.
bool wants_split(const NodeFacts& node, const LeafQuality& quality, Refinement refinement,
                 float largest_tile);

// --- the level as a whole ---

struct LevelFacts {
  bool is_cloud = false;
  float error = 0;  ///< the level's, of the diagonal; 0: the paper's tiles
  float rho = 0;
  float texel = 0;  ///< its side, of the diagonal
  std::uint32_t primitives = 0;
};

/// Whether all leaves of a level hold primitives, simplified within its error: where texels are so wide that
/// depth steps between them show, and where there are so many for each triangle that triangles take fewer
/// bytes (docs/benchmarks.md).
bool holds_primitives(Hybrid hybrid, const LevelFacts& level);

/// Whether a level of tiles that came to this error (of the diagonal) is to be one of primitives, as tiles of
/// its density do not hold what the scan has.
bool gives_up_tiles(Hybrid hybrid, const LevelFacts& level, float reached);

/// No leaf that holds primitives has more.
inline constexpr std::uint32_t kMostLeafPrimitives = 64;

/// Texels finer than a cloud's points lie apart hold nothing that coarser ones do not: all levels of a cloud
/// are made coarser by as much as it takes for Q0 to have no more texels than its points are worth, and no
/// level has more.
float cloud_rho(float rho, std::uint32_t points);

/// A mesh whose noise adds more than a tenth to its area is noisy all over. `smooth_area`: without that
/// noise.
bool is_noisy_mesh(double area, double smooth_area);

struct BoundaryFacts {
  float boundary = 0;    ///< primitives at a boundary edge of the scan
  float primitives = 0;  ///< all of them
  float texels = 0;      ///< for the whole surface
};

/// Whether primitives at boundary edges are kept out of tiles, which end at whole texels. Not where most of
/// the scan is boundary (a soup of pieces), nor where texels are coarser than triangles.
bool separates_boundary(Hybrid hybrid, const BoundaryFacts& scan);

/// Whether a leaf has primitives at boundary edges and others, and is split by that.
bool has_mixed_boundary(float boundary, std::uint32_t primitives);

/// What a tile's faults are measured against, in texels.
struct FaultLimits {
  float layer_gap = 2;      ///< coverings of a texel further apart in height are two layers
  float steep_area = 4;     ///< more area of steep primitives is worth a split
  float miss_limit = 0.75;  ///< corners further from the heights around them are worth a split
  float step_limit = 2;     ///< neighbours further apart in height are worth a split
};

struct SurfaceFacts {
  bool is_cloud = false;
  bool is_noisy = false;  ///< a mesh
  float thickness = 0;    ///< of a cloud: what lies less far apart in height is one surface; texels
};

FaultLimits fault_limits(const SurfaceFacts& surface);

// --- tiles ---

/// Why a height field is a poor fit for a tile's primitives.
struct TileFlaws {
  bool has_back = false;    ///< part of it faces away from the tile
  bool has_layers = false;  ///< a cloud's: part of it lies above another part
  bool is_steep = false;    ///< part of it is steep on the tile's plane
  bool is_uneven = false;   ///< two layers, a depth step, or corners far from the heights

  bool any() const { return has_back || has_layers || is_steep || is_uneven; }
};

TileFlaws find_flaws(const TileFaults& counts, const FaultLimits& limits);

/// A tile once its own primitives are rasterised.
struct TileFacts {
  std::uint32_t primitives = 0;
  std::uint32_t texels = 0;         ///< of its rectangle
  float surface_texels = 0;         ///< texels_per_area times the area of its primitives
  bool is_faulty = false;           ///< it has flaws, or its boundary is separated
  bool is_uncovered_group = false;  ///< all its primitives were uncovered in another tile
};

enum class LeafDecision { kRasterize, kPrimitives, kSplit };

LeafDecision decide_leaf(const TileFacts& tile, Hybrid hybrid);

/// What becomes of a finished tile of which some triangles are uncovered: no ray finds them in it. kSplit:
/// these become leaves of their own.
LeafDecision decide_uncovered(std::uint32_t uncovered, std::uint32_t primitives);

// --- how a node is split ---

enum class SplitBy {
  kRule,      ///< the partition's: spatial median or surface area heuristic
  kFacing,    ///< primitives that face a direction from those that do not
  kHeight,    ///< an upper layer from a lower one
  kBoundary,  ///< primitives at boundary edges from those that are not
  kFirst,     ///< the first few references from the rest
};

/// How a faulty tile is split. `cosine`: with kFacing, the least one of primitives that face the tile's
/// normal.
struct FaultSplit {
  SplitBy by = SplitBy::kRule;
  float cosine = 0;
};
FaultSplit choose_fault_split(const TileFlaws& flaws);

/// The kind of split (RBVH_SPLIT_*). Two objects are split apart first: one tile would fuse them.
std::uint32_t split_kind(SplitBy by, std::uint32_t objects);

/// The kind to try next where one leaves a side empty; RBVH_SPLIT_COUNT never does.
std::uint32_t next_split_kind(std::uint32_t kind);

}  // namespace rbvh
