// Leaves of a wide hierarchy that are blocks of up to 16 triangles or, with -DDISCS, discs. One ray is tested
// against all at once, a beam's packets against one after the other. Triangles of a block share vertices,
// which lie on a level's lattice (-DLATTICE) or anywhere.
//
// The file that includes this has defined Tree, whose `blocks` they are, of the type LeafBlock, and
//   uint primitive_id(tree, block, lane)   as Found.id; it ascends with the lanes.
#ifndef RBVH_LEAF_BLOCK_H
#define RBVH_LEAF_BLOCK_H
#include "kernels/bvh/disc.h"
#include "kernels/bvh/beam.h"
#include "kernels/bvh/triangle.h"
#include "kernels/bvh/ray_lanes.h"

#pragma OPENCL FP_CONTRACT OFF

// Takes the nearest of the lanes in `mask` over into `found` where it is nearer. u and v are to be divided by
// `sum`.
static ALWAYS_INLINE bool take_nearest(uint mask, float16 t16, float16 u16, float16 v16, float16 sum16,
                                       const Tree* tree, uint block, Found* found) {
  float t[16], u[16], v[16], sum[16];
  vstore16(t16, 0, t);
  vstore16(u16, 0, u);
  vstore16(v16, 0, v);
  vstore16(sum16, 0, sum);
  uint best = lowest_bit(mask);
  for (mask &= mask - 1; mask != 0; mask &= mask - 1) {
    const uint lane = lowest_bit(mask);
    if (t[lane] < t[best]) best = lane;
  }
  const uint id = primitive_id(tree, block, best);
  if (!is_nearer(t[best], id, found)) return false;
  *found = (Found){t[best], u[best] / sum[best], v[best] / sum[best], id, block * LEAF_BLOCK_WIDTH + best};
  return true;
}

// Of 16 bytes that lie on a word: vload16() would take them one by one.
static ALWAYS_INLINE int16 load_bytes(__global const uchar* bytes) {
  return convert_int16(as_uchar16(vload4(0, (__global const uint*)bytes)));
}

static inline uint lanes_in_use(__global const LeafBlock* b) { return (1u << b->between.count) - 1; }

// Rays that may cross the block between its two planes, of those that are in its box from `enter` to `leave`.
// The margin is more than the triangle test and the arithmetic here round (see error_bound()).
static ALWAYS_INLINE uint rays_between(__global const BlockSlab* b, const PreparedLanes* q, uint rays,
                                       float16 enter, float16 leave) {
  float16 height = 0.0f, slope = 0.0f;
  float side = 0.0f;
  for (uint axis = 0; axis < 3; ++axis) {
    const float n = (float)b->normal[axis] * (1.0f / 128);
    height += n * vload16(0, q->origin[axis]);
    slope += n * vload16(0, q->direction[axis]);
    side += fabs(n);
  }
  const float16 margin = 2.0f * side * vload16(0, q->margin), from = slope * max(enter, (float16)(-FLT_MAX)),
                to = slope * leave;
  return rays & lane_bits16((min(from, to) <= b->slab[1] - height + margin) &
                            (max(from, to) >= b->slab[0] - height - margin));
}

// A SeenBlock's lane, for DEFINE_INTERSECT_SEEN().
#define SEEN_ID(s, lane) primitive_id((s)->tree, (s)->number, lane)
#define SEEN_AT(s, lane) ((s)->number * LEAF_BLOCK_WIDTH + (lane))

#ifndef DISCS
// The vertices' coordinates along an axis, from the origin of the rays. The same for a vertex in all blocks,
// to the last bit: no ray slips between these.
static ALWAYS_INLINE float16 vertex_row(const Tree* tree, __global const LeafBlock* b, uint axis,
                                        float origin) {
#ifdef LATTICE
  const int16 k = convert_int16(vload16(0, b->vertices[axis])) + b->base[axis];
  return fma(convert_float16(k), (float16)(tree->lattice->step),
             (float16)(tree->lattice->origin[axis] - origin));
#else
  return vload16(0, b->vertices[axis]) - origin;
#endif
}

