// What the device's tree builders (lbvh.cl, ploc.cl) leave behind; host and kernel share it like layout.h.
#ifndef RBVH_LINKED_LAYOUT_H
#define RBVH_LINKED_LAYOUT_H

#include "kernels/common/layout.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

#define LINKED_LEAF_BIT 0x80000000u  // a child with it is an element (a box's index), without it a node

// An inner node, in no particular order: the box of its elements, their number, its two children.
typedef struct LinkedNode {
  float lo[3];
  rbvh_u32 left;
  float hi[3];
  rbvh_u32 right;
  rbvh_u32 count;
} LinkedNode;
RBVH_LAYOUT_SIZE(LinkedNode, 36);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
