#!/usr/bin/env node
// rbvh-convert laz|e57: reads a compressed cloud on standard input, and writes what rbvh reads on standard output: LAS, or
// lines of x, y, z and colour. Errors are one line; exit code 1.
import { readFileSync, writeSync } from "node:fs";
import { readFile } from "node:fs/promises";

const kHeader = 227; // of LAS 1.0 to 1.2; later ones are longer
const kBatch = 1 << 16; // points

function writeAll(bytes) {
  for (let at = 0; at < bytes.length;) {
    try {
      at += writeSync(1, bytes, at);
    } catch (error) {
      if (error.code !== "EAGAIN") throw error;
    }
  }
}

// The header as it is, less the marks of compression; then the points.
async function unpackLaz(file) {
  if (file.length < kHeader || file.toString("latin1", 0, 4) !== "LASF") throw new Error("is no LAZ file");
  const { createLazPerf } = await import("laz-perf");
  const perf = await createLazPerf();
  const data = perf._malloc(file.length);
  if (data === 0) throw new Error("is too large for WebAssembly's memory");
  perf.HEAPU8.set(file, data);
  const laz = new perf.LASZip();
  laz.open(data, file.length);
  const count = laz.getCount();
  const size = laz.getPointLength();
  const offset = file.readUInt32LE(96);
  if (offset > file.length || size < 20) throw new Error("its header is damaged");
  const head = Buffer.from(file.subarray(0, offset));
  head[104] &= 0x3f;
  if (head[25] >= 4) head.fill(0, 235, 247); // records behind the points are left out
  writeAll(head);
  const point = perf._malloc(size);
  const batch = Buffer.alloc(size * kBatch);
  let filled = 0;
  for (let i = 0; i < count; ++i) {
    laz.getPoint(point);
    batch.set(perf.HEAPU8.subarray(point, point + size), filled);
    filled += size;
    if (filled === batch.length || i + 1 === count) {
      writeAll(batch.subarray(0, filled));
      filled = 0;
    }
  }
}

// Its lines have no intensity: the library leaves that out.
async function unpackE57(file) {
  if (file.toString("latin1", 0, 8) !== "ASTM-E57") throw new Error("is no E57 file");
  const base = import.meta.resolve("web-e57");
  const library = await import(new URL("e57_bg.js", base).href);
  const wasm = await WebAssembly.instantiate(await readFile(new URL("e57_bg.wasm", base)), { "./e57_bg.js": library });
  library.__wbg_set_wasm(wasm.instance.exports);
  writeAll(Buffer.from(library.convertE57(file, "XYZ")));
}

const converters = { laz: unpackLaz, e57: unpackE57 };
try {
  const convert = converters[process.argv[2]];
  if (convert === undefined) throw new Error("usage: rbvh-convert laz|e57 < FILE");
  await convert(readFileSync(0));
} catch (error) {
  const said = String(error?.message ?? error);
  const what = typeof error === "number" || said.includes("Exception catching") ? "the data is damaged" : said;
  process.stderr.write(`${what.split("\n")[0]}\n`);
  process.exitCode = 1;
}
