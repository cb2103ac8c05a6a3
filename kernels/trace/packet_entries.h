// The kernel that casts 16 rays of a camera a work-item. Beside what entries.h asks for, the file that
// includes this has defined
//   uint2 traverse_packet(tree, packet, any, found)
//   void make_hits(tree, found, packet, hits)   16 of them,
//   bool takes_packet(packet)                   false where its rays are to be cast one by one.
#include "kernels/bvh/packet.h"

// A square of 4 x 4 pixels a work-item; `squares` of them in a row.
__kernel void trace_camera_packets(TREE_ARGUMENTS, CameraRays camera, uint squares, __global Hit* hits,
                                   __global uint* steps BOUNDS_ARGUMENT) {
  const uint left = (uint)get_global_id(0) % squares * 4, top = (uint)get_global_id(0) / squares * 4;
  if (top >= camera.height) return;
  const Tree tree = TREE;
  Hit square[16];
  uint visited[16];
  Packet packet;
  if (prepare_packet(&camera, left, top, &scene, &packet) && takes_packet(&packet)) {
    Found16 found;
    find_nothing(&found);
    const uint2 all = traverse_packet(&tree, &packet, 0, &found);
    make_hits(&tree, &found, &packet, square);
    for (uint i = 0; i < 16; ++i) visited[i] = all.x + all.y;
  } else {
    for (uint i = 0; i < 16; ++i) {
      const Ray ray = camera_ray(&camera, left + i % 4, top + i / 4);
      Found found;
      const uint2 all = trace(&tree, &ray, 0, &found);
      square[i] = make_hit(&tree, &found, &ray);
      visited[i] = all.x + all.y;
    }
  }
  for (uint i = 0; i < 16; ++i) {
    const uint x = left + i % 4, y = top + i / 4;
    if (x >= camera.width || y >= camera.height) continue;
    const size_t at = (size_t)y * camera.width + x;
    hits[at] = square[i];
    if (steps) steps[at] = visited[i];
  }
}
