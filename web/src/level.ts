// From a level's block to what the shaders read: words in rows of textures (or in storage buffers).
//   nodes     as bvh.ts has them
//   vertices  x y z color | nx ny nz radius      8 words; color: sRGB bytes
//   prims     v0 v1 v2 leaf                      4 words; a disc has its vertex three times
//   tiles     24 words: to_tile by columns, box, width | height << 16, offset, step limit, top, leaf, -
//   heights, colors (565) 16 bits a texel; normals 2 x 16 bits, octahedral; tile by tile

import { Columns, crc32, decodeBase64, decodePositions, decodeTriangles, inflate, packNormal,
         unpackNormal } from "./codec";
import { buildTree } from "./bvh";
import type { LevelMeta } from "./page";

export const ROW = 4096; // texels of a texture's row
const STEP_LIMIT_TEXELS = 8;

export interface LayerData {
  leaves: Uint32Array; // 12 words: rows u and v of to_tile; offset, its size, the leaf's size, -
  values: Uint16Array; // channels interleaved
}

export interface LevelData {
  nodes: Uint32Array;
  vertices: Uint32Array;
  prims: Uint32Array;
  tiles: Uint32Array;
  heights: Uint16Array;
  normals: Uint32Array;
  colors: Uint16Array;
  layers: LayerData[];
  lo: number[];
  hi: number[];
  depth: number;
  seconds: number; // it took to decode
}

interface Tiles {
  frames: Float32Array; // to_tile, 12 a leaf
  sizes: Uint32Array; // width, height
  leaf: Uint32Array;
}

/** Differences to left, above and both, in rows of `widths`, undone. */
function unpredict(codes: Uint32Array, widths: ArrayLike<number>, heights: ArrayLike<number>,
                   channels: number): Uint16Array {
  const out = new Uint16Array(codes.length);
  let at = 0;
  for (let tile = 0; tile < widths.length; ++tile) {
    const row = widths[tile]! * channels;
    for (let y = 0; y < heights[tile]!; ++y)
      for (let x = 0; x < row; ++x, ++at) {
        const left = x >= channels ? out[at - channels]! : 0, above = y > 0 ? out[at - row]! : 0,
              both = x >= channels && y > 0 ? out[at - row - channels]! : 0;
        out[at] = codes[at]! + left + above - both;
      }
  }
  return out;
}

const padded = (words: number, perTexel: number): number => Math.ceil(words / (ROW * perTexel)) * ROW * perTexel;

