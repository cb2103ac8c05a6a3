// A camera's rays in memory, row by row, bitwise equal to those that other kernels make on the way.
#pragma OPENCL FP_CONTRACT OFF
#include "kernels/common/camera_rays.h"

__kernel void write_camera_rays(CameraRays camera, __global Ray* rays) {
  const uint2 pixel = camera_pixel(camera.width, (uint)get_global_id(0));
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  rays[pixel.y * camera.width + pixel.x] = camera_ray(&camera, pixel.x, pixel.y);
}
