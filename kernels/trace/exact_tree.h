// The tree that a traversal walks, of the including file's NODE and PRIMITIVE.
typedef struct Tree {
  __global const NODE* nodes;
  __global const PRIMITIVE* primitives;
  __global const uint* references;  // kd-trees: their leaves' primitives; others: null
  const BvhRoot* scene;
} Tree;
