// The hybrid renderer: primary hits by rasterisation, shadows and occlusion by rays. What is rasterised says
// which primitive or tile a pixel sees; the hit is then that of the ray, as other renderers have it.
import { primaryPieces } from "./passes";
import type { Traversal } from "./passes";
import { dot, sub } from "./camera";
import type { Vec } from "./camera";
import type { LevelMeta } from "./page";
import type { Sample, Shown } from "./renderer";
import { ROW } from "./level";
import { GlRenderer } from "./webgl";
import type { Pass } from "./webgl";

/** Vertices come from the level's textures; clip space is the picture's, its top row first. */
const project = `
uniform vec3 camForward;
uniform vec2 targetSize;
uniform float nearest;
vec4 toClip(vec3 p) {
  vec3 q = p - camPosition;
  float w = dot(q, camForward);
  vec3 onPlane = q - camCorner * w;
  vec2 pixel = vec2(dot(onPlane, camRight) / dot(camRight, camRight), dot(onPlane, camDown) / dot(camDown, camDown));
  return vec4(2.0 * (pixel + (0.5 - camOffset) * w) / targetSize - w, w - 2.0 * nearest, w);
}
`;

/** Of a quad's two triangles: its corner, as bits. */
const quad = `
uint cornerOfSix() {
  uint i = uint(gl_VertexID) % 6u;
  return i < 3u ? i : i == 3u ? 1u : i == 4u ? 3u : 2u;
}
`;

const triangleVertex = `
flat out uint element;
void main() {
  element = uint(gl_VertexID) / 3u;
  uvec4 prim = word4(prims, element);
  gl_Position = toClip(float4(vertices, 2u * prim[uint(gl_VertexID) % 3u]).xyz);
}`;

const triangleFragment = `
flat in uint element;
void main() {
  vec3 d = pixelDirection(thisPixel());
  prepare(camPosition, d, 0.0, FAR);
  uvec4 prim = word4(prims, element);
  // Where its plane is met; at edges the pixel may lie beside it by a part of what rasterisers round to.
  vec3 a = permuted(float4(vertices, 2u * prim.x).xyz) - sheared,
       b = permuted(float4(vertices, 2u * prim.y).xyz) - sheared,
       c = permuted(float4(vertices, 2u * prim.z).xyz) - sheared;
  vec2 p = a.xy - shear.xy * a.z, q = b.xy - shear.xy * b.z, r = c.xy - shear.xy * c.z;
  vec3 areas = vec3(r.x * q.y - r.y * q.x, p.x * r.y - p.y * r.x, q.x * p.y - q.y * p.x);
  float sum = areas.x + areas.y + areas.z;
  if (sum == 0.0) discard;
  areas = max(areas / sum, 0.0);
  areas /= areas.x + areas.y + areas.z;
  found = Found(dot(areas, shear.z * vec3(a.z, b.z, c.z)), element, prim.w, areas.yz);
  writeSurface(-d);
}`;

const discVertex = `
flat out uint element;
void main() {
  element = uint(gl_VertexID) / 6u;
  uint corner = cornerOfSix();
  uvec4 prim = word4(prims, element);
  vec3 c = float4(vertices, 2u * prim.x).xyz;
  vec4 n = float4(vertices, 2u * prim.x + 1u);
  float s = n.z < 0.0 ? -1.0 : 1.0, a = -1.0 / (s + n.z), b = n.x * n.y * a;
  vec3 x = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), y = vec3(b, s + n.y * n.y * a, -n.y);
  vec2 side = 2.0 * vec2(float(corner & 1u), float(corner >> 1)) - 1.0;
  gl_Position = toClip(c + 1.01 * n.w * (side.x * x + side.y * y));
}`;

/** Depth of what was found, as the rasteriser has it. */
const writeDepth = `gl_FragDepth = 1.0 - nearest / (found.t * dot(d, camForward));`;

const discFragment = `
flat in uint element;
void main() {
  vec3 d = pixelDirection(thisPixel());
  prepare(camPosition, d, 0.0, FAR);
  intersectDisc(element, word4(prims, element));
  if (found.id == NONE) discard;
  ${writeDepth}
  writeSurface(-d);
}`;

/**
 * A cell of a tile: two triangles between four texels, and a pixel around them. Rays that graze a surface hit it
 * (trace.glsl), so a cell that is seen from its side is drawn as the rectangle around it.
 */
