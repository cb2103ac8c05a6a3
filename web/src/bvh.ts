// A binary hierarchy over a level's tiles and primitives, by the surface area heuristic in 16 bins (Wald,
// "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007): first over the pair's leaves, then over the
// primitives of each, as these lie together already. A node is the boxes of its two
// children, as NodePair of kernels/bvh/bvh_layout.h, with a link up for the stackless traversals:
//   lo0 child0 | hi0 up | lo1 child1 | hi1 -        16 words
// child: a node; with bit 31 a leaf: with bit 30 a tile, else the first primitive and, from bit 27 on, how
// many less one. up: the parent's number times 8, 4 for its second child, and the axis that is ordered by.

const LEAF = 0x80000000, TILE = 0x40000000, COUNT_SHIFT = 27, NODE_WORDS = 16;
const BINS = 16, MOST_IN_LEAF = 8, MOST_DEPTH = 30, NODE_COST = 1.2;

export interface Tree {
  nodes: Uint32Array;
  order: Uint32Array; // the primitives
  depth: number;
}

const halfArea = (b: Float32Array, at: number): number => {
  const x = b[at + 3]! - b[at]!, y = b[at + 4]! - b[at + 1]!, z = b[at + 5]! - b[at + 2]!;
  return x < 0 ? 0 : x * y + y * z + z * x;
};

function empty(b: Float32Array, boxes: number): void {
  for (let i = 0; i < 6 * boxes; i += 6) {
    b[i] = b[i + 1] = b[i + 2] = Infinity;
    b[i + 3] = b[i + 4] = b[i + 5] = -Infinity;
  }
}

function grow(to: Float32Array, at: number, from: Float32Array, f: number): void {
  if (from[f]! < to[at]!) to[at] = from[f]!;
  if (from[f + 1]! < to[at + 1]!) to[at + 1] = from[f + 1]!;
  if (from[f + 2]! < to[at + 2]!) to[at + 2] = from[f + 2]!;
  if (from[f + 3]! > to[at + 3]!) to[at + 3] = from[f + 3]!;
  if (from[f + 4]! > to[at + 4]!) to[at + 4] = from[f + 4]!;
  if (from[f + 5]! > to[at + 5]!) to[at + 5] = from[f + 5]!;
}

const bins = new Float32Array(6 * BINS), counts = new Uint32Array(BINS), left = new Float64Array(BINS),
      side = new Float32Array(6);

/** Splits ranges of elements. `boxes`: lo and hi, six an element; `weights`: what each costs to visit. */
class Splitter {
  readonly order: Uint32Array;
  readonly box = new Float32Array(6); // of the range that was looked at last
  axis = 0; // that it was split along
  private readonly centers: Float32Array;

  constructor(private readonly boxes: Float32Array, private readonly weights: Uint32Array | null, private readonly mostInLeaf: number) {
    const count = boxes.length / 6;
    this.order = new Uint32Array(count);
    this.centers = new Float32Array(3 * count);
    for (let i = 0; i < count; ++i) {
      this.order[i] = i;
      for (let a = 0; a < 3; ++a) this.centers[3 * i + a] = (boxes[6 * i + a]! + boxes[6 * i + 3 + a]!) / 2;
    }
  }

  /** The axis along which the centres lie furthest apart, and where they begin and end there; the range's box. */
  private measure(begin: number, end: number): [number, number, number] {
    const { order, centers, boxes, box } = this;
    let x0 = Infinity, y0 = Infinity, z0 = Infinity, x1 = -Infinity, y1 = -Infinity, z1 = -Infinity;
    empty(box, 1);
    for (let i = begin; i < end; ++i) {
      const e = order[i]!, x = centers[3 * e]!, y = centers[3 * e + 1]!, z = centers[3 * e + 2]!;
      grow(box, 0, boxes, 6 * e);
      if (x < x0) x0 = x;
      if (x > x1) x1 = x;
      if (y < y0) y0 = y;
      if (y > y1) y1 = y;
      if (z < z0) z0 = z;
      if (z > z1) z1 = z;
    }
    const most = Math.max(x1 - x0, y1 - y0, z1 - z0);
    return most === x1 - x0 ? [0, x0, x1] : most === y1 - y0 ? [1, y0, y1] : [2, z0, z1];
  }

