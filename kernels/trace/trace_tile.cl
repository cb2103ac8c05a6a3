// Ray casting a level of a pair (Novak & Dachsbacher 2012, section 5): a wide hierarchy over its tiles, a
// march over a tile's height field, a refined hit. Leaves that hold primitives are blocks of them.
//
// STACK: entries that any ray can need.
#include "kernels/bvh/group_traverse.h"
#include "kernels/trace/march_packet.h"
#include "kernels/trace/march_ray.h"
#include "kernels/trace/tile_hit.h"

static ALWAYS_INLINE bool intersect_element(const Tree* tree, uint id, const PreparedRay* q, uint any,
                                            Found* found, uint2* visited) {
  if (id < tree->tile_count) {
    if (!IN_BOUNDS(tree->bounds, TILES, id, 1)) return false;
    return march(tree, id, q, found, visited);
  }
  const uint block = id - tree->tile_count;
  if (!IN_BOUNDS(tree->bounds, BLOCKS, block, 1)) return false;
  ++visited->y;
  return intersect_block(tree, block, q, found);
}

static ALWAYS_INLINE bool intersect_element_beam(const Tree* tree, uint id, const Beam* b, uint any,
                                                 BeamFound* found, uint2* visited) {
  if (id < tree->tile_count) {
    if (!IN_BOUNDS(tree->bounds, TILES, id, 1)) return false;
    return march_beam(tree, id, b, found, visited);
  }
  const uint block = id - tree->tile_count;
  if (!IN_BOUNDS(tree->bounds, BLOCKS, block, 1)) return false;
  ++visited->y;
  return intersect_block_beam(tree, block, b, found);
}

static ALWAYS_INLINE void ask_child(const Tree* tree, uint child) {
  const uint id = child & ~BVH_LEAF_BIT;
  if (!(child & BVH_LEAF_BIT)) {
    ASK(tree->nodes + child, sizeof(WideNode));
  } else if (id < tree->tile_count) {
    ASK(tree->tiles + id, sizeof(RbvhTile));
  } else {
    ASK(tree->blocks + (id - tree->tile_count), sizeof(LeafBlock));
  }
}

static ALWAYS_INLINE uint cull_leaf(const Tree* tree, uint id, const Group* g, uint rays, float16 enter,
                                    float16 leave) {
  if (id < tree->tile_count) return rays;
  const uint block = id - tree->tile_count;
  if (!IN_BOUNDS(tree->bounds, BLOCKS, block, 1)) return 0;
  return rays_between(&tree->blocks[block].between, &g->lanes, rays, enter, leave);
}

DEFINE_TRAVERSE(traverse_from, Tree, PreparedRay, Found, open_node, intersect_element, limit_of)
DEFINE_OCCLUDED(occluded_from, Tree, intersect_element)
DEFINE_TRAVERSE_GROUP(traverse_group, Tree, ask_child, cull_leaf, intersect_element, traverse_from,
                      occluded_from)
DEFINE_TRAVERSE(traverse_beam, Tree, Beam, BeamFound, open_beam, intersect_element_beam, limit_of_beam)

// A tile is an approximation: rays need not find to the last bit what they find alone.
static inline bool takes_beam(const Beam* b) { return true; }

static ALWAYS_INLINE uint2 traverse(const Tree* tree, const PreparedRay* q, uint any, Found* found) {
  return traverse_from(tree, tree->scene->root, q, any, found);
}

#include "kernels/trace/ray_kernels.h"
#include "kernels/trace/group_kernels.h"
#include "kernels/trace/beam_kernels.h"