const cellVertex = `
uniform usampler2D texelTiles;
flat out uint element;
const float SIDE = 0.35;  // cosine
void main() {
  uint texel = uint(gl_VertexID) / 6u, which = cornerOfSix();
  element = texelFetch(texelTiles, ivec2(texel & 4095u, texel >> 12), 0).x;
  Tile tile = readTile(element);
  int at = int(texel - tile.offset);
  ivec2 cell = ivec2(at % tile.width, at / tile.width);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (cell.x > tile.width - 2 || cell.y > tile.height - 2) return;
  vec4 h = vec4(heightAt(tile, at), heightAt(tile, at + 1), heightAt(tile, at + tile.width),
                heightAt(tile, at + tile.width + 1));
  vec4 there = vec4(greaterThan(h, vec4(0.0)));
  float count = there.x + there.y + there.z + there.w;
  if (count < 2.0) return;
  mat3 rows = transpose(mat3(tile.columns)), back;
  for (int k = 0; k < 3; ++k) back[k] = rows[k] / dot(rows[k], rows[k]);
  vec3 corners[4];
  vec4 clip[4];
  vec2 lo = vec2(FAR), hi = vec2(-FAR), middle = vec2(0.0);
  float first = FAR;
  for (int k = 0; k < 4; ++k) {
    float height = there[k] > 0.0 ? h[k] : dot(h, there) / count;
    corners[k] = back * (vec3(vec2(cell) + vec2(float(k & 1), float(k >> 1)), height) - tile.columns[3]);
    clip[k] = toClip(corners[k]);
    first = min(first, clip[k].w);
    vec2 seen = clip[k].xy / clip[k].w;
    lo = min(lo, seen);
    hi = max(hi, seen);
    middle += 0.25 * seen;
  }
  gl_Position = clip[which];
  if (first < nearest) return;
  vec3 normal = normalize(cross(corners[3] - corners[0], corners[2] - corners[1]));
  vec2 pixel = 2.0 / targetSize, seen = gl_Position.xy / gl_Position.w;
  if (abs(dot(normal, normalize(corners[0] - camPosition))) < SIDE)
    seen = mix(lo - pixel, hi + pixel, vec2(float(which & 1u), float(which >> 1)));
  else
    seen += pixel * sign(seen - middle);
  gl_Position.xy = seen * gl_Position.w;
}`;

const cellFragment = `
flat in uint element;
void main() {
  vec3 d = pixelDirection(thisPixel());
  prepare(camPosition, d, 0.0, FAR);
  march(element);
  if (found.id == NONE) discard;
  ${writeDepth}
  writeSurface(-d);
}`;

const pass = (name: string, vertex: string, fragment: string): Pass => ({
  name,
  vertex: (kind) => {
    const { tracing, camera } = primaryPieces(kind);
    return `${tracing}${camera.replace(/vec2 thisPixel.*/, "")}${project}${quad}${vertex}`;
  },
  fragment: (kind) => {
    const { tracing, camera, toViewer } = primaryPieces(kind);
    return `${tracing}${camera}${toViewer}${project}${fragment}`;
  },
});
const TRIANGLES = pass("triangles", triangleVertex, triangleFragment), DISCS = pass("discs", discVertex, discFragment),
      CELLS = pass("cells", cellVertex, cellFragment);

export class HybridRenderer extends GlRenderer {
  override readonly name = "hybrid";
  private texels = 0;

  constructor(canvas: HTMLCanvasElement, traversal: Traversal) {
    super(canvas, traversal);
  }

  override setLevel(shown: Shown): void {
    super.setLevel(shown);
    const { meta, data } = shown, tiles = new Uint32Array(Math.max(ROW, data.heights.length));
    this.texels = meta.texels;
    for (let t = 0; t < meta.tiles; ++t) {
      const size = data.tiles[24 * t + 18]!, offset = data.tiles[24 * t + 19]!;
      tiles.fill(t, offset, offset + (size & 65535) * (size >>> 16));
    }
    this.put("texelTiles", this.gl.R32UI, tiles, 1);
  }

  protected override primaries(meta: LevelMeta): Pass[] {
    const some = meta.discs ? [DISCS] : meta.triangles > 0 ? [TRIANGLES] : [];
    return meta.tiles > 0 ? [...some, CELLS] : some;
  }

  protected override castPrimary(sample: Sample, from: number): void {
    if (from > 0) return; // all rows are drawn with the first ones
    const gl = this.gl, { meta } = this.shown!;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.surface!.frame);
    gl.viewport(0, 0, this.surface!.width, this.surface!.height);
    gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferuiv(gl.COLOR, 1, [0, 0, 0, 0xffffffff]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LESS);
    for (const pass of this.primaries(meta))
      this.rasterise(sample, pass, pass === CELLS ? 6 * this.texels : meta.discs ? 6 * meta.vertices : 3 * meta.triangles);
    gl.disable(gl.DEPTH_TEST);
  }

  private rasterise(sample: Sample, pass: Pass, count: number): void {
    const gl = this.gl, { rays } = sample, program = this.tracer(pass);
    this.setCamera(program, sample);
    const { forward } = rays, { lo, hi } = this.shown!.data;
    const diagonal = Math.hypot(hi[0]! - lo[0]!, hi[1]! - lo[1]!, hi[2]! - lo[2]!);
    let nearest = Infinity;
    for (let i = 0; i < 8; ++i) {
      const corner: Vec = [(i & 1 ? hi : lo)[0]!, (i & 2 ? hi : lo)[1]!, (i & 4 ? hi : lo)[2]!];
      nearest = Math.min(nearest, dot(sub(corner, rays.position), forward));
    }
    program.set("camForward", forward);
    program.set("targetSize", [rays.width, rays.height]);
    program.set("nearest", Math.max(1e-4 * diagonal, 0.9 * nearest));
    gl.drawArrays(gl.TRIANGLES, 0, count);
  }
}
