// All leaves that a point of the surface lies in, or that come within a radius of it (section 5 of the
// paper): a depth-first traversal of the stored binary tree, whose boxes the host has widened by what tiles
// rasterise past their leaves' boxes.
#include "kernels/common/bounds.h"
#include "kernels/common/layout.h"

#define HEIGHTS 2u, sizeof(ushort)
#define PRIMITIVES 5u, sizeof(RbvhPrimitive)
#define STACK 66  // no node is deeper than 64: see docs/file_format.md

static inline float3 row(__global const RbvhLeaf* leaf, uint i) { return vload3(0, leaf->to_tile + 4 * i); }

static inline float box_distance2(__global const RbvhNode* node, float3 p) {
  const float3 d = max(max(vload3(0, node->lo) - p, p - vload3(0, node->hi)), (float3)(0.0f));
  return dot(d, d);
}

// Ericson, Real-Time Collision Detection, 5.1.5, as a distance.
static inline float triangle_distance2(float3 p, float3 a, float3 b, float3 c) {
  const float3 ab = b - a, ac = c - a, ap = p - a;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap);
  float3 q;
  const float3 bp = p - b, cp = p - c;
  const float d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
  const float va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (d1 <= 0.0f && d2 <= 0.0f)
    q = a;
  else if (d3 >= 0.0f && d4 <= d3)
    q = b;
  else if (vc <= 0.0f && d1 >= 0.0f && d3 <= 0.0f)
    q = a + ab * (d1 / (d1 - d3));
  else if (d6 >= 0.0f && d5 <= d6)
    q = c;
  else if (vb <= 0.0f && d2 >= 0.0f && d6 <= 0.0f)
    q = a + ac * (d2 / (d2 - d6));
  else if (va <= 0.0f && d4 >= d3 && d5 >= d6)
    q = b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  else
    q = a + (ab * vb + ac * vc) / (va + vb + vc);
  return dot(p - q, p - q);
}

static inline float disc_distance2(float3 p, float3 center, float radius, float3 normal) {
  const float3 d = p - center;
  const float high = dot(d, normal);
  const float beside = max(0.0f, length(d - normal * high) - radius);
  return high * high + beside * beside;
}

// Counts (`write` 0), or writes from firsts[i] on, in the tree's order. first_primitives[leaf]: the first
// of its primitives, or 0xffffffff. radius: 0, or the distance up to which a leaf is named without
// covering the point.
__kernel void point_query_find(__global const RbvhNode* nodes, __global const RbvhLeaf* leaves,
                               __global const ushort* heights, uint atlas_width,
                               __global const uint* first_primitives,
                               __global const RbvhPrimitive* primitives, uint discs,
                               __global const float* points, uint count, float radius, uint write,
                               __global uint* counts, __global const uint* firsts,
                               __global PointHit* hits BOUNDS_ARGUMENT) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const float3 p = vload3(i, points);
  uint found = 0;
  int stack[STACK];
  int top = 0;
  if (isfinite(p.x + p.y + p.z)) stack[top++] = 0;
  while (top > 0) {
    __global const RbvhNode* node = nodes + stack[--top];
    if (!(box_distance2(node, p) <= radius * radius)) continue;
    if (node->count == 0u) {
      stack[top++] = (int)node->first + 1;
      stack[top++] = (int)node->first;
      continue;
    }
    __global const RbvhLeaf* leaf = leaves + node->first;
    PointHit hit;
    hit.leaf = node->first;
    hit.u = dot(row(leaf, 0), p) + leaf->to_tile[3];
    hit.v = dot(row(leaf, 1), p) + leaf->to_tile[7];
    hit.distance = 0.0f;
    hit.covers = 0;
    const uint first = first_primitives[node->first];
    const int width = leaf->width, height = leaf->height;
    if (first != 0xffffffffu) {
      // Its surface is its primitives, whatever its texels show of them.
      float least = INFINITY;
      for (uint k = 0; k < leaf->primitives; ++k) {
        if (!IN_BOUNDS(bounds, PRIMITIVES, first + k, 1)) return;
        __global const float* s = primitives[first + k].shape;
        const float away = discs ? disc_distance2(p, vload3(0, s), s[3], vload3(0, s + 4))
                                 : triangle_distance2(p, vload3(0, s), vload3(1, s), vload3(2, s));
        if (away < least) least = away;  // of a triangle without an area it is NaN
      }
      hit.distance = sqrt(least);
      hit.covers = 1;
    } else if (hit.u >= 0.0f && hit.v >= 0.0f && hit.u <= (float)(width - 1) &&
               hit.v <= (float)(height - 1)) {
      const int x = min((int)hit.u, width - 2), y = min((int)hit.v, height - 2);
      const float fu = hit.u - (float)x, fv = hit.v - (float)y;
      const uint at = (leaf->y + (uint)y) * atlas_width + leaf->x + (uint)x;
      if (!IN_BOUNDS(bounds, HEIGHTS, at, atlas_width + 2)) return;
      const float4 h =
          (float4)(heights[at], heights[at + 1], heights[at + atlas_width], heights[at + atlas_width + 1]);
      // Texels without a surface count nothing; a point right over one still has its neighbours.
      const float4 share =
          (float4)((1.0f - fu) * (1.0f - fv), fu * (1.0f - fv), (1.0f - fu) * fv, fu * fv) + 1e-6f;
      const float4 weight = select((float4)(0.0f), share, h > 0.0f);
      const float sum = weight.x + weight.y + weight.z + weight.w;
      if (sum > 0.0f) {
        hit.covers = 1;
        const float w = dot(row(leaf, 2), p) + leaf->to_tile[11];
        hit.distance = (dot(weight, h) / sum - w) / length(row(leaf, 2));
      }
    }
    if (radius == 0.0f && !hit.covers) continue;
    if (write) hits[firsts[i] + found] = hit;
    ++found;
  }
  if (!write) counts[i] = found;
}
