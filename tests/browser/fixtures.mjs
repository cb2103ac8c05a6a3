// The scans and pairs that the tests show, made by the tool in a folder of their own.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { encodePng, writeNpy } from "./files.mjs";

export const TOOL = process.env.RBVH_TOOL ?? "build/release/rbvh";
export const folder = mkdtempSync(join(tmpdir(), "rbvh_view_"));
export const path = (name) => join(folder, name);
export const url = (name) => pathToFileURL(path(name)).href;
export const tool = (...words) => execFileSync(TOOL, [...words, "-q"], { encoding: "utf8" });
export const removeFolder = () => rmSync(folder, { recursive: true, force: true });

/** A bumpy ball with a stalk: `rings` x 2 `rings` quads; colours by place, or by an image around it. */
function ball(rings, { faces = true, colors = true, image = null } = {}) {
  const around = 2 * rings, vertices = [], triangles = [];
  for (let i = 0; i <= rings; ++i)
    for (let j = 0; j < around; ++j) {
      const polar = (Math.PI * i) / rings, turn = (2 * Math.PI * j) / around;
      const r = 1 + 0.08 * Math.sin(6 * turn) * Math.sin(5 * polar);
      const p = [r * Math.sin(polar) * Math.cos(turn), 1.3 * r * Math.cos(polar), -r * Math.sin(polar) * Math.sin(turn)];
      const rgb = p.map((v) => Math.round(127.5 + 90 * Math.sin(3 * v)));
      vertices.push(p.map((v) => v.toFixed(6)).join(" ") + (colors ? ` ${rgb.join(" ")}` : ""));
    }
  for (let i = 0; i < rings && faces; ++i)
    for (let j = 0; j < around; ++j) {
      const a = i * around + j, b = i * around + ((j + 1) % around), c = a + around, d = b + around;
      const at = (x, y) => image ? ` ${(j + x) / around} ${1 - (i + y) / rings}` : "", three = image ? " 6" : "";
      if (i > 0) triangles.push(`3 ${a} ${c} ${b}${three}${at(0, 0)}${at(0, 1)}${at(1, 0)}`);
      if (i + 1 < rings) triangles.push(`3 ${b} ${c} ${d}${three}${at(1, 0)}${at(0, 1)}${at(1, 1)}`);
    }
  return ["ply", "format ascii 1.0", ...(image ? [`comment TextureFile ${image}`] : []), `element vertex ${vertices.length}`, "property float x", "property float y", "property float z",
    ...(colors ? ["red", "green", "blue"].map((c) => `property uchar ${c}`) : []),
    ...(faces ? [`element face ${triangles.length}`, "property list uchar int vertex_indices", ...(image ? ["property list uchar float texcoord"] : [])] : []), "end_header",
    ...vertices, ...triangles, ""].join("\n");
}

/** What is shown: a pair, and the user's layer that gives its colours, if any. */
export const SHOWN = [
  { name: "color", layer: null }, // triangles, with colours
  { name: "tiles", layer: null }, // height fields, and leaves of triangles
  { name: "cloud", layer: null }, // height fields and discs
  { name: "painted", layer: "wear" }, // by a user
  { name: "textured", layer: null }, // by an image
];

/** Blocks of colours, three bytes a pixel. */
function blocks(width, height) {
  const pixels = Buffer.alloc(3 * width * height);
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x)
      for (let c = 0; c < 3; ++c) pixels[3 * (y * width + x) + c] = 60 + ((37 * (x >> 3) + 59 * (y >> 3) + 83 * c * ((x >> 4) + 1)) % 180);
  return encodePng(width, height, pixels);
}

export function makePages() {
  const build = (name, ...options) => {
    tool("build", path(`${name}.ply`), "--levels", "Q1,Q3", ...options, "-o", path(`${name}.rbvh`));
    tool("view", path(`${name}.rbvh`), ...(name === "tiles" ? ["--thumbnail"] : []), "-o", path(`${name}.html`));
  };
  writeFileSync(path("color.ply"), ball(40));
  writeFileSync(path("tiles.ply"), ball(40, { colors: false }));
  writeFileSync(path("points.ply"), ball(40, { faces: false }));
  build("color");
  build("tiles", "--levels-by", "density");
  writeFileSync(path("blocks.png"), blocks(256, 128));
  writeFileSync(path("textured.ply"), ball(40, { colors: false, image: "blocks.png" }));
  build("textured");
  tool("ingest", path("points.ply"), "-o", path("cloud.ply"));
  build("cloud");
  const count = 2000, points = new Float32Array(3 * count), values = new Float32Array(count);
  for (let i = 0; i < count; ++i) {
    const y = 1 - (2 * (i + 0.5)) / count, r = Math.sqrt(1 - y * y), turn = 2.399963 * i;
    points.set([r * Math.cos(turn), 1.3 * y, r * Math.sin(turn)], 3 * i);
    values[i] = 10 + 5 * y;
  }
  writeNpy(path("points.npy"), points, 3);
  writeNpy(path("values.npy"), values, 1);
  tool("paint", path("tiles.rbvh"), "--layer", "wear", "--points", path("points.npy"), "--values", path("values.npy"),
       "--radius", "0.2", "--reach", "0.3", "-o", path("painted.rbvh"));
  tool("view", path("painted.rbvh"), "-o", path("painted.html"));
}
