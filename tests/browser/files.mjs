// What the tests read and write beside pages: NumPy arrays and PNG pictures.
import { readFileSync, writeFileSync } from "node:fs";
import { deflateSync, inflateSync } from "node:zlib";

/** Rows of `width` float32. */
export function writeNpy(path, rows, width) {
  let header = `{'descr': '<f4', 'fortran_order': False, 'shape': (${rows.length / width}, ${width}), }`;
  header += " ".repeat(63 - ((10 + header.length) % 64)) + "\n";
  const head = Buffer.alloc(10);
  head.write("\x93NUMPY\x01\x00", "latin1");
  head.writeUInt16LE(header.length, 8);
  writeFileSync(path, Buffer.concat([head, Buffer.from(header), Buffer.from(rows.buffer, rows.byteOffset, rows.byteLength)]));
}

export function readNpy(path) {
  const bytes = readFileSync(path), start = 10 + bytes.readUInt16LE(8);
  return new Float32Array(bytes.buffer.slice(bytes.byteOffset + start, bytes.byteOffset + bytes.length));
}

/** RGB, 8 bits. */
export function encodePng(width, height, pixels) {
  const chunk = (name, body) => {
    const named = Buffer.concat([Buffer.from(name), body]), length = Buffer.alloc(4), sum = Buffer.alloc(4);
    length.writeUInt32BE(body.length);
    let crc = 0xffffffff;
    for (const byte of named) {
      crc ^= byte;
      for (let k = 0; k < 8; ++k) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
    }
    sum.writeUInt32BE(~crc >>> 0);
    return Buffer.concat([length, named, sum]);
  };
  const head = Buffer.alloc(13), rows = [];
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 2, 0, 0, 0], 8);
  for (let y = 0; y < height; ++y) rows.push(Buffer.from([0]), pixels.subarray(3 * width * y, 3 * width * (y + 1)));
  return Buffer.concat([Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), chunk("IHDR", head), chunk("IDAT", deflateSync(Buffer.concat(rows))), chunk("IEND", Buffer.alloc(0))]);
}

/** RGBA, 8 bits; as `rbvh render` writes it: not interlaced. */
export function decodePng(bytes) {
  const data = [];
  let width = 0, height = 0, type = 0;
  for (let at = 8; at < bytes.length;) {
    const length = bytes.readUInt32BE(at), name = bytes.toString("latin1", at + 4, at + 8), body = bytes.subarray(at + 8, at + 8 + length);
    if (name === "IHDR") [width, height, type] = [body.readUInt32BE(0), body.readUInt32BE(4), body[9]];
    if (name === "IDAT") data.push(body);
    at += length + 12;
  }
  const channels = { 0: 1, 2: 3, 4: 2, 6: 4 }[type], row = width * channels, raw = inflateSync(Buffer.concat(data));
  const out = new Uint8Array(row * height);
  for (let y = 0; y < height; ++y) {
    const filter = raw[y * (row + 1)];
    for (let x = 0; x < row; ++x) {
      const left = x >= channels ? out[y * row + x - channels] : 0, up = y > 0 ? out[(y - 1) * row + x] : 0;
      const corner = x >= channels && y > 0 ? out[(y - 1) * row + x - channels] : 0, guess = left + up - corner;
      const [a, b, c] = [left, up, corner].map((v) => Math.abs(guess - v));
      const paeth = a <= b && a <= c ? left : b <= c ? up : corner;
      out[y * row + x] = raw[y * (row + 1) + 1 + x] + [0, left, up, (left + up) >> 1, paeth][filter];
    }
  }
  return { width, height, channels, pixels: out };
}
