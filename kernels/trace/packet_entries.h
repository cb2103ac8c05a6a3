// The kernel that casts 16 rays of a camera a work-item. Beside what entries.h and group_entries.h ask for,
// the file that includes this has defined
//   uint2 traverse_packet(tree, packet, any, found),
//   bool takes_packet(packet)                   false where its rays are to be cast one by one.
#include "kernels/bvh/packet.h"
#include "kernels/common/no_hit.h"

// A square of 4 x 4 pixels a work-item; `squares` of them in a row.
__kernel void trace_camera_packets(TREE_ARGUMENTS, CameraRays camera, uint squares, __global Hit* hits,
                                   __global uint* steps BOUNDS_ARGUMENT) {
  const uint left = (uint)get_global_id(0) % squares * 4, top = (uint)get_global_id(0) / squares * 4;
  if (top >= camera.height) return;
  const Tree tree = TREE;
  Packet packet;
  const bool can_hit = prepare_packet(&camera, left, top, &scene, &packet) && enters_scene(&packet, &scene);
  const bool together = !can_hit || takes_packet(&packet);
  uint2 visited = (uint2)(0u);
  FoundLanes found;
  HitLanes lanes;
  float d[3][16];
  uint hit = 0;  // rays of the packet that hit, as bits
  if (can_hit && together) {
    Found16 nearest;
    find_nothing(&nearest);
    visited = traverse_packet(&tree, &packet, 0, &nearest);
    hit = lane_bits16(nearest.id != RBVH_NO_LEAF);
    if (hit != 0) {
      store_lanes(&nearest, &found);
      make_lanes(&tree, &found, packet.d, &lanes);
      for (uint axis = 0; axis < 3; ++axis) vstore16(packet.d[axis], 0, d[axis]);
    }
  }
  for (uint i = 0; i < 16; ++i) {
    const uint x = left + i % 4, y = top + i / 4;
    if (x >= camera.width || y >= camera.height) continue;
    const size_t at = (size_t)y * camera.width + x;
    if (!together) {
      const Ray ray = camera_ray(&camera, x, y);
      Found alone;
      visited = trace(&tree, &ray, 0, &alone);
      hits[at] = make_hit(&tree, &alone, &ray);
    } else if (hit >> i & 1) {
      const Ray ray = {{packet.origin[0], packet.origin[1], packet.origin[2]},
                       0.0f,
                       {d[0][i], d[1][i], d[2][i]},
                       INFINITY};
      hits[at] = lane_hit(&tree, &found, &lanes, i, &ray);
    } else {
      hits[at] = no_hit();
    }
    if (steps) steps[at] = visited.x + visited.y;
  }
}