function vertexNormals(positions: Float32Array, triangles: Uint32Array, codes: Uint32Array | null): Float32Array {
  const normals = new Float32Array(positions.length);
  for (let i = 0; i < triangles.length; i += 3) {
    const a = 3 * triangles[i]!, b = 3 * triangles[i + 1]!, c = 3 * triangles[i + 2]!;
    const ux = positions[b]! - positions[a]!, uy = positions[b + 1]! - positions[a + 1]!,
          uz = positions[b + 2]! - positions[a + 2]!, vx = positions[c]! - positions[a]!,
          vy = positions[c + 1]! - positions[a + 1]!, vz = positions[c + 2]! - positions[a + 2]!;
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (let k = 0; k < 3; ++k) { // no arrays here: they are a third of the time
      const at = 3 * triangles[i + k]!;
      normals[at]! += nx;
      normals[at + 1]! += ny;
      normals[at + 2]! += nz;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const x = normals[i]!, y = normals[i + 1]!, z = normals[i + 2]!, n = Math.sqrt(x * x + y * y + z * z) || 1;
    normals[i] = x / n;
    normals[i + 1] = y / n;
    normals[i + 2] = z / n;
    const code = codes ? codes[i / 3]! : 0;
    if (code) unpackNormal(code, normals, i);
  }
  return normals;
}

/** The normals of a tile's heights, as pipeline/rbvh/height_normals.cpp has them. */
function heightNormals(tiles: Tiles, offsets: Uint32Array, heights: Uint16Array, out: Uint32Array): void {
  for (let t = 0; t < offsets.length; ++t) {
    const width = tiles.sizes[2 * t]!, height = tiles.sizes[2 * t + 1]!, offset = offsets[t]!;
    const m = tiles.frames.subarray(12 * t, 12 * t + 12);
    const limit = STEP_LIMIT_TEXELS * Math.hypot(m[8]!, m[9]!, m[10]!) / Math.hypot(m[0]!, m[1]!, m[2]!);
    const slope = (x: number, y: number, dx: number, dy: number): number => {
      const here = heights[offset + y * width + x]!;
      let sum = 0, count = 0;
      for (let side = -1; side <= 1; side += 2) {
        const i = x + side * dx, j = y + side * dy;
        if (i < 0 || j < 0 || i >= width || j >= height) continue;
        const there = heights[offset + j * width + i]!, step = (there - here) * side;
        if (there === 0 || Math.abs(step) > limit) continue;
        sum += step;
        ++count;
      }
      return count > 0 ? sum / count : 0;
    };
    for (let y = 0; y < height; ++y)
      for (let x = 0; x < width; ++x) {
        const at = offset + y * width + x;
        if (heights[at] === 0) continue;
        const du = slope(x, y, 1, 0), dv = slope(x, y, 0, 1);
        out[at] = packNormal(m[8]! - m[0]! * du - m[4]! * dv, m[9]! - m[1]! * du - m[5]! * dv,
                             m[10]! - m[2]! * du - m[6]! * dv);
      }
  }
}

export async function openBlock(meta: LevelMeta, text: string): Promise<Map<string, Uint8Array>> {
  const bytes = await inflate(decodeBase64(text)).catch(() => new Uint8Array());
  if (bytes.length !== meta.bytes || crc32(bytes) !== meta.crc)
    throw new Error(`the data of level ${meta.name} are damaged`);
  const chunks = new Map<string, Uint8Array>();
  let at = 0;
  for (const [name, length] of Object.entries(meta.chunks)) {
    chunks.set(name, bytes.subarray(at, at + length));
    at += length;
  }
  return chunks;
}

/** `text`: base64. Throws where the data are damaged. */
export async function decodeLevel(meta: LevelMeta, text: string): Promise<LevelData> {
  const started = performance.now();
  const chunks = await openBlock(meta, text);
  const columns = (name: string): Columns => new Columns(chunks.get(name) ?? new Uint8Array());
  const holding = meta.leaves - meta.tiles;

  // Leaves: how many primitives each holds, 0 for a tile.
  const held = columns("held").take(meta.leaves, 1);
  const tileColumns = columns("tiles");
  const tiles: Tiles = { frames: new Float32Array(12 * meta.tiles), sizes: new Uint32Array(2 * meta.tiles),
                         leaf: new Uint32Array(meta.tiles) };
  const boxes: Float32Array[] = [];
  for (let k = 0; k < 2; ++k) {
    const size = tileColumns.take(meta.tiles, 2);
    for (let t = 0; t < meta.tiles; ++t) tiles.sizes[2 * t + k] = size[t]!;
  }
  for (let k = 0; k < 12; ++k) {
    const row = tileColumns.floats(meta.tiles);
    for (let t = 0; t < meta.tiles; ++t) tiles.frames[12 * t + k] = row[t]!;
  }
  for (let k = 0; k < 6; ++k) boxes.push(tileColumns.floats(meta.tiles));
  for (let leaf = 0, t = 0; leaf < meta.leaves; ++leaf) if (held[leaf] === 0) tiles.leaf[t++] = leaf;

  // Texels.
  const widths = tiles.sizes.filter((_, i) => i % 2 === 0), rows = tiles.sizes.filter((_, i) => i % 2 === 1);
  const offsets = new Uint32Array(meta.tiles);
  for (let t = 1; t < meta.tiles; ++t) offsets[t] = offsets[t - 1]! + widths[t - 1]! * rows[t - 1]!;
  const heightCodes = columns("heights").take(meta.texels, 2);
  const heights = new Uint16Array(padded(meta.texels, 1));
  heights.set(unpredict(heightCodes, widths, rows, 1));
  const normals = new Uint32Array(padded(meta.texels, 1));
  if (meta.normals) {
    const codes = columns("normals").take(meta.texels, 2), n = new Float32Array(3);
    for (let i = 0; i < meta.texels; ++i) {
      if (codes[i] === 0) continue;
      unpackNormal(codes[i]!, n, 0);
      normals[i] = packNormal(n[0]!, n[1]!, n[2]!);
    }
  } else {
    heightNormals(tiles, offsets, heights, normals);
  }
  const colors = new Uint16Array(meta.colors ? padded(meta.texels, 1) : ROW);
  if (meta.colors) colors.set(columns("texelColors").take(meta.texels, 2));

  // Primitives.
  const triangles = meta.triangles > 0 ? decodeTriangles(chunks.get("triangles")!, meta.triangles)
                                       : new Uint32Array();
  const places = columns("positions");
  let positions: Float32Array;
  if (meta.lattice.step > 0) {
    positions = decodePositions([places.take(meta.vertices, 4), places.take(meta.vertices, 4),
                                 places.take(meta.vertices, 4)], triangles, meta.vertices, meta.lattice);
  } else {
    positions = new Float32Array(3 * meta.vertices);
    for (let axis = 0; axis < 3; ++axis)
      places.floats(meta.vertices).forEach((p, v) => (positions[3 * v + axis] = p));
  }
  const vertexNormal = columns("vertexNormals");
  let smooth: Float32Array;
  if (meta.lattice.step > 0) {
    const codes = vertexNormal.take(meta.vertices, 2);
    if (meta.discs) {
      smooth = new Float32Array(3 * meta.vertices);
      for (let v = 0; v < meta.vertices; ++v) {
        smooth[3 * v + 2] = 1;
        if (codes[v]) unpackNormal(codes[v]!, smooth, 3 * v);
      }
    } else {
      smooth = vertexNormals(positions, triangles, codes);
    }
  } else {
    smooth = new Float32Array(3 * meta.vertices);
    for (let axis = 0; axis < 3; ++axis)
      vertexNormal.floats(meta.vertices).forEach((n, v) => (smooth[3 * v + axis] = n));
  }
  const radii = meta.discs ? columns("radii").floats(meta.vertices) : null;
  const channels = meta.colors ? columns("vertexColors") : null;
  const rgb = [0, 1, 2].map(() => channels?.take(meta.vertices, 1));
  const vertices = new Uint32Array(padded(8 * meta.vertices, 4)), vertexFloats = new Float32Array(vertices.buffer);
  for (let v = 0, r = 0, g = 0, b = 0; v < meta.vertices; ++v) {
    for (let k = 0; k < 3; ++k) {
      vertexFloats[8 * v + k] = positions[3 * v + k]!;
      vertexFloats[8 * v + 4 + k] = smooth[3 * v + k]!;
    }
    if (channels) {
      r = (r + rgb[0]![v]!) & 255;
      g = (g + rgb[1]![v]!) & 255;
      b = (b + rgb[2]![v]!) & 255;
      vertices[8 * v + 3] = r | (g << 8) | (b << 16);
    }
    if (radii) vertexFloats[8 * v + 7] = radii[v]!;
  }

  // The hierarchy over tiles and primitives.
  const primitives = meta.discs ? meta.vertices : meta.triangles;
  const tileBoxes = new Float32Array(6 * meta.tiles), primitiveBoxes = new Float32Array(6 * primitives);
  for (let k = 0; k < 6; ++k) for (let t = 0; t < meta.tiles; ++t) tileBoxes[6 * t + k] = boxes[k]![t]!;
  for (let p = 0; p < primitives; ++p)
    for (let k = 0; k < 3; ++k) {
      const at = 6 * p + k;
      if (radii) {
        primitiveBoxes[at] = positions[3 * p + k]! - radii[p]!;
        primitiveBoxes[at + 3] = positions[3 * p + k]! + radii[p]!;
        continue;
      }
      const a = positions[3 * triangles[3 * p]! + k]!, b = positions[3 * triangles[3 * p + 1]! + k]!,
            c = positions[3 * triangles[3 * p + 2]! + k]!;
      primitiveBoxes[at] = Math.min(a, b, c);
      primitiveBoxes[at + 3] = Math.max(a, b, c);
    }
  const tree = buildTree(tileBoxes, primitiveBoxes, held);
  const leafOf = new Uint32Array(primitives);
  for (let leaf = 0, p = 0; leaf < meta.leaves; ++leaf)
    for (let i = 0; i < held[leaf]!; ++i) leafOf[p++] = leaf;
  const prims = new Uint32Array(padded(4 * primitives, 4));
  for (let i = 0; i < primitives; ++i) {
    const p = tree.order[i]!;
    for (let k = 0; k < 3; ++k) prims[4 * i + k] = meta.discs ? p : triangles[3 * p + k]!;
    prims[4 * i + 3] = leafOf[p]!;
  }
  const nodes = new Uint32Array(padded(tree.nodes.length, 4));
  nodes.set(tree.nodes);

  const tileWords = new Uint32Array(padded(24 * Math.max(1, meta.tiles), 4)),
        tileFloats = new Float32Array(tileWords.buffer);
  for (let t = 0; t < meta.tiles; ++t) {
    const m = tiles.frames.subarray(12 * t, 12 * t + 12);
    for (let row = 0; row < 3; ++row)
      for (let column = 0; column < 4; ++column) tileFloats[24 * t + 3 * column + row] = m[4 * row + column]!;
    for (let k = 0; k < 6; ++k) tileFloats[24 * t + 12 + k] = boxes[k]![t]!;
    let top = 0;
    const texels = widths[t]! * rows[t]!;
    for (let i = 0; i < texels; ++i) top = Math.max(top, heights[offsets[t]! + i]!);
    tileWords[24 * t + 18] = widths[t]! | (rows[t]! << 16);
    tileWords[24 * t + 19] = offsets[t]!;
    tileFloats[24 * t + 20] =
      STEP_LIMIT_TEXELS * Math.hypot(m[8]!, m[9]!, m[10]!) / Math.hypot(m[0]!, m[1]!, m[2]!);
    tileFloats[24 * t + 21] = top;
    tileWords[24 * t + 22] = tiles.leaf[t]!;
  }

  const layers = meta.layers.map((layer, i) => decodeLayer(meta, layer.channels, columns(`layer${i}`),
                                                           columns("frames"), held, tiles, holding));
  return { nodes, vertices, prims, tiles: tileWords, heights, normals, colors, layers,
           lo: meta.bounds.lo, hi: meta.bounds.hi, depth: tree.depth,
           seconds: (performance.now() - started) / 1000 };
}

/** `frames`: of the leaves that hold primitives; their sizes, then rows u and v of to_tile. */
function decodeLayer(meta: LevelMeta, channels: number, columns: Columns, frames: Columns, held: Uint32Array,
                     tiles: Tiles, holding: number): LayerData {
  const own = [0, 1].map(() => columns.take(meta.leaves, 2));
  const heldSizes = [0, 1].map(() => frames.take(holding, 2));
  const heldRows = Array.from({ length: 8 }, () => frames.floats(holding));
  const leaves = new Uint32Array(padded(12 * meta.leaves, 4)), floats = new Float32Array(leaves.buffer);
  let offset = 0;
  for (let leaf = 0, t = 0, h = 0; leaf < meta.leaves; ++leaf) {
    const at = 12 * leaf;
    let size: number;
    if (held[leaf] === 0) {
      floats.set(tiles.frames.subarray(12 * t, 12 * t + 8), at);
      size = tiles.sizes[2 * t]! | (tiles.sizes[2 * t + 1]! << 16);
      ++t;
    } else {
      for (let k = 0; k < 8; ++k) floats[at + k] = heldRows[k]![h]!;
      size = heldSizes[0]![h]! | (heldSizes[1]![h]! << 16);
      ++h;
    }
    leaves[at + 8] = offset;
    leaves[at + 9] = own[0]![leaf]! | (own[1]![leaf]! << 16);
    leaves[at + 10] = size;
    offset += own[0]![leaf]! * own[1]![leaf]!;
  }
  const values = new Uint16Array(padded(offset * channels, 1));
  values.set(unpredict(columns.take(offset * channels, 2), own[0]!, own[1]!, channels));
  return { leaves, values };
}