static inline float3 block_vertex(const Tree* tree, __global const LeafBlock* b, uint vertex) {
  float p[3];
  for (uint axis = 0; axis < 3; ++axis)
#ifdef LATTICE
    p[axis] = tree->lattice->origin[axis] +
              (float)(b->base[axis] + (int)b->vertices[axis][vertex]) * tree->lattice->step;
#else
    p[axis] = b->vertices[axis][vertex];
#endif
  return (float3)(p[0], p[1], p[2]);
}

static inline float3 unit_normal(const Tree* tree, uint at) {
  __global const LeafBlock* b = tree->blocks + at / LEAF_BLOCK_WIDTH;
  const uint lane = at % LEAF_BLOCK_WIDTH;
  return triangle_normal(block_vertex(tree, b, b->corners[0][lane]),
                         block_vertex(tree, b, b->corners[1][lane]),
                         block_vertex(tree, b, b->corners[2][lane]));
}

// Each vertex is sheared once for all triangles.
static ALWAYS_INLINE bool intersect_block(const Tree* tree, uint block, const PreparedRay* q, Found* found) {
  __global const LeafBlock* b = tree->blocks + block;
  const float16 z = vertex_row(tree, b, q->kz, q->oz);
  const float16 x = vertex_row(tree, b, q->kx, q->ox) - q->sx * z;
  const float16 y = vertex_row(tree, b, q->ky, q->oy) - q->sy * z;
  const int16 c0 = load_bytes(b->corners[0]), c1 = load_bytes(b->corners[1]), c2 = load_bytes(b->corners[2]);
  Areas16 areas;
  const uint inside = triangle_areas16(permute16(x, c0), permute16(y, c0), permute16(x, c1), permute16(y, c1),
                                       permute16(x, c2), permute16(y, c2), &areas);
  const uint crossed = inside & lanes_in_use(b);
  if (crossed == 0) return false;
  const float16 depth = q->sz * z;
  const float16 t =
      (areas.u * permute16(depth, c0) + areas.v * permute16(depth, c1) + areas.w * permute16(depth, c2)) /
      areas.sum;
  const uint mask = crossed & lane_bits16((t >= q->tmin) & (t <= found->t));
  return mask != 0 && take_nearest(mask, t, areas.v, areas.w, areas.sum, tree, block, found);
}

// A block's triangles as a beam sees them: the vertices from its origin, along kx, ky, kz.
typedef struct SeenBlock {
  const Tree* tree;
  uint number;
  __global const LeafBlock* block;
  float vertices[3][16];
} SeenBlock;

static ALWAYS_INLINE uint intersect_seen_triangle(const SeenBlock* s, uint lane, const Beam* b,
                                                  const Packet* p, float16* t, float16* v, float16* w,
                                                  float16* area) {
#define CORNER(i)                                                                           \
  {                                                                                         \
    s->vertices[0][s->block->corners[i][lane]], s->vertices[1][s->block->corners[i][lane]], \
        s->vertices[2][s->block->corners[i][lane]]                                          \
  }
  const float p0[3] = CORNER(0), p1[3] = CORNER(1), p2[3] = CORNER(2);
#undef CORNER
  return intersect_corners_packet(p0, p1, p2, p->sx, p->sy, p->sz, t, v, w, area);
}

DEFINE_INTERSECT_SEEN(intersect_seen_triangles, SeenBlock, intersect_seen_triangle, SEEN_ID, SEEN_AT)

