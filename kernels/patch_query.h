// A patch's hierarchy met by one ray: 16 boxes at once (WIDE), or one node after the other along skip links, as in
// listing 1.1 of Harada, "Rendering Vector Displacement Mapped Surfaces in a GPU Ray Tracer", GPU Pro 6. Boxes only
// lead to the micro-quads: those are met as two triangles each, by the arithmetic of exact_triangle.h, so that
// hits are the tessellated mesh's to the last bit. A ray that wants less than the hierarchy has takes a box for the
// surface, as there.
#ifndef RBVH_PATCH_QUERY_H
#define RBVH_PATCH_QUERY_H
#include "exact_query.h"
#include "patch_surface.h"
#include "wide16_node.h"

// Entries that a traversal by 16s can have waiting: 15 every other level.
#define PATCH_STACK 96

// The nearest hit so far.
typedef struct PatchFound {
  float t;
  float u, v;       // in the patch, 0..1
  float normal[3];  // of the object's space, any length
  uint hit;         // 0: nothing
} PatchFound;

typedef struct PatchTree {
  __global const PatchBlock* blocks;
  __global const float* vertices;
  uint level;
  uint wanted;  // levels that the ray can resolve; at most `level`
} PatchTree;

// The ray's planes in quanta of the patch's box: t = quanta * scale + near, or far.
typedef struct PatchRay {
  float scale[3], near[3], far[3];
} PatchRay;

static inline PatchRay patch_ray(__global const Patch* p, const Query* q) {
  PatchRay r;
  for (uint axis = 0; axis < 3; ++axis) {
    const float lo = p->lo[axis];
    r.scale[axis] = (p->hi[axis] - lo) * (1.0f / 65535.0f) * q->inverse[axis];
    r.near[axis] = lo * q->inverse[axis] + q->near_offset[axis];
    r.far[axis] = lo * q->inverse[axis] + q->far_offset[axis];
  }
  return r;
}

// 16 boxes of quanta, as meet_children().
static inline uint meet_planes16(__global const ushort (*planes)[PATCH_WIDTH], const Query* q, const PatchRay* r,
                                 float limit, float16* entry) {
#define PLANES(row, i, offset) \
  mad(convert_float16(vload16(0, planes[q->row[i]])), (float16)(r->scale[i]), (float16)(r->offset[i]))
  const float16 enter = max(max(PLANES(near_row, 0, near), PLANES(near_row, 1, near)),
                            max(PLANES(near_row, 2, near), (float16)(q->tmin)));
  const float16 leave = min(min(PLANES(far_row, 0, far), PLANES(far_row, 1, far)),
                            min(PLANES(far_row, 2, far), (float16)(limit)));
#undef PLANES
  *entry = enter;
  return lane_bits16(enter <= leave);
}

// The level that resolves what the ray does at t: the patch's box in micro-quads no larger than that. `speed`: the
// direction's length.
static inline uint wanted_level(__global const Patch* p, RayDetail detail, float t, float speed, uint most) {
  const float resolved = (detail.width + detail.spread * max(t, 0.0f)) * speed;
  const float3 extent = vload3(0, p->hi) - vload3(0, p->lo);
  const float pieces = max(extent.x, max(extent.y, extent.z)) / resolved;
  if (!(pieces < (float)(1u << PATCH_MOST_LEVEL))) return most;
  uint level = 0;
  while (level < most && (float)(1u << level) < pieces) ++level;
  return level;
}

