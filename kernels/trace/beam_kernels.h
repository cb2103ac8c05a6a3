// The kernels that cast a camera's rays, a square of pixels a work-item. Beside what ray_kernels.h and
// group_kernels.h ask for, the file that includes this has defined
//   uint2 traverse_beam(tree, from, beam, any, found),
//   bool takes_beam(beam)                       false where its rays are to be cast as groups.
#include "kernels/bvh/beam.h"
#include "kernels/common/no_hit.h"
#include "kernels/trace/hit_lanes.h"

// The packet's hits; without `found` its rays have met nothing.
static ALWAYS_INLINE void put_packet(const Tree* tree, const CameraRays* camera, uint left, uint top,
                                     const float* origin, const float16* direction, const Found16* found,
                                     __global Hit* hits) {
  const bool any = found && lane_bits16(found->id != RBVH_NO_LEAF) != 0;
  Hit made[16];
  if (any) {
    const float16 from[3] = {origin[0], origin[1], origin[2]};
    HitLanes lanes;
    make_hits16(tree, found, from, direction, &lanes);
    store_hits(&lanes, made);
  }
  for (uint i = 0; i < 16; ++i) {
    const uint x = left + i % PACKET_SIDE, y = top + i / PACKET_SIDE;
    if (x < camera->width && y < camera->height)
      hits[(size_t)y * camera->width + x] = any ? made[i] : no_hit();
  }
}

// The rays of 4 x 4 pixels, as a group.
static ALWAYS_INLINE void cast_square(const Tree* tree, const CameraRays* camera, uint left, uint top,
                                      __global Hit* hits, __global uint* steps) {
  RayLanes rays;
  square_directions(camera, left, top, rays.direction);
  for (uint axis = 0; axis < 3; ++axis) rays.origin[axis] = camera->position[axis];
  rays.tmin = 0.0f;
  rays.tmax = INFINITY;
  rays.used = ALL_LANES;
  Group group;
  cast_group(tree, &rays, 0, &group);
  put_packet(tree, camera, left, top, camera->position, rays.direction, &group.found, hits);
  const uint16 visited = group.nodes + group.leaves;
  for (uint i = 0; steps && i < PACKET; ++i) {
    const uint x = left + i % PACKET_SIDE, y = top + i / PACKET_SIDE;
    if (x < camera->width && y < camera->height)
      steps[(size_t)y * camera->width + x] = OF_RAY(const uint, visited, i);
  }
}

// Squares of 8 x 8 pixels, `squares` in a row. `steps`: of each ray what its square visited.
__kernel void trace_camera_beams(TREE_ARGUMENTS, CameraRays camera, uint squares, __global Hit* hits,
                                 __global uint* steps BOUNDS_ARGUMENT) {
  const uint left = (uint)get_global_id(0) % squares * BEAM_SIDE,
             top = (uint)get_global_id(0) / squares * BEAM_SIDE;
  if (top >= camera.height) return;
  const Tree tree = TREE;
  Beam beam;
  const bool can_hit = prepare_beam(&camera, left, top, &scene, &beam);
  if (can_hit && (beam.side == 0.0f || !takes_beam(&beam))) {
#pragma unroll 1
    for (uint p = 0; p < BEAM_PACKETS; ++p)
      cast_square(&tree, &camera, left + p % 2 * PACKET_SIDE, top + p / 2 * PACKET_SIDE, hits, steps);
    return;
  }
  uint2 visited = (uint2)(0u);
  BeamFound found;
  if (can_hit) {
    find_nothing(&found);
    visited = traverse_beam(&tree, scene.root, &beam, 0, &found);
  }
  for (uint p = 0; p < BEAM_PACKETS; ++p)
    put_packet(&tree, &camera, left + p % 2 * PACKET_SIDE, top + p / 2 * PACKET_SIDE, beam.origin,
               beam.packets[p].d, can_hit ? found.of + p : 0, hits);
  if (!steps) return;
  for (uint i = 0; i < BEAM_SIDE * BEAM_SIDE; ++i) {
    const uint x = left + i % BEAM_SIDE, y = top + i / BEAM_SIDE;
    if (x < camera.width && y < camera.height) steps[(size_t)y * camera.width + x] = visited.x + visited.y;
  }
}

// Squares of 4 x 4 pixels, `squares` in a row, as groups: where primitives are so small that the rays of a
// beam soon go apart.
__kernel void trace_camera_groups(TREE_ARGUMENTS, CameraRays camera, uint squares, __global Hit* hits,
                                  __global uint* steps BOUNDS_ARGUMENT) {
  const uint left = (uint)get_global_id(0) % squares * PACKET_SIDE,
             top = (uint)get_global_id(0) / squares * PACKET_SIDE;
  if (top >= camera.height) return;
  const Tree tree = TREE;
  cast_square(&tree, &camera, left, top, hits, steps);
}
