// What a page's data is decoded with: base64, CRC-32, columns of bytes, and meshoptimizer's index codec
// (docs/file_format.md, "Streams").

export function decodeBase64(text: string): Uint8Array<ArrayBuffer> {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; ++i) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

export function crc32(bytes: Uint8Array): number {
  const table = new Uint32Array(256);
  for (let i = 0; i < 256; ++i) {
    let c = i;
    for (let k = 0; k < 8; ++k) c = c & 1 ? (c >>> 1) ^ 0xedb88320 : c >>> 1;
    table[i] = c;
  }
  let crc = 0xffffffff;
  for (let i = 0; i < bytes.length; ++i) crc = (crc >>> 8) ^ table[(crc ^ bytes[i]!) & 255]!;
  return ~crc >>> 0;
}

export async function inflate(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const { readable, writable } = new DecompressionStream("deflate"), writer = writable.getWriter();
  writer.write(bytes).catch(() => undefined); // the reader fails as well
  writer.close().catch(() => undefined);
  return new Uint8Array(await new Response(readable).arrayBuffer());
}

/** The numbers of a level's chunk: columns, the lowest bytes of all values first. */
export class Columns {
  private at = 0;
  constructor(private readonly bytes: Uint8Array) {}

  take(count: number, width: number): Uint32Array {
    if (this.at + count * width > this.bytes.length) throw new Error("a chunk is too short");
    const values = new Uint32Array(count);
    for (let byte = 0; byte < width; ++byte)
      for (let i = 0; i < count; ++i) values[i]! |= this.bytes[this.at++]! << (8 * byte);
    return values;
  }
  floats(count: number): Float32Array {
    return new Float32Array(this.take(count, 4).buffer);
  }
}

/** Triangles of meshoptimizer's index codec, versions 0 and 1. */
export function decodeTriangles(source: Uint8Array, triangles: number): Uint32Array {
  if ((source[0]! & 0xf0) !== 0xe0 || source.length < 17 + triangles)
    throw new Error("the triangles cannot be decoded");
  const version = source[0]! & 15, remembered = version > 0 ? 13 : 15;
  const out = new Uint32Array(3 * triangles);
  const edges = new Uint32Array(32), vertices = new Uint32Array(16);
  let edgeAt = 0, vertexAt = 0, next = 0, last = 0, code = 1, data = 1 + triangles;
  const table = source.length - 16;
  const number = (): number => {
    let value = 0, byte = 128;
    for (let shift = 0; byte > 127 && data < table; shift += 7) {
      byte = source[data++]!;
      value |= (byte & 127) << shift;
    }
    return (last += (value >>> 1) ^ -(value & 1));
  };
  const pushVertex = (v: number): number => (vertices[vertexAt++ & 15] = v);
  const pushEdge = (a: number, b: number): void => {
    edges[2 * (edgeAt & 15)] = a;
    edges[2 * (edgeAt++ & 15) + 1] = b;
  };
  const recent = (n: number): number => vertices[(vertexAt - 1 - n) & 15]!;
  for (let i = 0; i < out.length; i += 3) {
    const c0 = source[code]! >> 4, c1 = source[code++]! & 15;
    let a: number, b: number, c: number;
    if (c0 < 15) {
      const edge = 2 * ((edgeAt - 1 - c0) & 15);
      a = edges[edge]!;
      b = edges[edge + 1]!;
      if (c1 === 0) c = pushVertex(next++);
      else if (c1 < remembered) c = recent(c1);
      else c = pushVertex(c1 === 15 ? number() : (last += c1 === 13 ? -1 : 1));
      pushEdge(c, b);
      pushEdge(a, c);
    } else {
      const e = c1 < 14 ? source[table + c1]! : source[data++]!;
      if (c1 >= 14 && e === 0) next = 0;
      const z = e >> 4, w = e & 15;
      a = c1 === 15 ? number() : next++;
      b = z === 0 ? next++ : z === 15 && c1 >= 14 ? number() : recent(z - 1);
      c = w === 0 ? next++ : w === 15 && c1 >= 14 ? number() : recent(w - 1);
      pushVertex(a);
      if (z === 0 || (z === 15 && c1 >= 14)) pushVertex(b);
      if (w === 0 || (w === 15 && c1 >= 14)) pushVertex(c);
      pushEdge(b, a);
      pushEdge(c, b);
      pushEdge(a, c);
    }
    out[i] = a;
    out[i + 1] = b;
    out[i + 2] = c;
  }
  return out;
}

