// Exact ray casting of triangles (default) or discs (-DDISCS) through a 16-wide hierarchy, one ray a
// work-item: the ray meets all boxes of a node, and all primitives of a block, in one vector instruction
// each.
//
// Triangles: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2013. Every vertex is moved
// into the ray's own space by arithmetic that depends on nothing but the vertex and the ray, so two triangles
// that share an edge see the same edge; a sign that float cannot tell is found in double. Boxes are met with
// the origin moved by an error bound, so that no box is missed whose triangle the test would accept.
//
// STACK: entries that any ray can need.
#pragma OPENCL FP_CONTRACT OFF
#include "camera_rays.h"
#include "exact_layout.h"
#include "lanes.h"
#include "layout.h"

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

// The nearest hit so far.
typedef struct Found {
  float t;
  float u, v;
  uint id;     // in the scan
  uint block;  // 0: nothing
  uint lane;
} Found;

// A ray, prepared.
typedef struct Query {
  float origin[3], direction[3];
  float tmin;
  uint kx, ky, kz;   // kz: the axis along which the direction is longest
  float sx, sy, sz;  // shear
  float inverse[3];
  float near_offset[3], far_offset[3];  // -origin * inverse, moved outwards by the error bound
  uint near_row[3], far_row[3];         // of ExactNode.planes
} Query;

// False where the ray cannot hit anything: not finite, without a direction or an interval.
static bool prepare(const Ray* ray, const ExactScene* scene, Query* q) {
  float longest = 0.0f, reach = 0.0f;
  bool finite = ray->tmin <= ray->tmax;
  q->kz = 0;
  for (uint i = 0; i < 3; ++i) {
    const float o = ray->origin[i], d = ray->direction[i];
    finite = finite && isfinite(o) && isfinite(d);
    q->origin[i] = o;
    q->direction[i] = d;
    if (fabs(d) > longest) {
      longest = fabs(d);
      q->kz = i;
    }
    reach = max(reach, max(fabs(scene->lo[i] - o), fabs(scene->hi[i] - o)));
    reach = max(reach, fabs(o));
  }
  if (!finite || !(longest > 0.0f)) return false;
  q->tmin = ray->tmin;
  q->kx = (q->kz + 1) % 3;
  q->ky = (q->kz + 2) % 3;
  q->sx = q->direction[q->kx] / q->direction[q->kz];
  q->sy = q->direction[q->ky] / q->direction[q->kz];
  q->sz = 1.0f / q->direction[q->kz];
  // Rounding in the triangle test moves things by at most 5 * 2^-24 of the distances along two axes, rounding
  // in the box test by 3 * 2^-24 of the coordinates: together less than this.
  const float margin = 1.2e-6f * reach;
  for (uint i = 0; i < 3; ++i) {
    const float d = q->direction[i];
    const float parallel_limit = 1e-18f * longest;
    // A ray parallel to a slab: its planes are crossed nowhere near, before or behind the origin as the
    // margin decides.
    const float inverse = fabs(d) > parallel_limit ? 1.0f / d : copysign(1e18f / longest, d);
    const float outwards = copysign(margin, inverse);
    q->inverse[i] = inverse;
    q->near_offset[i] = -(q->origin[i] + outwards) * inverse;
    q->far_offset[i] = -(q->origin[i] - outwards) * inverse;
    q->near_row[i] = inverse < 0.0f ? i + 3 : i;
    q->far_row[i] = inverse < 0.0f ? i : i + 3;
  }
  return true;
}

// Children met between tmin and `limit`, as bits; where in `entry`.
static inline uint meet_children(__global const ExactNode* node, const Query* q, float limit,
                                 float16* entry) {
#define PLANES(row, i, offset) \
  mad(vload16(0, node->planes[q->row[i]]), (float16)(q->inverse[i]), (float16)(q->offset[i]))
  const float16 enter = max(max(PLANES(near_row, 0, near_offset), PLANES(near_row, 1, near_offset)),
                            max(PLANES(near_row, 2, near_offset), (float16)(q->tmin)));
  const float16 leave = min(min(PLANES(far_row, 0, far_offset), PLANES(far_row, 1, far_offset)),
                            min(PLANES(far_row, 2, far_offset), (float16)(limit)));
#undef PLANES
  *entry = enter;
  return lane_bits16(enter <= leave);
}

// Takes the lanes in `mask` over into `found` where they are nearer; of equally near ones the lowest index
// wins, so that the result does not depend on the hierarchy.
static inline bool take_nearest(uint mask, float8 t8, float8 u8, float8 v8, __global const ExactBlock* blocks,
                                uint block, Found* found) {
  float t[8], u[8], v[8];
  vstore8(t8, 0, t);
  vstore8(u8, 0, u);
  vstore8(v8, 0, v);
  bool any = false;
  for (; mask != 0; mask &= mask - 1) {
    const uint lane = lowest_bit(mask);
    const uint id = blocks[block].ids[lane];
    if (t[lane] < found->t || (t[lane] == found->t && (found->block == 0 || id < found->id))) {
      *found = (Found){t[lane], u[lane], v[lane], id, block, lane};
      any = true;
    }
  }
  return any;
}

