// Linear bounding volume hierarchy (pipeline/bvh/lbvh.h). Topology: Karras, "Maximizing Parallelism in the
// Construction of BVHs, Octrees, and k-d Trees", HPG 2012: inner node i covers a range of the sorted elements
// that begins or ends at i; its other end and its split are found by binary search, all nodes at once.
//
// Boxes: a node that adds up its children's boxes must see what other work-items wrote, and OpenCL 1.2
// promises no order between them within a launch. So no node looks at another: a pyramid of boxes over runs
// of 2^k neighbours is made, one launch a level, and each node joins the at most 2 log2(n) of them that make
// up its range. That is two boxes an element, as in the tree itself, and most ranges are a few elements long.
//
// KEY: uint (30 bits) or ulong (63 bits).
#pragma OPENCL FP_CONTRACT OFF
#include "kernels/bvh/boxes.h"
#include "kernels/bvh/linked_layout.h"

// Level 0 of the pyramid: the boxes in their order.
__kernel void lbvh_leaves(__global const float* boxes, __global const uint* indices, uint count,
                          __global float8* pyramid) {
  const uint i = (uint)get_global_id(0);
  if (i < count) pyramid[i] = load_box(boxes, indices[i]);
}

// One level from the one below it, `from` and `to` boxes into the pyramid; a last box without a partner is
// never asked for.
__kernel void lbvh_pyramid(__global float8* pyramid, uint from, uint to, uint count) {
  const uint i = (uint)get_global_id(0);
  if (i < count) pyramid[to + i] = box_union(pyramid[from + 2 * i], pyramid[from + 2 * i + 1]);
}

// The union of elements first .. last.
static inline float8 range_box(__global const float8* pyramid, uint count, uint first, uint last) {
  float8 box = pyramid[first];
  uint lo = first, hi = last + 1;
  for (uint level = 0; lo < hi; level += count, count /= 2, lo /= 2, hi /= 2) {
    if (lo & 1) box = box_union(box, pyramid[level + lo++]);
    if (hi & 1) box = box_union(box, pyramid[level + --hi]);
  }
  return box;
}

// Length of the common prefix of elements i and j, in bits; equal codes are told apart by their place. -1
// beyond the ends.
static inline int common_prefix(__global const KEY* codes, int count, int i, int j) {
  if (j < 0 || j >= count) return -1;
  const KEY difference = codes[i] ^ codes[j];
  return difference != 0 ? (int)clz(difference) : 8 * (int)sizeof(KEY) + (int)clz((uint)(i ^ j));
}

// nodes[i] for i in [0, count - 1); node 0 is the root. `count` > 1.
__kernel void lbvh_nodes(__global const KEY* codes, __global const uint* indices, uint element_count,
                         __global const float8* pyramid, __global LinkedNode* nodes) {
  const int i = (int)get_global_id(0), count = (int)element_count;
  if (i >= count - 1) return;
  // Which way the range goes from i: towards the neighbour with which more is in common.
  const int direction =
      common_prefix(codes, count, i, i + 1) > common_prefix(codes, count, i, i - 1) ? 1 : -1;
  const int least = common_prefix(codes, count, i, i - direction);
  int reach = 2;
  while (common_prefix(codes, count, i, i + reach * direction) > least) reach *= 2;
  int length = 0;
  for (int step = reach / 2; step > 0; step /= 2) {
    if (common_prefix(codes, count, i, i + (length + step) * direction) > least) length += step;
  }
  const int first = min(i, i + length * direction), last = max(i, i + length * direction);
  // The last element that has more in common with the first one than the whole range has.
  const int common = common_prefix(codes, count, first, last);
  int split = first;
  for (int step = last - first; step > 1;) {
    step = (step + 1) / 2;
    if (split + step < last && common_prefix(codes, count, first, split + step) > common) split += step;
  }
  const float8 box = range_box(pyramid, element_count, (uint)first, (uint)last);
  __global LinkedNode* node = nodes + i;
  vstore3(box.s012, 0, node->lo);
  vstore3(box.s456, 0, node->hi);
  node->left = split == first ? LINKED_LEAF_BIT | indices[split] : (uint)split;
  node->right = split + 1 == last ? LINKED_LEAF_BIT | indices[split + 1] : (uint)split + 1;
  node->count = (uint)(last - first + 1);
}