const unzigzag = (code: number): number => (code >>> 1) ^ -(code & 1);

/**
 * Vertices on a lattice, from what is added to guesses: across an edge that is known, the corner of a
 * parallelogram; else the vertex before.
 */
export function decodePositions(
    residuals: Uint32Array[], triangles: Uint32Array, count: number, lattice: Lattice): Float32Array {
  const places = new Int32Array(3 * count);
  const from = new Int32Array(65536).fill(-1), to = new Int32Array(65536).fill(-1),
        opposite = new Int32Array(65536);
  const known = new Uint8Array(count);
  const slot = (a: number, b: number): number =>
    ((Math.imul(a, 0x9e3779b1) ^ Math.imul(b, 0x85ebca6b)) >>> 16);
  let before = -1, next = 0;
  const put = (v: number, a: number, b: number, c: number): void => {
    for (let axis = 0; axis < 3; ++axis) {
      const guess = a < 0 ? 0 : (places[3 * a + axis]! + places[3 * b + axis]! - places[3 * c + axis]!) | 0;
      places[3 * v + axis] = guess + unzigzag(residuals[axis]![next]!);
    }
    ++next;
    known[v] = 1;
    before = v;
  };
  for (let i = 0; i < triangles.length; i += 3) {
    for (let k = 0; k < 3; ++k) {
      const v = triangles[i + k]!;
      if (v >= count) throw new Error("a triangle has a vertex that is not there");
      if (known[v]) continue;
      const a = triangles[i + ((k + 1) % 3)]!, b = triangles[i + ((k + 2) % 3)]!, s = slot(a, b);
      if (from[s] === a && to[s] === b) put(v, a, b, opposite[s]!);
      else put(v, before, before, before);
    }
    for (let k = 0; k < 3; ++k) {
      const a = triangles[i + ((k + 1) % 3)]!, b = triangles[i + k]!, s = slot(a, b);
      from[s] = a;
      to[s] = b;
      opposite[s] = triangles[i + ((k + 2) % 3)]!;
    }
  }
  for (let v = 0; v < count; ++v)
    if (!known[v]) put(v, before, before, before);
  const positions = new Float32Array(3 * count), f = Math.fround, step = f(lattice.step);
  for (let axis = 0; axis < 3; ++axis) {
    const origin = f(lattice.origin[axis]!);
    for (let i = axis; i < places.length; i += 3) positions[i] = f(origin + f(f(places[i]!) * step));
  }
  return positions;
}

export interface Lattice {
  origin: number[];
  step: number; // 0: there is none
}

/** A unit normal of 2 x 8 bits, octahedral. */
export function unpackNormal(code: number, to: Float32Array, at: number): void {
  let x = ((code & 255) - 128) / 127, y = ((code >> 8) - 128) / 127;
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) {
    const folded = (1 - Math.abs(y)) * (x < 0 ? -1 : 1);
    y = (1 - Math.abs(x)) * (y < 0 ? -1 : 1);
    x = folded;
  }
  const scale = 1 / Math.hypot(x, y, z);
  to[at] = x * scale;
  to[at + 1] = y * scale;
  to[at + 2] = z * scale;
}

/** The same of 2 x 16 bits, as the shaders take it; never 0. */
export function packNormal(x: number, y: number, z: number): number {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z) || 1;
  let u = x / sum, v = y / sum;
  if (z < 0) {
    const folded = (1 - Math.abs(v)) * (u < 0 ? -1 : 1);
    v = (1 - Math.abs(u)) * (v < 0 ? -1 : 1);
    u = folded;
  }
  const code = (value: number): number => Math.round(value * 32767) + 32768;
  return (code(u) | (code(v) << 16)) >>> 0;
}