#ifndef DISCS
// U, V, W: twice the signed areas of the triangle's parts opposite a, b and c, seen along the ray.
static inline bool meet_block(__global const ExactBlock* blocks, uint block, const Query* q, Found* found) {
  __global const ExactBlock* b = blocks + block;
  const float8 ox = q->origin[q->kx], oy = q->origin[q->ky], oz = q->origin[q->kz];
  const float8 az = vload8(0, b->rows[q->kz]) - oz;
  const float8 bz = vload8(0, b->rows[q->kz + 3]) - oz;
  const float8 cz = vload8(0, b->rows[q->kz + 6]) - oz;
  const float8 ax = (vload8(0, b->rows[q->kx]) - ox) - q->sx * az;
  const float8 ay = (vload8(0, b->rows[q->ky]) - oy) - q->sy * az;
  const float8 bx = (vload8(0, b->rows[q->kx + 3]) - ox) - q->sx * bz;
  const float8 by = (vload8(0, b->rows[q->ky + 3]) - oy) - q->sy * bz;
  const float8 cx = (vload8(0, b->rows[q->kx + 6]) - ox) - q->sx * cz;
  const float8 cy = (vload8(0, b->rows[q->ky + 6]) - oy) - q->sy * cz;
  float8 u = cx * by - cy * bx;
  float8 v = ax * cy - ay * cx;
  float8 w = bx * ay - by * ax;
#ifdef cl_khr_fp64
  if (lane_bits8((u == 0.0f) | (v == 0.0f) | (w == 0.0f))) {
    // Products of floats are exact in double: now a zero is a zero.
    u = convert_float8(convert_double8(cx) * convert_double8(by) - convert_double8(cy) * convert_double8(bx));
    v = convert_float8(convert_double8(ax) * convert_double8(cy) - convert_double8(ay) * convert_double8(cx));
    w = convert_float8(convert_double8(bx) * convert_double8(ay) - convert_double8(by) * convert_double8(ax));
  }
#endif
  const int8 outside = ((u < 0.0f) | (v < 0.0f) | (w < 0.0f)) & ((u > 0.0f) | (v > 0.0f) | (w > 0.0f));
  const float8 area = u + v + w;
  if (lane_bits8(~outside & (area != 0.0f)) == 0) return false;
  const float8 t = (u * (q->sz * az) + v * (q->sz * bz) + w * (q->sz * cz)) / area;
  const uint mask = lane_bits8(~outside & (area != 0.0f) & (t >= q->tmin) & (t <= found->t));
  return mask != 0 && take_nearest(mask, t, v / area, w / area, blocks, block, found);
}

