// The kernel that casts 16 rays of a camera a work-item. Beside what entries.h asks for, the file that
// includes this has defined
//   uint2 traverse_packet(tree, packet, any, found),
//   bool takes_packet(packet)                   false where its rays are to be cast one by one,
//   HitLanes, make_lanes(tree, found, packet, lanes), Hit lane_hit(tree, lanes, i): from what was found to
//   hits.
#include "kernels/bvh/packet.h"

// A square of 4 x 4 pixels a work-item; `squares` of them in a row.
__kernel void trace_camera_packets(TREE_ARGUMENTS, CameraRays camera, uint squares, __global Hit* hits,
                                   __global uint* steps BOUNDS_ARGUMENT) {
  const uint left = (uint)get_global_id(0) % squares * 4, top = (uint)get_global_id(0) / squares * 4;
  if (top >= camera.height) return;
  const Tree tree = TREE;
  Packet packet;
  const bool can_hit = prepare_packet(&camera, left, top, &scene, &packet);
  const bool together = takes_packet(&packet);
  uint2 visited = (uint2)(0u);
  HitLanes lanes;
  if (together) {
    Found16 found;
    find_nothing(&found);
    if (can_hit) visited = traverse_packet(&tree, &packet, 0, &found);
    make_lanes(&tree, &found, &packet, &lanes);
  }
  for (uint i = 0; i < 16; ++i) {
    const uint x = left + i % 4, y = top + i / 4;
    if (x >= camera.width || y >= camera.height) continue;
    const size_t at = (size_t)y * camera.width + x;
    if (together) {
      hits[at] = lane_hit(&tree, &lanes, i);
    } else {
      const Ray ray = camera_ray(&camera, x, y);
      Found found;
      visited = trace(&tree, &ray, 0, &found);
      hits[at] = make_hit(&tree, &found, &ray);
    }
    if (steps) steps[at] = visited.x + visited.y;
  }
}
