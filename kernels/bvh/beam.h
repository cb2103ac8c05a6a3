// The rays of 8 x 8 pixels of a camera, which start from one point: they descend a hierarchy together. At its
// leaves they are four packets of 16, each 4 x 4 pixels.
#ifndef RBVH_BEAM_H
#define RBVH_BEAM_H
#include "kernels/bvh/found_lanes.h"
#include "kernels/bvh/wide_node.h"
#include "kernels/common/camera_rays.h"

#define BEAM_SIDE 8  // pixels
#define PACKET_SIDE 4
#define BEAM_PACKETS 4
#define ALL_LANES 0xffffu
#define ALL_PACKETS 0xfu

typedef struct Packet {
  float16 d[3];
  float16 sx, sy, sz;  // shear along the beam's kz, as in PreparedRay
} Packet;

typedef struct Beam {
  float origin[3];
  IntervalRay interval;
  uint kx, ky, kz;  // kz: an axis along which no ray is slow
  // A window is where rays are at distance 1 along kz, widened by what floats round: of each packet.
  float side;  // -1 or 1: the rays' way along kz; 0: both ways, along every axis: they are cast one by one
  float lo[2][BEAM_PACKETS], hi[2][BEAM_PACKETS];
  float slowest[BEAM_PACKETS];  // least t for a distance of 1 along kz
  Packet packets[BEAM_PACKETS];
} Beam;

// The nearest hits so far.
typedef struct BeamFound {
  Found16 of[BEAM_PACKETS];
  float limits[BEAM_PACKETS];  // the farthest of each packet
} BeamFound;

static inline void find_nothing(BeamFound* found) {
  for (uint p = 0; p < BEAM_PACKETS; ++p) {
    found->limits[p] = FLT_MAX;
    found->of[p].t = FLT_MAX;
    found->of[p].u = found->of[p].v = 0.0f;
    found->of[p].id = RBVH_NO_LEAF;
    found->of[p].at = 0;
  }
}

static inline float limit_of_beam(const BeamFound* found) {
  return max(max(found->limits[0], found->limits[1]), max(found->limits[2], found->limits[3]));
}

static ALWAYS_INLINE uint open_beam(__global const WideNode* node, const Beam* b, float limit, uint* stack,
                                    float* stack_t, uint* depth) {
  return open_node_packet(node, &b->interval, limit, stack, stack_t, depth);
}