// Micro-quad m of the finest level: triangles a b c and a c d. True where the hit is nearer.
static inline bool meet_micro_quad(const PatchTree* tree, uint m, const Query* q, PatchFound* found) {
  const uint n = 1u << tree->level, side = n + 1, count = side * side, i = even_bits(m), j = even_bits(m >> 1);
  __global const float* at = tree->vertices + j * side + i;
#define CORNERS(axis) \
  (float4)(vload2(0, at + (axis) * count), vload2(0, at + (axis) * count + side).s10)
  const float4 z = CORNERS(q->kz) - q->origin[q->kz];
  const float4 x = (CORNERS(q->kx) - q->origin[q->kx]) - q->sx * z;
  const float4 y = (CORNERS(q->ky) - q->origin[q->ky]) - q->sy * z;
  // Twice the signed areas between the ray and the edges ab, bc, cd, da; and the diagonal ac.
  float4 edge = x * y.yzwx - y * x.yzwx;
  float ac = x.s0 * y.s2 - y.s0 * x.s2;
#ifdef cl_khr_fp64
  if (any(edge == 0.0f) || ac == 0.0f) {
    const double4 dx = convert_double4(x), dy = convert_double4(y);
    edge = convert_float4(dx * dy.yzwx - dy * dx.yzwx);
    ac = (float)(dx.s0 * dy.s2 - dy.s0 * dx.s2);
  }
#endif
  const float4 tz = q->sz * z;
  bool taken = false;
#define MEET(u, v, w, tu, tv, tw, s_value, t_value, e, f)                                                           \
  if (!((u < 0.0f || v < 0.0f || w < 0.0f) && (u > 0.0f || v > 0.0f || w > 0.0f)) && u + v + w != 0.0f) {             \
    const float area = u + v + w, t = (u * tu + v * tv + w * tw) / area;                                                \
    if (t >= q->tmin && (t < found->t || (t == found->t && !found->hit))) {                                             \
      const float V = v / area, W = w / area;                                                                           \
      found->t = t;                                                                                                     \
      found->u = ((float)i + (s_value)) / (float)n;                                                                     \
      found->v = ((float)j + (t_value)) / (float)n;                                                                     \
      found->hit = 1;                                                                                                   \
      taken = true;                                                                                                     \
      float p[3], r[3];                                                                                                 \
      for (uint axis = 0; axis < 3; ++axis) {                                                                           \
        const float4 corners = CORNERS(axis);                                                                           \
        p[axis] = corners.e - corners.x;                                                                                \
        r[axis] = corners.f - corners.x;                                                                                \
      }                                                                                                                 \
      const float scale = 1.0f / max(max(max(fabs(p[0]), fabs(p[1])), fabs(p[2])),                                      \
                                     max(max(fabs(r[0]), fabs(r[1])), fabs(r[2])));                                     \
      for (uint axis = 0; axis < 3; ++axis) {                                                                           \
        p[axis] *= scale;                                                                                               \
        r[axis] *= scale;                                                                                               \
      }                                                                                                                 \
      for (uint axis = 0; axis < 3; ++axis) {                                                                           \
        const uint a1 = (axis + 1) % 3, a2 = (axis + 2) % 3;                                                            \
        found->normal[axis] = p[a1] * r[a2] - p[a2] * r[a1];                                                            \
      }                                                                                                                 \
    }                                                                                                                   \
  }
  {
    const float u = -edge.y, v = ac, w = -edge.x;  // opposite a, b, c
    MEET(u, v, w, tz.x, tz.y, tz.z, V + W, W, y, z)
  }
  {
    const float u = -edge.z, v = -edge.w, w = -ac;  // opposite a, c, d
    MEET(u, v, w, tz.x, tz.z, tz.w, V, V + W, z, w)
  }
#undef MEET
#undef CORNERS
  return taken;
}

// The box of a node as a hit.
static inline void take_box(__global const PatchBlock* block, uint lane, float t, PatchFound* found) {
  const uint n = block->normals[lane], uv = block->uvs[lane];
  found->t = t;
  found->u = (float)(uv & 0xffff) / 65535.0f;
  found->v = (float)(uv >> 16) / 65535.0f;
  found->normal[0] = (float)((int)(n << 21) >> 21) / 1023.0f;
  found->normal[1] = (float)((int)(n << 10) >> 21) / 1023.0f;
  found->normal[2] = (float)((int)n >> 22) / 511.0f;
  found->hit = 1;
}

