// Sixteen rays from one point, as of a camera: prepared, and the nearest hit of each.
#ifndef RBVH_PACKET_H
#define RBVH_PACKET_H
#include "kernels/bvh/wide_node.h"
#include "kernels/common/camera_rays.h"

#define ALL_LANES 0xffffu

// Their nearest hits so far, as Found.
typedef struct Found16 {
  float16 t, u, v;
  uint16 id, at;
} Found16;

// The same, to be read by lane.
typedef struct FoundLanes {
  float t[16], u[16], v[16];
  uint id[16], at[16];
} FoundLanes;

static ALWAYS_INLINE void store_lanes(const Found16* found, FoundLanes* lanes) {
  vstore16(found->t, 0, lanes->t);
  vstore16(found->u, 0, lanes->u);
  vstore16(found->v, 0, lanes->v);
  vstore16(found->id, 0, lanes->id);
  vstore16(found->at, 0, lanes->at);
}

static ALWAYS_INLINE void take_lanes(int16 taken, float16 t, float16 u, float16 v, uint id, uint at,
                                     Found16* found) {
  found->t = select(found->t, t, taken);
  found->u = select(found->u, u, taken);
  found->v = select(found->v, v, taken);
  found->id = select(found->id, (uint16)(id), taken);
  found->at = select(found->at, (uint16)(at), taken);
}

static inline void find_nothing(Found16* found) {
  found->t = FLT_MAX;
  found->u = found->v = 0.0f;
  found->id = RBVH_NO_LEAF;
  found->at = 0;
}

// The farthest of them.
static inline float limit_of_packet(const Found16* found) { return greatest(found->t); }

// is_nearer() by lane.
static ALWAYS_INLINE int16 is_nearer_packet(float16 t, uint id, const Found16* found) {
  return (t < found->t) | ((t == found->t) & ((uint16)(id) < found->id));
}

// The axis along which triangles are sheared, and by how much, as in Query.
typedef struct PacketShear {
  uint kx, ky, kz;
  float16 sx, sy, sz;
} PacketShear;

// Where the rays are at distance 1 along kz, widened by what floats round.
typedef struct PacketWindow {
  float side;  // -1 or 1: their way along kz; 0: both ways
  float lo[2], hi[2];
} PacketWindow;

typedef struct Packet {
  PacketBounds bounds;
  float origin[3];
  float16 d[3];
  PacketShear shear;    // see shear_packet()
  PacketWindow window;  // see packet_window()
} Packet;

// Along an axis in which no ray is slow.
static ALWAYS_INLINE PacketShear shear_packet(const float16* d) {
  const float x = least(fabs(d[0])), y = least(fabs(d[1])), z = least(fabs(d[2]));
  PacketShear s;
  s.kz = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
  s.kx = (s.kz + 1) % 3;
  s.ky = (s.kz + 2) % 3;
  s.sx = d[s.kx] / d[s.kz];
  s.sy = d[s.ky] / d[s.kz];
  s.sz = 1.0f / d[s.kz];
  return s;
}

static ALWAYS_INLINE PacketWindow packet_window(const float16* d, const PacketShear* s) {
  PacketWindow w;
  w.side = least(d[s->kz]) > 0.0f ? 1.0f : greatest(d[s->kz]) < 0.0f ? -1.0f : 0.0f;
  const float4 edges = (float4)(least(s->sx), least(s->sy), greatest(s->sx), greatest(s->sy));
  const float4 margin = 2e-6f * (1.0f + fabs(edges));
  w.lo[0] = edges.x - margin.x;
  w.lo[1] = edges.y - margin.y;
  w.hi[0] = edges.z + margin.z;
  w.hi[1] = edges.w + margin.w;
  return w;
}

// Whether kz is every ray's own longest axis, as in prepare(): then every ray hits triangles as it does
// alone.
static ALWAYS_INLINE bool is_shear_of_each(const float16* d, uint kz) {
  const float16 x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]);
  return lane_bits16(kz == 0   ? (x >= y) & (x >= z)
                     : kz == 1 ? (y > x) & (y >= z)
                               : (z > x) & (z > y)) == ALL_LANES;
}

static ALWAYS_INLINE uint open_packet(__global const WideNode* node, const Packet* p, float limit,
                                      uint* stack, float* stack_t, uint* depth) {
  return open_node_packet(node, &p->bounds, limit, stack, stack_t, depth);
}

// camera_ray()'s directions of a square of 4 x 4 pixels.
static inline void square_directions(const CameraRays* camera, uint left, uint top, float16* d) {
  const float16 column = (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 row = (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  const float16 sx = ((float16)((float)left) + column) + camera->offset_x;
  const float16 sy = ((float16)((float)top) + row) + camera->offset_y;
  for (int i = 0; i < 3; ++i) d[i] = camera->corner[i] + camera->right[i] * sx + camera->up[i] * sy;
  const float16 scale = 1.0f / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (int i = 0; i < 3; ++i) d[i] = d[i] * scale;
}

static ALWAYS_INLINE void prepare_bounds(Packet* p, const BvhRoot* scene) {
  const float margin = error_bound(p->origin, scene);
  PacketBounds* b = &p->bounds;
  b->tmin = 0.0f;
#pragma unroll
  for (uint axis = 0; axis < 3; ++axis) {
    const float lo = least(p->d[axis]), hi = greatest(p->d[axis]);
    // Signs differ, or a ray is nearly parallel to the planes.
    const bool mixed = lo <= 1e-18f && hi >= -1e-18f, back = lo < 0.0f;
    b->inverse[axis][0] = mixed ? 0.0f : 1.0f / hi;
    b->inverse[axis][1] = mixed ? 0.0f : 1.0f / lo;
    b->near_row[axis] = back ? axis + 3 : axis;
    b->far_row[axis] = back ? axis : axis + 3;
    const float outwards = back ? -margin : margin;
    for (uint k = 0; k < 2; ++k) {
      b->near_offset[axis][k] = mixed ? -FLT_MAX : -(p->origin[axis] + outwards) * b->inverse[axis][k];
      b->far_offset[axis][k] = mixed ? FLT_MAX : -(p->origin[axis] - outwards) * b->inverse[axis][k];
    }
  }
}

// Whether any of the rays may enter the box of everything: most of a picture is often empty.
static ALWAYS_INLINE bool enters_scene(const Packet* p, const BvhRoot* scene) {
  const float planes[6] = {scene->lo[0], scene->lo[1], scene->lo[2],
                           scene->hi[0], scene->hi[1], scene->hi[2]};
  const PacketBounds* b = &p->bounds;
  float enter = b->tmin, leave = FLT_MAX;
#define LOAD(row) planes[row]
  PACKET_INTERVAL(float, LOAD, b, b->inverse, b->near_offset, b->far_offset, enter, leave)
#undef LOAD
  return enter <= leave;
}

// The rays of a square of 4 x 4 pixels. False where they can hit nothing.
static ALWAYS_INLINE bool prepare_packet(const CameraRays* camera, uint left, uint top, const BvhRoot* scene,
                                         Packet* p) {
  square_directions(camera, left, top, p->d);
  for (uint axis = 0; axis < 3; ++axis) p->origin[axis] = camera->position[axis];
  prepare_bounds(p, scene);
  return isfinite(p->origin[0] + p->origin[1] + p->origin[2]);
}
#endif