// Each triangle's box, seen from the rays' origin, tells which packets may hit it: most of a block's lie
// beside a packet.
static ALWAYS_INLINE bool intersect_block_beam(const Tree* tree, uint block, const Beam* b,
                                               BeamFound* found) {
  __global const LeafBlock* l = tree->blocks + block;
  const float16 x = vertex_row(tree, l, b->kx, b->origin[b->kx]),
                y = vertex_row(tree, l, b->ky, b->origin[b->ky]),
                z = vertex_row(tree, l, b->kz, b->origin[b->kz]);
  SeenBlock s;
  s.tree = tree;
  s.number = block;
  s.block = l;
  vstore16(x, 0, s.vertices[0]);
  vstore16(y, 0, s.vertices[1]);
  vstore16(z, 0, s.vertices[2]);
  const int16 c0 = load_bytes(l->corners[0]), c1 = load_bytes(l->corners[1]), c2 = load_bytes(l->corners[2]);
  const float16 u = x / z, u0 = permute16(u, c0), u1 = permute16(u, c1), u2 = permute16(u, c2);
  const float16 v = y / z, v0 = permute16(v, c0), v1 = permute16(v, c1), v2 = permute16(v, c2);
  const SeenBoxes boxes = {{min(u0, min(u1, u2)), min(v0, min(v1, v2))},
                           {max(u0, max(u1, u2)), max(v0, max(v1, v2))},
                           least(z * b->side),
                           lanes_in_use(l)};
  return intersect_seen_triangles(&s, b, &boxes, found);
}
#else
// The vector in rows `row` to `row` + 2 of one disc.
static inline float3 block_vector(__global const LeafBlock* b, uint lane, uint row) {
  return (float3)(b->rows[row][lane], b->rows[row + 1][lane], b->rows[row + 2][lane]);
}

static inline float3 unit_normal(const Tree* tree, uint at) {
  return block_vector(tree->blocks + at / LEAF_BLOCK_WIDTH, at % LEAF_BLOCK_WIDTH, 3);
}

static ALWAYS_INLINE bool intersect_block(const Tree* tree, uint block, const PreparedRay* q, Found* found) {
  __global const LeafBlock* b = tree->blocks + block;
  const float16 centre[3] = {vload16(0, b->rows[0]) - q->origin[0], vload16(0, b->rows[1]) - q->origin[1],
                             vload16(0, b->rows[2]) - q->origin[2]};
  const float16 normal[3] = {vload16(0, b->rows[3]), vload16(0, b->rows[4]), vload16(0, b->rows[5])};
  float16 t;
  const int16 inside = intersect_discs16(centre, normal, vload16(0, b->rows[6]), q->direction, &t);
  const uint mask = lane_bits16(inside & (t >= q->tmin) & (t <= found->t));
  return mask != 0 && take_nearest(mask, t, t, t, (float16)(1.0f), tree, block, found);
}

typedef struct SeenBlock {
  const Tree* tree;
  uint number;
  __global const LeafBlock* block;
} SeenBlock;

static ALWAYS_INLINE uint intersect_seen_disc(const SeenBlock* s, uint lane, const Beam* b, const Packet* p,
                                              float16* t, float16* u, float16* v, float16* area) {
  __global const LeafBlock* l = s->block;
  const float centre[3] = {l->rows[0][lane] - b->origin[0], l->rows[1][lane] - b->origin[1],
                           l->rows[2][lane] - b->origin[2]};
  const float normal[3] = {l->rows[3][lane], l->rows[4][lane], l->rows[5][lane]};
  *u = *v = 0.0f;  // put_primitive_hits() finds the place
  *area = 1.0f;
  return lane_bits16(intersect_disc_packet(centre, normal, l->rows[6][lane], p->d, t));
}

DEFINE_INTERSECT_SEEN(intersect_seen_discs, SeenBlock, intersect_seen_disc, SEEN_ID, SEEN_AT)

static ALWAYS_INLINE bool intersect_block_beam(const Tree* tree, uint block, const Beam* b,
                                               BeamFound* found) {
  __global const LeafBlock* l = tree->blocks + block;
  const SeenBlock s = {tree, block, l};
  const float16 radius = vload16(0, l->rows[6]);
  const float16 x = vload16(0, l->rows[b->kx]) - b->origin[b->kx],
                y = vload16(0, l->rows[b->ky]) - b->origin[b->ky],
                z = (vload16(0, l->rows[b->kz]) - b->origin[b->kz]) * b->side;
  SeenBoxes boxes;
  see_boxes(b, x - radius, x + radius, y - radius, y + radius, z - radius, z + radius, lanes_in_use(l),
            &boxes);
  return intersect_seen_discs(&s, b, &boxes, found);
}
#endif
#endif
