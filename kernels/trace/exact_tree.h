// The tree of an exact traversal, of the including file's NODE and PRIMITIVE.
#include "kernels/common/bounds.h"

typedef struct Tree {
  __global const NODE* nodes;
  __global const PRIMITIVE* primitives;
  __global const uint* references;  // kd-trees: their leaves' primitives; others: null
  const BvhRoot* scene;
  BOUNDS_MEMBER
} Tree;

#define TREE_ARGUMENTS                                                                               \
  __global const NODE *nodes, __global const PRIMITIVE *primitives, __global const uint *references, \
      BvhRoot scene
#define TREE \
  { nodes, primitives, references, &scene BOUNDS_VALUE }