#ifdef WIDE
// Nearest hit, or any. Returns blocks and micro-quads visited.
static uint traverse_patch(const PatchTree* tree, __global const Patch* p, __global const uint* links, const Query* q,
                           uint any, PatchFound* found) {
  const uint level = tree->level;
  if (level == 0) return meet_micro_quad(tree, 0, q, found), 1;
  const PatchRay ray = patch_ray(p, q);
  uint stack[PATCH_STACK], depth = 0, visited = 0;
  float stack_t[PATCH_STACK];
  // A block's place, and its level above.
  uint current = level & 1 ? 1u << 24 : 2u << 24 | 1u, lanes = level & 1 ? 0xf000u : 0xffffu;
  while (true) {
    ++visited;
    const uint at = current & 0xffffff, at_level = current >> 24;
    __global const PatchBlock* block = tree->blocks + at;
    float16 entry;
    uint mask = meet_planes16(block->planes, q, &ray, found->t, &entry) & lanes;
    lanes = 0xffffu;
    uint next = 0;
    if (mask != 0) {
      const uint first = PATCH_WIDTH * at - PATCH_FIRST_LANE;  // lane 0's node
      if (at_level == level) {
        float t[16];
        vstore16(entry, 0, t);
        for (; mask != 0;) {  // nearest first
          uint lane = lowest_bit(mask);
          for (uint rest = mask & (mask - 1); rest != 0; rest &= rest - 1) {
            const uint other = lowest_bit(rest);
            if (t[other] < t[lane]) lane = other;
          }
          mask &= ~(1u << lane);
          if (t[lane] > found->t) break;
          ++visited;
          if (meet_micro_quad(tree, first + lane - first_node(level), q, found) && any) return visited;
        }
      } else {
        if (at_level >= tree->wanted) {
          // The surface is no finer than these boxes; but what the ray starts in, it does not hit.
          const uint outside = mask & lane_bits16(entry > q->tmin);
          if (outside != 0) {
            float t[16];
            vstore16(entry, 0, t);
            uint lane = lowest_bit(outside);
            for (uint rest = outside & (outside - 1); rest != 0; rest &= rest - 1)
              if (t[lowest_bit(rest)] < t[lane]) lane = lowest_bit(rest);
            if (t[lane] < found->t) take_box(block, lane, t[lane], found);
            if (any) return visited;
            mask &= ~outside;
          }
        }
        if (mask != 0)
          next = take_children(0, first + 1 + ((at_level + 2) << 24), mask, entry, stack, stack_t, &depth);
      }
    }
    while (next == 0) {
      if (depth == 0) return visited;
      --depth;
      if (stack_t[depth] <= found->t) next = stack[depth];
    }
    current = next;
  }
}
#else
#define LINK_END 0xffffu

static inline uint child_link(__global const uint* links, uint deep, uint node) {
  return deep ? 4 * node + 1 : links[node] >> 16;
}
static inline uint skip_link(__global const uint* links, uint deep, uint node) {
  if (!deep) return links[node] & 0xffff;
  while (node != 0 && node % 4 == 0) node = (node - 1) / 4;
  return node == 0 ? 0xffffffffu : node + 1;
}

static uint traverse_patch(const PatchTree* tree, __global const Patch* p, __global const uint* links, const Query* q,
                           uint any, PatchFound* found) {
  const PatchRay ray = patch_ray(p, q);
  const uint leaves = first_node(tree->level), boxes = first_node(tree->wanted);
  const uint deep = tree->level > PATCH_LINKED_LEVEL, end = deep ? 0xffffffffu : LINK_END;
  uint node = 0, visited = 0;
  while (node != end) {
    ++visited;
    const uint at = node + PATCH_FIRST_LANE, lane = at % PATCH_WIDTH;
    __global const PatchBlock* block = tree->blocks + at / PATCH_WIDTH;
    float enter = q->tmin, leave = found->t;
    for (uint axis = 0; axis < 3; ++axis) {
      enter = max(enter, mad((float)block->planes[q->near_row[axis]][lane], ray.scale[axis], ray.near[axis]));
      leave = min(leave, mad((float)block->planes[q->far_row[axis]][lane], ray.scale[axis], ray.far[axis]));
    }
    if (!(enter <= leave)) {
      node = skip_link(links, deep, node);
    } else if (node >= leaves) {
      if (meet_micro_quad(tree, node - leaves, q, found) && any) return visited;
      node = skip_link(links, deep, node);
    } else if (node >= boxes && enter > q->tmin) {
      if (enter < found->t) take_box(block, lane, enter, found);
      if (any) return visited;
      node = skip_link(links, deep, node);
    } else {
      node = child_link(links, deep, node);
    }
  }
  return visited;
}
#endif
#endif