// camera_ray()'s directions of a square of 4 x 4 pixels.
static ALWAYS_INLINE void square_directions(const CameraRays* camera, uint left, uint top, float16* d) {
  const float16 column = (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 row = (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  const float16 sx = ((float16)((float)left) + column) + camera->offset_x;
  const float16 sy = ((float16)((float)top) + row) + camera->offset_y;
  for (uint i = 0; i < 3; ++i) d[i] = camera->corner[i] + camera->right[i] * sx + camera->up[i] * sy;
  const float16 scale = 1.0f / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (uint i = 0; i < 3; ++i) d[i] = d[i] * scale;
}

// lo, hi: of the rays' directions.
static ALWAYS_INLINE void set_interval(Beam* beam, const float* lo, const float* hi, const BvhRoot* scene) {
  const float margin = error_bound(beam->origin, scene);
  IntervalRay* b = &beam->interval;
  b->tmin = 0.0f;
#pragma unroll
  for (uint axis = 0; axis < 3; ++axis) {
    // Signs differ, or a ray is nearly parallel to the planes.
    const bool mixed = lo[axis] <= 1e-18f && hi[axis] >= -1e-18f, back = lo[axis] < 0.0f;
    b->inverse[axis][0] = mixed ? 0.0f : 1.0f / hi[axis];
    b->inverse[axis][1] = mixed ? 0.0f : 1.0f / lo[axis];
    b->near_row[axis] = back ? axis + 3 : axis;
    b->far_row[axis] = back ? axis : axis + 3;
    const float outwards = back ? -margin : margin;
    for (uint k = 0; k < 2; ++k) {
      b->near_offset[axis][k] = mixed ? -FLT_MAX : -(beam->origin[axis] + outwards) * b->inverse[axis][k];
      b->far_offset[axis][k] = mixed ? FLT_MAX : -(beam->origin[axis] - outwards) * b->inverse[axis][k];
    }
  }
}

// Whether any of the rays may enter the box of everything: most of a picture is often empty.
static ALWAYS_INLINE bool enters_scene(const IntervalRay* b, const BvhRoot* scene) {
  const float planes[6] = {scene->lo[0], scene->lo[1], scene->lo[2],
                           scene->hi[0], scene->hi[1], scene->hi[2]};
  float enter = b->tmin, leave = FLT_MAX;
#define LOAD(row) planes[row]
  PACKET_INTERVAL(float, LOAD, b, b->inverse, b->near_offset, b->far_offset, enter, leave)
#undef LOAD
  return enter <= leave;
}

// The least and the greatest at each packet's corner pixels, which are the least and the greatest of all its
// pixels: where a ray meets a plane is a linear fraction of its pixel.
static ALWAYS_INLINE void set_window(Beam* b, uint axis, float16 at_corners) {
  const float4 c0 = at_corners.s048c, c1 = at_corners.s159d, c2 = at_corners.s26ae, c3 = at_corners.s37bf;
  const float4 lo = min(min(c0, c1), min(c2, c3)), hi = max(max(c0, c1), max(c2, c3));
  vstore4(lo - 4e-6f * (1.0f + fabs(lo)), 0, b->lo[axis]);
  vstore4(hi + 4e-6f * (1.0f + fabs(hi)), 0, b->hi[axis]);
}

static ALWAYS_INLINE void set_shear(Beam* b, const float* lo, const float* hi, const float* slow) {
  b->kz = slow[0] >= slow[1] && slow[0] >= slow[2] ? 0 : slow[1] >= slow[2] ? 1 : 2;
  b->kx = (b->kz + 1) % 3;
  b->ky = (b->kz + 2) % 3;
  b->side = lo[b->kz] > 0.0f ? 1.0f : hi[b->kz] < 0.0f ? -1.0f : 0.0f;
  for (uint i = 0; i < BEAM_PACKETS; ++i) {
    Packet* p = b->packets + i;
    p->sx = p->d[b->kx] / p->d[b->kz];
    p->sy = p->d[b->ky] / p->d[b->kz];
    p->sz = 1.0f / p->d[b->kz];
  }
#define CORNERS(s) \
  (float16)(b->packets[0].s.s03cf, b->packets[1].s.s03cf, b->packets[2].s.s03cf, b->packets[3].s.s03cf)
  set_window(b, 0, CORNERS(sx));
  set_window(b, 1, CORNERS(sy));
#undef CORNERS
  float4 squares = 1.0f;
  for (uint axis = 0; axis < 2; ++axis) {
    const float4 aside = max(0.0f, max(vload4(0, b->lo[axis]), -vload4(0, b->hi[axis])));
    squares += aside * aside;
  }
  vstore4(sqrt(squares) * (1.0f - 1e-6f), 0, b->slowest);
}

// The rays of a square of 8 x 8 pixels. False where they can hit nothing.
static ALWAYS_INLINE bool prepare_beam(const CameraRays* camera, uint left, uint top, const BvhRoot* scene,
                                       Beam* b) {
  for (uint p = 0; p < BEAM_PACKETS; ++p)
    square_directions(camera, left + p % 2 * PACKET_SIDE, top + p / 2 * PACKET_SIDE, b->packets[p].d);
  float lo[3], hi[3], slow[3];
  for (uint axis = 0; axis < 3; ++axis) {
    b->origin[axis] = camera->position[axis];
    const float16 d0 = b->packets[0].d[axis], d1 = b->packets[1].d[axis], d2 = b->packets[2].d[axis],
                  d3 = b->packets[3].d[axis];
    lo[axis] = least(min(min(d0, d1), min(d2, d3)));
    hi[axis] = greatest(max(max(d0, d1), max(d2, d3)));
    slow[axis] = lo[axis] > 0.0f ? lo[axis] : hi[axis] < 0.0f ? -hi[axis] : 0.0f;
  }
  set_interval(b, lo, hi, scene);
  if (!isfinite(b->origin[0] + b->origin[1] + b->origin[2]) || !enters_scene(&b->interval, scene))
    return false;
  set_shear(b, lo, hi, slow);
  return true;
}

// Whether kz is every ray's own longest axis, as in prepare(): then every ray hits triangles as it does
// alone.
static ALWAYS_INLINE bool is_shear_of_each(const Beam* b) {
  uint all = ALL_LANES;
  for (uint i = 0; i < BEAM_PACKETS; ++i) {
    const float16 *d = b->packets[i].d, x = fabs(d[0]), y = fabs(d[1]), z = fabs(d[2]);
    all &= lane_bits16(b->kz == 0   ? (x >= y) & (x >= z)
                       : b->kz == 1 ? (y > x) & (y >= z)
                                    : (z > x) & (z > y));
  }
  return all == ALL_LANES;
}

// Boxes around up to 16 things, as the rays see them: at distance 1 along kz.
typedef struct SeenBoxes {
  float16 lo[2], hi[2];
  float depth;  // where the first begins, along kz; not positive: they are not seen so
  uint used;    // as bits
} SeenBoxes;

// Where an interval across kz is seen that lies between two depths, of which n and f are the inverse.
#define SEE(x0, x1, n, f, seen_lo, seen_hi)                                \
  seen_lo = min(min((x0) * (n), (x0) * (f)), min((x1) * (n), (x1) * (f))); \
  seen_hi = max(max((x0) * (n), (x0) * (f)), max((x1) * (n), (x1) * (f)))

// Of boxes seen from the origin, `near` and `far` times b->side.
static ALWAYS_INLINE void see_boxes(const Beam* b, float16 x0, float16 x1, float16 y0, float16 y1,
                                    float16 near, float16 far, uint used, SeenBoxes* seen) {
  const float16 n = b->side / near, f = b->side / far;
  SEE(x0, x1, n, f, seen->lo[0], seen->hi[0]);
  SEE(y0, y1, n, f, seen->lo[1], seen->hi[1]);
  seen->depth = least(select((float16)(FLT_MAX), near, near == near));  // unused lanes may be NaN
  seen->used = used;
}

// Packets that have found nothing before all of the boxes, as bits.
static ALWAYS_INLINE uint packets_before(const Beam* b, const BeamFound* found, const SeenBoxes* seen) {
  return lane_bits4(seen->depth * vload4(0, b->slowest) <= vload4(0, found->limits));
}

// Boxes that a packet's window meets, as bits.
static ALWAYS_INLINE uint boxes_seen(const Beam* b, uint packet, const SeenBoxes* seen) {
  if (!(seen->depth > 0.0f)) return seen->used;
  return lane_bits16((seen->lo[0] <= b->hi[0][packet]) & (seen->hi[0] >= b->lo[0][packet]) &
                     (seen->lo[1] <= b->hi[1][packet]) & (seen->hi[1] >= b->lo[1][packet])) &
         seen->used;
}

// Packets that may enter a box before what they have found, as bits.
static ALWAYS_INLINE uint packets_into(const Beam* b, const BeamFound* found, __global const float* lo,
                                       __global const float* hi) {
  const float z0 = b->side * (lo[b->kz] - b->origin[b->kz]), z1 = b->side * (hi[b->kz] - b->origin[b->kz]);
  const float near = min(z0, z1);
  if (!(near > 0.0f)) return ALL_PACKETS;
  const float n = b->side / near, f = b->side / max(z0, z1);
  float u[2], v[2];
  SEE(lo[b->kx] - b->origin[b->kx], hi[b->kx] - b->origin[b->kx], n, f, u[0], u[1]);
  SEE(lo[b->ky] - b->origin[b->ky], hi[b->ky] - b->origin[b->ky], n, f, v[0], v[1]);
  return lane_bits4((u[0] <= vload4(0, b->hi[0])) & (u[1] >= vload4(0, b->lo[0])) &
                    (v[0] <= vload4(0, b->hi[1])) & (v[1] >= vload4(0, b->lo[1])) &
                    (near * vload4(0, b->slowest) <= vload4(0, found->limits)));
}

static ALWAYS_INLINE void take_packet(const Found16* nearest, uint packet, BeamFound* found) {
  found->of[packet] = *nearest;
  found->limits[packet] = greatest(nearest->t);
}

// Defines  bool NAME(of, beam, boxes, found): each packet against the things whose boxes it sees, one after
// the other.
//   uint TEST(of, lane, beam, packet, t, u, v, area): rays that hit it, as bits, at t; u / area and v / area
//   are where on it; uint ID(of, lane), uint AT(of, lane): as in Found.
#define DEFINE_INTERSECT_SEEN(NAME, OF, TEST, ID, AT)                                                     \
  static ALWAYS_INLINE bool NAME(const OF* of, const Beam* b, const SeenBoxes* boxes, BeamFound* found) { \
    bool any = false;                                                                                     \
    for (uint packets = packets_before(b, found, boxes); packets != 0; packets &= packets - 1) {          \
      const uint i = lowest_bit(packets);                                                                 \
      Found16 nearest = found->of[i];                                                                     \
      bool taken_any = false;                                                                             \
      for (uint mask = boxes_seen(b, i, boxes); mask != 0; mask &= mask - 1) {                            \
        const uint lane = lowest_bit(mask);                                                               \
        float16 t, u, v, area;                                                                            \
        const uint inside = TEST(of, lane, b, b->packets + i, &t, &u, &v, &area);                         \
        if (inside == 0) continue;                                                                        \
        const int16 taken =                                                                               \
            lanes_of_bits16(inside) & (t >= 0.0f) & is_nearer_packet(t, ID(of, lane), &nearest);          \
        if (lane_bits16(taken) == 0) continue;                                                            \
        take_lanes(taken, t, u / area, v / area, ID(of, lane), AT(of, lane), &nearest);                   \
        taken_any = true;                                                                                 \
      }                                                                                                   \
      if (taken_any) take_packet(&nearest, i, found);                                                     \
      any |= taken_any;                                                                                   \
    }                                                                                                     \
    return any;                                                                                           \
  }
#endif
