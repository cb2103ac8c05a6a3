// One round of parallel locally-ordered clustering (pipeline/bvh/ploc.h): every cluster finds the neighbour
// on the Morton curve with which it would make the smallest box, pairs that found each other are merged, and
// the rest close ranks. A round is several launches, so that no work-item needs what another wrote in the
// same one.
//
// A cluster: its box, its link in s3 (an element with LINKED_LEAF_BIT, or a node), its number of elements in
// s7.
#pragma OPENCL FP_CONTRACT OFF
#include "kernels/bvh/boxes.h"
#include "kernels/bvh/linked_layout.h"

__kernel void ploc_leaves(__global const float* boxes, __global const uint* indices, uint count,
                          __global float8* clusters) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  float8 cluster = load_box(boxes, indices[i]);
  cluster.s3 = as_float(LINKED_LEAF_BIT | indices[i]);
  cluster.s7 = as_float(1u);
  clusters[i] = cluster;
}

// nearest[i]: the place, at most `radius` away, of the cluster with which i makes the box of the least area.
// Of equal ones that with the least i ^ j: so there always is a pair that found each other, and where all are
// equal, neighbours pair up. `forced`: they do so whatever their boxes are.
__kernel void ploc_nearest(__global const float8* clusters, uint count, uint radius, uint forced,
                           __global uint* nearest) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  if (forced) {
    nearest[i] = (i ^ 1) < count ? i ^ 1 : i;
    return;
  }
  const float8 own = clusters[i];
  const uint begin = i - min(i, radius), end = min(count, i + radius + 1);
  float least = INFINITY;
  uint best = i;
  for (uint j = begin; j < end; ++j) {
    const float area = box_half_area(box_union(own, clusters[j]));
    const bool better = area < least || (area == least && (i ^ j) < (i ^ best)) || best == i;
    if (j != i && better) {
      least = area;
      best = j;
    }
  }
  nearest[i] = best;
}

// merged[i]: i is the lower of a pair; kept[i]: it is not the upper.
__kernel void ploc_pairs(__global const uint* nearest, uint count, __global uint* merged,
                         __global uint* kept) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  const uint j = nearest[i];
  const bool paired = j != i && nearest[j] == i;
  merged[i] = paired && i < j ? 1 : 0;
  kept[i] = paired && i > j ? 0 : 1;
}

// `merged` and `kept` are their prefix sums now, with their totals behind them. Nodes go from `first_node`
// on.
__kernel void ploc_merge(__global const float8* clusters, __global const uint* nearest, uint count,
                         __global const uint* merged, __global const uint* kept, uint first_node,
                         __global LinkedNode* nodes, __global float8* clusters_out) {
  const uint i = (uint)get_global_id(0);
  if (i >= count || kept[i + 1] == kept[i]) return;
  float8 cluster = clusters[i];
  if (merged[i + 1] != merged[i]) {
    const float8 other = clusters[nearest[i]];
    const uint n = first_node + merged[i], elements = as_uint(cluster.s7) + as_uint(other.s7);
    const float8 box = box_union(cluster, other);
    __global LinkedNode* node = nodes + n;
    vstore3(box.s012, 0, node->lo);
    vstore3(box.s456, 0, node->hi);
    node->left = as_uint(cluster.s3);
    node->right = as_uint(other.s3);
    node->count = elements;
    cluster = box;
    cluster.s3 = as_float(n);
    cluster.s7 = as_float(elements);
  }
  clusters_out[kept[i]] = cluster;
}