  /** Where elements order[begin] to order[end - 1] are split; `begin`: they are a leaf. */
  split(begin: number, end: number, depth: number): number {
    const { order, centers, boxes, weights } = this, n = end - begin, canBeLeaf = n <= this.mostInLeaf;
    const [axis, lo, hi] = this.measure(begin, end);
    if (canBeLeaf && n <= 2) return begin;
    this.axis = axis;
    // Where depth runs out, at the median.
    if (!(hi > lo) || depth + Math.ceil(Math.log2(n)) + 1 >= MOST_DEPTH) {
      if (canBeLeaf) return begin;
      order.subarray(begin, end).sort((a, b) => centers[3 * a + axis]! - centers[3 * b + axis]! || a - b);
      return begin + (n >> 1);
    }
    const used = Math.min(BINS, 2 * n), scale = (used * 0.9999) / (hi - lo);
    empty(bins, used);
    counts.fill(0);
    let total = 0;
    for (let i = begin; i < end; ++i) {
      const e = order[i]!, bin = ((centers[3 * e + axis]! - lo) * scale) | 0, weight = weights ? weights[e]! : 1;
      counts[bin]! += weight;
      total += weight;
      grow(bins, 6 * bin, boxes, 6 * e);
    }
    empty(side, 1);
    for (let b = 0, sum = 0; b < used - 1; ++b) {
      if (counts[b]! > 0) grow(side, 0, bins, 6 * b);
      sum += counts[b]!;
      left[b] = sum * halfArea(side, 0);
    }
    empty(side, 1);
    let best = 1, bestCost = Infinity;
    for (let b = used - 1, sum = 0; b > 0; --b) {
      if (counts[b] === 0) continue; // as good as the next
      grow(side, 0, bins, 6 * b);
      sum += counts[b]!;
      const cost = left[b - 1]! + sum * halfArea(side, 0);
      if (sum < total && cost < bestCost) {
        bestCost = cost;
        best = b;
      }
    }
    if (canBeLeaf) {
      const area = halfArea(this.box, 0);
      if (n * area <= bestCost + NODE_COST * area) return begin;
    }
    let i = begin, j = end - 1;
    while (i <= j) {
      const e = order[i]!;
      if ((((centers[3 * e + axis]! - lo) * scale) | 0) < best) {
        ++i;
      } else {
        order[i] = order[j]!;
        order[j--] = e;
      }
    }
    return i;
  }
}

/** Boxes are lo and hi, six an element. `held`: of each of the pair's leaves, how many primitives it holds; 0: a tile. */
export function buildTree(tiles: Float32Array, primitives: Float32Array, held: Uint32Array): Tree {
  const leaves = held.length, boxes = new Float32Array(6 * leaves), weights = new Uint32Array(leaves);
  const first = new Uint32Array(leaves); // a leaf's tile or its first primitive
  empty(boxes, leaves);
  for (let leaf = 0, t = 0, p = 0; leaf < leaves; ++leaf) {
    weights[leaf] = Math.max(1, held[leaf]!);
    first[leaf] = held[leaf] === 0 ? t : p;
    if (held[leaf] === 0) grow(boxes, 6 * leaf, tiles, 6 * t++);
    for (let i = 0; i < held[leaf]!; ++i) grow(boxes, 6 * leaf, primitives, 6 * p++);
  }
  const upper = new Splitter(boxes, weights, 1), lower = new Splitter(primitives, null, MOST_IN_LEAF);
  const nodes = new Uint32Array(Math.max(1, leaves + lower.order.length) * NODE_WORDS), floats = new Float32Array(nodes.buffer);
  // Begin, middle and end of ranges, whether of primitives, their nodes, their children's depth.
  const stack: number[] = [];
  let used = 0, deepest = 1;
  /** A child of a node: a range of leaves, or of primitives. */
  const add = (begin: number, end: number, of: number, node: number, second: number, depth: number): void => {
    if (!of && end - begin === 1 && held[upper.order[begin]!]! > 0) {
      const leaf = upper.order[begin]!;
      return add(first[leaf]!, first[leaf]! + held[leaf]!, 1, node, second, depth);
    }
    const by = of ? lower : upper, split = by.split(begin, end, depth), at = node * NODE_WORDS + 8 * second;
    const isLeaf = split === begin;
    if (node >= 0) {
      for (let a = 0; a < 3; ++a) {
        floats[at + a] = by.box[a]!;
        floats[at + 4 + a] = by.box[a + 3]!;
      }
      nodes[at + 3] = !isLeaf ? used : of ? LEAF + (((end - begin - 1) << COUNT_SHIFT) >>> 0) + begin
                              : LEAF + TILE + first[upper.order[begin]!]!;
    }
    if (isLeaf) return;
    if (node >= 0) nodes[used * NODE_WORDS + 7] = node * 8 + 4 * second;
    nodes[used * NODE_WORDS + 7]! |= by.axis;
    deepest = Math.max(deepest, depth + 1);
    stack.push(begin, split, end, of, used++, depth + 1);
  };
  add(0, leaves, 0, -1, 0, 0);
  if (used === 0) { // one leaf: beside it, a box far away
    add(0, leaves, 0, 0, 0, 1);
    used = 1;
    floats.fill(1e38, 8, 15);
    nodes[11] = nodes[3]!;
  }
  while (stack.length > 0) {
    const depth = stack.pop()!, node = stack.pop()!, of = stack.pop()!, end = stack.pop()!, middle = stack.pop()!, begin = stack.pop()!;
    add(begin, middle, of, node, 0, depth);
    add(middle, end, of, node, 1, depth);
  }
  return { nodes: nodes.subarray(0, used * NODE_WORDS), order: lower.order, depth: deepest };
}
