// A binary hierarchy over a level's tiles and primitives, by the surface area heuristic in 16 bins (Wald,
// "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007). A node is the boxes of its two
// children, as NodePair of kernels/bvh/bvh_layout.h, with a link up for the stackless traversals:
//   lo0 child0 | hi0 up | lo1 child1 | hi1 -        16 words
// child: a node; with bit 31 a leaf: with bit 30 a tile, else the first primitive and, from bit 27 on, how
// many less one. up: the parent's number times 8, 4 for its second child, and the axis that is ordered by.

const LEAF = 0x80000000, TILE = 0x40000000, COUNT_SHIFT = 27, NODE_WORDS = 16;
const BINS = 16, MOST_IN_LEAF = 8, MOST_DEPTH = 30, NODE_COST = 1.2;

export interface Tree {
  nodes: Uint32Array;
  order: Uint32Array; // the elements, leaf by leaf
  depth: number;
}

const halfArea = (b: Float32Array, at: number): number => {
  const x = b[at + 3]! - b[at]!, y = b[at + 4]! - b[at + 1]!, z = b[at + 5]! - b[at + 2]!;
  return x < 0 ? 0 : x * y + y * z + z * x;
};

function empty(b: Float32Array): void {
  for (let i = 0; i < b.length; i += 6) {
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

/** Elements order[begin] to order[end - 1], which become a node or a leaf. */
interface Range {
  begin: number;
  end: number;
  up: number;
  depth: number;
  box: Float32Array;
}

class Builder {
  readonly order: Uint32Array;
  readonly centers: Float32Array;
  axis = 0; // of the last split
  private readonly bins = new Float32Array(6 * BINS);
  private readonly counts = new Uint32Array(BINS);
  private readonly left = new Float64Array(BINS);
  private readonly box = new Float32Array(6);

  constructor(readonly boxes: Float32Array, readonly tiles: number) {
    const count = boxes.length / 6;
    this.order = new Uint32Array(count);
    this.centers = new Float32Array(3 * count);
    for (let i = 0; i < count; ++i) {
      this.order[i] = i;
      for (let a = 0; a < 3; ++a) this.centers[3 * i + a] = (boxes[6 * i + a]! + boxes[6 * i + 3 + a]!) / 2;
    }
  }

  bounds(begin: number, end: number): Float32Array {
    const box = new Float32Array(6);
    empty(box);
    for (let i = begin; i < end; ++i) grow(box, 0, this.boxes, 6 * this.order[i]!);
    return box;
  }

  /** The axis along which the centres lie furthest apart, and where they begin and end there. */
  private spread(begin: number, end: number): [number, number, number] {
    const { order, centers } = this;
    let x0 = Infinity, y0 = Infinity, z0 = Infinity, x1 = -Infinity, y1 = -Infinity, z1 = -Infinity;
    for (let i = begin; i < end; ++i) {
      const at = 3 * order[i]!, x = centers[at]!, y = centers[at + 1]!, z = centers[at + 2]!;
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

  /** Where the range is split; its beginning: it is a leaf. */
  split(range: Range): number {
    const { order, centers, boxes, bins, counts, left, box } = this, { begin, end } = range, n = end - begin;
    let canBeLeaf = n <= MOST_IN_LEAF;
    for (let i = begin; i < end && canBeLeaf; ++i) canBeLeaf = order[i]! >= this.tiles || n === 1;
    if (canBeLeaf && n <= 2) return begin;
    const [axis, lo, hi] = this.spread(begin, end);
    this.axis = axis;
    // Where depth runs out, at the median.
    if (!(hi > lo) || range.depth + Math.ceil(Math.log2(n)) + 1 >= MOST_DEPTH) {
      if (canBeLeaf) return begin;
      order.subarray(begin, end).sort((a, b) => centers[3 * a + axis]! - centers[3 * b + axis]! || a - b);
      return begin + (n >> 1);
    }
    const scale = (BINS * 0.9999) / (hi - lo);
    empty(bins);
    counts.fill(0);
    for (let i = begin; i < end; ++i) {
      const e = order[i]!, bin = ((centers[3 * e + axis]! - lo) * scale) | 0;
      ++counts[bin]!;
      grow(bins, 6 * bin, boxes, 6 * e);
    }
    empty(box);
    for (let b = 0, sum = 0; b < BINS - 1; ++b) {
      grow(box, 0, bins, 6 * b);
      sum += counts[b]!;
      left[b] = sum * halfArea(box, 0);
    }
    empty(box);
    let best = 1, bestCost = Infinity;
    for (let b = BINS - 1, sum = 0; b > 0; --b) {
      grow(box, 0, bins, 6 * b);
      sum += counts[b]!;
      const cost = left[b - 1]! + sum * halfArea(box, 0);
      if (sum > 0 && sum < n && cost < bestCost) {
        bestCost = cost;
        best = b;
      }
    }
    if (canBeLeaf) {
      const area = halfArea(range.box, 0);
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

  link(begin: number, end: number): number {
    const first = this.order[begin]!;
    return first < this.tiles ? LEAF + TILE + first : LEAF + (((end - begin - 1) << COUNT_SHIFT) >>> 0) + begin;
  }
}

/** `boxes`: lo and hi, six an element. The first `tiles` elements are leaves of their own. */
export function buildTree(boxes: Float32Array, tiles: number): Tree {
  const builder = new Builder(boxes, tiles), count = boxes.length / 6;
  const nodes = new Uint32Array(Math.max(1, count) * NODE_WORDS), floats = new Float32Array(nodes.buffer);
  const put = (node: number, side: number, box: Float32Array, link: number): void => {
    const at = node * NODE_WORDS + 8 * side;
    for (let a = 0; a < 3; ++a) {
      floats[at + a] = box[a]!;
      floats[at + 4 + a] = box[a + 3]!;
    }
    nodes[at + 3] = link;
  };
  const all: Range = { begin: 0, end: count, up: 0, depth: 0, box: builder.bounds(0, count) };
  const stack: [Range, number, number][] = []; // a range, where it is split, its node
  const middle = builder.split(all);
  if (middle === 0) { // a leaf: beside it, a box far away
    put(0, 0, all.box, builder.link(0, count));
    put(0, 1, new Float32Array(6).fill(1e38), builder.link(0, count));
    return { nodes: nodes.subarray(0, NODE_WORDS), order: builder.order, depth: 1 };
  }
  nodes[7] = builder.axis;
  stack.push([all, middle, 0]);
  let used = 1, depth = 1;
  for (let top; (top = stack.pop());) {
    const [range, at, node] = top;
    for (let side = 0; side < 2; ++side) {
      const begin = side === 0 ? range.begin : at, end = side === 0 ? at : range.end;
      const child: Range = { begin, end, up: node * 8 + 4 * side, depth: range.depth + 1,
                             box: builder.bounds(begin, end) };
      const split = builder.split(child);
      if (split === begin) {
        put(node, side, child.box, builder.link(begin, end));
        continue;
      }
      put(node, side, child.box, used);
      nodes[used * NODE_WORDS + 7] = child.up | builder.axis;
      depth = Math.max(depth, child.depth + 1);
      stack.push([child, split, used++]);
    }
  }
  return { nodes: nodes.subarray(0, used * NODE_WORDS), order: builder.order, depth };
}