static inline float3 unit_normal(__global const ExactBlock* b, uint lane) {
  const float3 a = (float3)(b->rows[0][lane], b->rows[1][lane], b->rows[2][lane]);
  const float3 ab = (float3)(b->rows[3][lane], b->rows[4][lane], b->rows[5][lane]) - a;
  const float3 ac = (float3)(b->rows[6][lane], b->rows[7][lane], b->rows[8][lane]) - a;
  // Scaled first: the product of small edges would vanish.
  const float3 e = max(fabs(ab), fabs(ac));
  const float scale = 1.0f / max(e.x, max(e.y, e.z));
  return normalize(cross(ab * scale, ac * scale));
}
#else
// Two unit vectors across a unit normal (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
static inline void disc_frame(float3 n, float3* x, float3* y) {
  const float sign = copysign(1.0f, n.z), a = -1.0f / (sign + n.z), b = n.x * n.y * a;
  *x = (float3)(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
  *y = (float3)(b, sign + n.y * n.y * a, -n.y);
}

static inline float3 unit_normal(__global const ExactBlock* b, uint lane) {
  return (float3)(b->rows[3][lane], b->rows[4][lane], b->rows[5][lane]);
}

static inline bool meet_block(__global const ExactBlock* blocks, uint block, const Query* q, Found* found) {
  __global const ExactBlock* b = blocks + block;
  // From the origin to the centres.
  const float8 cx = vload8(0, b->rows[0]) - q->origin[0];
  const float8 cy = vload8(0, b->rows[1]) - q->origin[1];
  const float8 cz = vload8(0, b->rows[2]) - q->origin[2];
  const float8 nx = vload8(0, b->rows[3]), ny = vload8(0, b->rows[4]), nz = vload8(0, b->rows[5]);
  const float8 radius = vload8(0, b->rows[6]);
  const float8 slope = nx * q->direction[0] + ny * q->direction[1] + nz * q->direction[2];
  const float8 t = (cx * nx + cy * ny + cz * nz) / slope;
  const float8 rx = t * q->direction[0] - cx, ry = t * q->direction[1] - cy, rz = t * q->direction[2] - cz;
  uint mask = lane_bits8((slope != 0.0f) & (rx * rx + ry * ry + rz * rz <= radius * radius) & (t >= q->tmin) &
                         (t <= found->t));
  if (mask == 0 || !take_nearest(mask, t, t, t, blocks, block, found)) return false;
  const uint lane = found->lane;
  const float3 centre = (float3)(b->rows[0][lane], b->rows[1][lane], b->rows[2][lane]);
  const float3 origin = (float3)(q->origin[0], q->origin[1], q->origin[2]);
  const float3 direction = (float3)(q->direction[0], q->direction[1], q->direction[2]);
  const float3 r = (found->t * direction - (centre - origin)) / b->rows[6][lane];
  float3 x, y;
  disc_frame(unit_normal(b, lane), &x, &y);
  found->u = dot(r, x);
  found->v = dot(r, y);
  return true;
}
#endif

// Nearest hit, or any if `any` is set. Returns nodes and blocks visited.
static uint trace(__global const ExactNode* nodes, __global const ExactBlock* blocks, const ExactScene* scene,
                  const Ray* ray, uint any, Found* found) {
  *found = (Found){min(ray->tmax, FLT_MAX), 0.0f, 0.0f, 0u, 0u, 0u};
  Query q;
  if (!prepare(ray, scene, &q)) return 0;
  uint stack[STACK];
  float stack_t[STACK];
  uint depth = 0, steps = 0, current = scene->root;
  while (true) {
    ++steps;
    uint next = 0;  // nearest child met; 0 is the root and no child
    if (current & EXACT_LEAF_BIT) {
      if (meet_block(blocks, current & ~EXACT_LEAF_BIT, &q, found) && any) return steps;
    } else {
      __global const ExactNode* node = nodes + current;
      float16 entry;
      uint mask = meet_children(node, &q, found->t, &entry);
      if (mask != 0) {
        uint lane = lowest_bit(mask);
        mask &= mask - 1;
        next = node->children[lane];
        if (mask != 0) {
          float t[16];
          vstore16(entry, 0, t);
          float next_t = t[lane];
          const uint bottom = depth;
          for (; mask != 0; mask &= mask - 1) {  // the farther ones go on the stack, farthest first
            lane = lowest_bit(mask);
            uint far = node->children[lane];
            float far_t = t[lane];
            if (far_t < next_t) {
              const uint swap = next;
              const float swap_t = next_t;
              next = far;
              next_t = far_t;
              far = swap;
              far_t = swap_t;
            }
            uint at = depth++;
            for (; at > bottom && stack_t[at - 1] < far_t; --at) {
              stack[at] = stack[at - 1];
              stack_t[at] = stack_t[at - 1];
            }
            stack[at] = far;
            stack_t[at] = far_t;
          }
        }
      }
    }
    while (next == 0) {
      if (depth == 0) return steps;
      --depth;
      if (stack_t[depth] <= found->t) next = stack[depth];
    }
    current = next;
  }
}

static inline Hit make_hit(const Found* found, __global const ExactBlock* blocks, const Ray* ray) {
  Hit hit;
  hit.t = INFINITY;
  hit.normal[0] = hit.normal[1] = hit.normal[2] = 0.0f;
  hit.u = hit.v = 0.0f;
  hit.leaf = RBVH_NO_LEAF;
  hit.flags = 0;
  if (found->block != 0) {
    const float3 n = unit_normal(blocks + found->block, found->lane);
    hit.t = found->t;
    hit.normal[0] = n.x;
    hit.normal[1] = n.y;
    hit.normal[2] = n.z;
    hit.u = found->u;
    hit.v = found->v;
    hit.leaf = found->id;
    const float along = n.x * ray->direction[0] + n.y * ray->direction[1] + n.z * ray->direction[2];
    hit.flags = RBVH_HIT_TRIANGLE_LEAF | (along > 0.0f ? RBVH_HIT_BACK_FACE : 0u);
  }
  return hit;
}

__kernel void trace_exact_rays(__global const ExactNode* nodes, __global const ExactBlock* blocks,
                               ExactScene scene, __global const Ray* rays, uint count, uint any,
                               __global Hit* hits, __global uint* steps_out) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const Ray ray = rays[i];
  Found found;
  const uint steps = trace(nodes, blocks, &scene, &ray, any, &found);
  hits[i] = make_hit(&found, blocks, &ray);
  if (steps_out) steps_out[i] = steps;
}

__kernel void trace_exact_camera(__global const ExactNode* nodes, __global const ExactBlock* blocks,
                                 ExactScene scene, CameraRays camera, __global Hit* hits,
                                 __global uint* steps_out) {
  const uint2 pixel = camera_pixel(camera.width, (uint)get_global_id(0));
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  const Ray ray = camera_ray(&camera, pixel.x, pixel.y);
  Found found;
  const uint steps = trace(nodes, blocks, &scene, &ray, 0, &found);
  const uint i = pixel.y * camera.width + pixel.x;
  hits[i] = make_hit(&found, blocks, &ray);
  if (steps_out) steps_out[i] = steps;
}
