// wide16: a 16-wide hierarchy over triangles (default) or discs (-DDISCS). A ray is tested against all boxes
// of a node, and all primitives of a block, in one vector instruction each. Or a camera's beam of 64 rays a
// work-item: the bounds of the rays against all boxes of a node at once, and each primitive against the
// packets of 16 that may hit it. The default: nothing is faster on a CPU with wide vectors.
//
//   WideNode, 448 bytes: the boxes of 16 children, one row of 16 floats a plane, then the children
//   | lo.x 0..15 | lo.y 0..15 | lo.z 0..15 | hi.x 0..15 | hi.y 0..15 | hi.z 0..15 | child 0..15 |
//   FloatCluster, 320 bytes: 16 triangles over 16 vertices
//   | x 0..15 | y 0..15 | z 0..15 | a 0..15 | b 0..15 | c 0..15 | two planes, count | index in the scan 0..15
//   |
//
// STACK: entries that any ray can need.
#include "kernels/bvh/group_traverse.h"

#ifdef DISCS
typedef DiscBlock LeafBlock;
#else
typedef FloatCluster LeafBlock;
#endif

typedef struct Tree {
  __global const WideNode* nodes;
  __global const LeafBlock* blocks;
  const BvhRoot* scene;
  BOUNDS_MEMBER
} Tree;

#define TREE_ARGUMENTS \
  __global const WideNode *nodes, __global const LeafBlock *blocks, __global const uint *unused, BvhRoot scene
#define TREE \
  { nodes, blocks, &scene BOUNDS_VALUE }

// Indices in the scan.
static ALWAYS_INLINE uint primitive_id(const Tree* tree, uint block, uint lane) {
  return tree->blocks[block].places[lane];
}

static ALWAYS_INLINE uint leaf_of(__global const LeafBlock* block, uint lane) { return block->places[lane]; }

static ALWAYS_INLINE uint flags_of(__global const LeafBlock* block, uint lane) {
  return RBVH_HIT_ON_PRIMITIVE;
}

#include "kernels/trace/block_hit.h"

static ALWAYS_INLINE bool intersect_leaf(const Tree* tree, uint block, const PreparedRay* q, uint any,
                                         Found* found, uint2* visited) {
  ++visited->y;
  return intersect_block(tree, block, q, found);
}

static ALWAYS_INLINE bool intersect_leaf_beam(const Tree* tree, uint block, const Beam* b, uint any,
                                              BeamFound* found, uint2* visited) {
  ++visited->y;
  return intersect_block_beam(tree, block, b, found);
}

static ALWAYS_INLINE void ask_child(const Tree* tree, uint child) {
  if (child & BVH_LEAF_BIT) {
    ASK(tree->blocks + (child & ~BVH_LEAF_BIT), sizeof(LeafBlock));
  } else {
    ASK(tree->nodes + child, sizeof(WideNode));
  }
}

static ALWAYS_INLINE uint cull_leaf(const Tree* tree, uint block, const Group* g, uint rays, float16 enter,
                                    float16 leave) {
  return rays_between(&tree->blocks[block].between, &g->lanes, rays, enter, leave);
}

DEFINE_TRAVERSE(traverse_from, Tree, PreparedRay, Found, open_node, intersect_leaf, limit_of)
DEFINE_OCCLUDED(occluded_from, Tree, intersect_leaf)
DEFINE_TRAVERSE_GROUP(traverse_group, Tree, ask_child, cull_leaf, intersect_leaf, traverse_from,
                      occluded_from)
DEFINE_TRAVERSE(traverse_beam, Tree, Beam, BeamFound, open_beam, intersect_leaf_beam, limit_of_beam)

// So that every ray finds what it finds alone.
static ALWAYS_INLINE bool takes_beam(const Beam* b) {
#ifdef DISCS
  return true;
#else
  return is_shear_of_each(b);
#endif
}

static ALWAYS_INLINE Hit make_hit(const Tree* tree, const Found* found, const Ray* ray) {
  return found->id == RBVH_NO_LEAF ? no_hit() : make_block_hit(tree, found, ray);
}

// What make_hit() computes, for 16 rays at once.
static ALWAYS_INLINE void make_hits16(const Tree* tree, const Found16* found, const float16* o,
                                      const float16* d, HitLanes* h) {
  no_hits(h);
  const int16 hit = found->id != RBVH_NO_LEAF;
  if (lane_bits16(hit) == 0) return;
  h->t = select(h->t, found->t, hit);
  put_block_hits(tree, found, o, d, hit, h);
  mark_back_faces(d, h);
}

static ALWAYS_INLINE uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  return traverse_from(tree, tree->scene->root, q, any, found);
}

#include "kernels/trace/ray_kernels.h"
#include "kernels/trace/group_kernels.h"
#include "kernels/trace/beam_kernels.h"
