// Reports the device's own idea of kernels/common/layout.h and its like: size and field offsets of every
// struct, in the order of layout_fields.h (cmake/LayoutFields.cmake).
#include "kernels/bvh/bvh_layout.h"
#include "kernels/bvh/linked_layout.h"
#include "kernels/common/layout.h"
#include "kernels/common/patch_layout.h"
#include "kernels/common/ray_queue_layout.h"
#include "kernels/common/scene_layout.h"

#define SIZE(type) out[n++] = (uint)sizeof(type);
#define FIELD(type, field) out[n++] = (uint)(size_t)(&((__private type*)0)->field);

__kernel void layout_report(__global uint* out) {
  uint n = 0;
#include "layout_fields.h"
}
