// The renderer in a WebGL2 fragment shader: traversal, march and shading read textures of whole numbers,
// which every WebGL2 has.
import { keyDirection } from "./camera";
import { ROW } from "./level";
import type { LevelData } from "./level";
import { COVER, kindOf, occlusionPass, presentPass, primaryPass, raysPass, shadePass } from "./passes";
import type { Kind, Traversal } from "./passes";
import type { LevelMeta } from "./page";
import type { Renderer, Sample, Shown, ShownLayer } from "./renderer";
import { HIT_WORDS, spreadOf } from "./renderer";
import { isTexture } from "./page";

type Uniform = number | boolean | number[];
const MOST_ROWS = 8192; // of a texture
/** Whole numbers, by name; any other is a float. */
const INTEGERS = new Set(["rayCount", "radii"]);

/** Compiled and linked while the page goes on; what is wrong with it is said where it is used first. */
class Program {
  readonly handle: WebGLProgram;
  private readonly places = new Map<string, WebGLUniformLocation | null>();
  private readonly shaders: WebGLShader[] = [];
  private linked = false;
  constructor(private readonly gl: WebGL2RenderingContext, vertex: string, fragment: string) {
    this.handle = gl.createProgram()!;
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.handle, shader);
      this.shaders.push(shader);
    }
    gl.linkProgram(this.handle);
  }
  use(): void {
    const gl = this.gl;
    if (!this.linked && !gl.getProgramParameter(this.handle, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(`shaders do not link: ${[gl.getProgramInfoLog(this.handle), ...this.shaders.map((s) => gl.getShaderInfoLog(s))].join(" ")}`);
    this.linked = true;
    gl.useProgram(this.handle);
  }
  place(name: string): WebGLUniformLocation | null {
    if (!this.places.has(name)) this.places.set(name, this.gl.getUniformLocation(this.handle, name));
    return this.places.get(name)!;
  }
  set(name: string, value: Uniform): void {
    const gl = this.gl, at = this.place(name);
    if (at === null) return;
    if (typeof value === "boolean") gl.uniform1i(at, value ? 1 : 0);
    else if (typeof value === "number")
      name === "sampleNumber" ? gl.uniform1ui(at, value)
                              : INTEGERS.has(name) ? gl.uniform1i(at, value) : gl.uniform1f(at, value);
    else if (INTEGERS.has(name)) gl.uniform3iv(at, value);
    else if (value.length === 2) gl.uniform2fv(at, value);
    else gl.uniform3fv(at, value);
  }
}

/** A program's shaders, made for what a level holds. */
export interface Pass {
  name: string;
  fragment: (kind: Kind) => string;
  vertex: (kind: Kind) => string;
}
const [PRIMARY, OCCLUSION, RAYS, SHADE, PRESENT] =
  ([["primary", primaryPass], ["occlusion", occlusionPass], ["rays", raysPass], ["shade", () => shadePass], ["present", () => presentPass]] as const)
    .map(([name, fragment]): Pass => ({ name, fragment, vertex: () => COVER })) as [Pass, Pass, Pass, Pass, Pass];

interface Target {
  frame: WebGLFramebuffer;
  textures: WebGLTexture[];
  width: number;
  height: number;
}

export class GlRenderer implements Renderer {
  readonly name: string = "webgl2";
  protected readonly gl: WebGL2RenderingContext;
  private readonly programs = new Map<string, Program>();
  private readonly level = new Map<string, WebGLTexture>();
  private readonly empty: WebGLTexture;
  private layer: ShownLayer | null = null;
  protected shown: Shown | null = null;
  protected surface: Target | null = null; // t, normal; color, leaf
  private light: Target | null = null;
  private sums: Target[] = [];
  protected sample: Sample | null = null;
  private row = 0; // of the sample, from which there is work to do
  private stage = 0;
  private rowsPerMs = 0.5;
  readonly mostRows: number;

  constructor(readonly canvas: HTMLCanvasElement, readonly traversal: Traversal) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: true,
                                             preserveDrawingBuffer: true });
    if (!gl) throw new Error("no WebGL2");
    this.gl = gl;
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    if (most < ROW) throw new Error(`its textures have ${most} texels a side, of ${ROW} that are needed`);
    this.mostRows = Math.min(most, MOST_ROWS);
    gl.bindVertexArray(gl.createVertexArray());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.pixelStorei(gl.PACK_ALIGNMENT, 1);
    this.empty = this.texture(gl.RGBA32UI, 1, 1, new Uint32Array(4));
  }

  private program({ name, fragment, vertex }: Pass, kind: Kind | null): Program {
    const key = name + JSON.stringify(kind);
    if (!this.programs.has(key)) this.programs.set(key, new Program(this.gl, vertex(kind!), fragment(kind!)));
    return this.programs.get(key)!;
  }
  private use(pass: Pass): Program {
    const program = this.program(pass, null);
    program.use();
    return program;
  }
  /** One that traces what is shown, with its textures. */
  protected tracer(pass: Pass): Program {
    const program = this.program(pass, kindOf(this.traversal, this.shown!.meta, this.layer));
    program.use();
    this.bindLevel(program);
    return program;
  }

  private texture(format: number, width: number, height: number, data: ArrayBufferView | null): WebGLTexture {
    const gl = this.gl, texture = gl.createTexture()!;
    const [layout, type] = format === gl.RGBA32UI ? [gl.RGBA_INTEGER, gl.UNSIGNED_INT]
      : format === gl.R32UI ? [gl.RED_INTEGER, gl.UNSIGNED_INT]
      : format === gl.R16UI ? [gl.RED_INTEGER, gl.UNSIGNED_SHORT] : [gl.RGBA, gl.UNSIGNED_BYTE];
    gl.activeTexture(gl.TEXTURE15);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, layout, type, data);
    return texture;
  }

  protected target(width: number, height: number, formats: number[], depth = false): Target {
    const gl = this.gl, frame = gl.createFramebuffer()!;
    const textures = formats.map((format) => this.texture(format, width, height, null));
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    textures.forEach((texture, i) =>
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0));
    gl.drawBuffers(textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
    if (depth) {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, buffer);
    }
    return { frame, textures, width, height };
  }

  private drop(target: Target | null): void {
    if (!target) return;
    this.gl.deleteFramebuffer(target.frame);
    for (const texture of target.textures) this.gl.deleteTexture(texture);
  }

  protected put(name: string, format: number, data: Uint32Array | Uint16Array, perTexel: number): void {
    const old = this.level.get(name), rows = Math.max(1, data.length / (ROW * perTexel));
    if (rows > this.mostRows)
      throw new Error(`its ${name} take ${rows} rows of a texture, which has at most ${this.mostRows}`);
    if (old) this.gl.deleteTexture(old);
    const whole = data.length > 0 ? data : format === this.gl.R16UI ? new Uint16Array(ROW) : new Uint32Array(ROW * perTexel);
    this.level.set(name, this.texture(format, ROW, rows, whole));
  }

  warm(meta: LevelMeta, layer: ShownLayer | null): void {
    for (const pass of this.primaries(meta)) this.program(pass, kindOf(this.traversal, meta, layer));
    for (const pass of [SHADE, PRESENT]) this.program(pass, null);
    this.gl.flush();
  }
  /** What finds primary hits. */
  protected primaries(_: LevelMeta): Pass[] {
    return [PRIMARY];
  }

  setLevel(shown: Shown): void {
    const gl = this.gl, data: LevelData = shown.data;
    this.shown = shown;
    this.put("nodes", gl.RGBA32UI, data.nodes, 4);
    this.put("prims", gl.RGBA32UI, data.prims, 4);
    this.put("vertices", gl.RGBA32UI, data.vertices, 4);
    this.put("tiles", gl.RGBA32UI, data.tiles, 4);
    this.put("heights", gl.R16UI, data.heights, 1);
    this.put("normals", gl.R32UI, data.normals, 1);
    this.put("colors", gl.R16UI, data.colors, 1);
    this.setLayer(null);
  }

  setLayer(layer: ShownLayer | null): void {
    this.layer = layer;
    if (!layer || !this.shown) return;
    const data = this.shown.data.layers[layer.index]!;
    this.put("layerLeaves", this.gl.RGBA32UI, data.leaves, 4);
    this.put("layerValues", this.gl.R16UI, data.values, 1);
  }

  /** The level's textures and what else tracing needs. */
  private bindLevel(program: Program): void {
    const gl = this.gl, shown = this.shown!;
    ["nodes", "prims", "vertices", "tiles", "heights", "normals", "colors", "layerLeaves", "layerValues",
     "texelTiles"]
      .forEach((name, unit) => {
        const at = program.place(name);
        if (at === null) return;
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, this.level.get(name) ?? this.empty);
        gl.uniform1i(at, unit);
      });
    program.set("sceneLo", shown.data.lo);
    program.set("sceneHi", shown.data.hi);
    const layer = this.layer;
    if (!layer) return;
    const { lo, hi } = layer.meta, coded = hi > lo;
    const code = (value: number): number => (coded ? (value - lo) / (hi - lo) : value);
    program.set("layerInRange", coded);
    program.set("layerRange", isTexture(layer.meta) ? [lo, hi] : [code(layer.lo), code(layer.hi)]);
  }

  protected bind(program: Program, name: string, texture: WebGLTexture, unit: number): void {
    const at = program.place(name);
    if (at === null) return;
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
    this.gl.uniform1i(at, unit);
  }

  protected setCamera(program: Program, sample: Sample): void {
    program.set("spread", spreadOf(sample));
    program.set("camPosition", sample.rays.position);
    program.set("camCorner", sample.rays.corner);
    program.set("camRight", sample.rays.right);
    program.set("camDown", sample.rays.down);
    program.set("camOffset", sample.offset);
    program.set("keyDirection", keyDirection(sample.rays, sample.offset));
  }

  private draw(target: Target | null, rows?: [number, number]): void {
    const gl = this.gl;
    const width = target ? target.width : this.canvas.width, height = target ? target.height : this.canvas.height;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target ? target.frame : null);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.DEPTH_TEST);
    if (rows) {
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(0, rows[0], width, rows[1] - rows[0]);
    }
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.SCISSOR_TEST);
  }

  /** Waits for the device: reads a pixel. */
  private finish(target: Target): void {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, new Uint32Array(4));
  }

  async castRays(rays: Float32Array): Promise<Float32Array> {
    const gl = this.gl, count = rays.length / 8, out = new Float32Array(count * HIT_WORDS);
    const most = 1024 * 64;
    for (let first = 0; first < count; first += most) {
      const some = Math.min(most, count - first), rows = Math.ceil(some / 1024);
      const rayRows = Math.ceil((2 * some) / ROW), data = new Uint32Array(rayRows * ROW * 4);
      const floats = new Float32Array(data.buffer);
      for (let i = 0; i < some; ++i) {
        const r = rays.subarray(8 * (first + i), 8 * (first + i) + 8);
        floats.set([r[0]!, r[1]!, r[2]!, r[6]!, r[3]!, r[4]!, r[5]!, Math.min(r[7]!, 3e38)], 8 * i);
      }
      const texture = this.texture(gl.RGBA32UI, ROW, rayRows, data);
      const target = this.target(1024, rows, [gl.RGBA32UI, gl.RGBA32UI, gl.RGBA32UI]);
      const program = this.tracer(RAYS);
      this.bind(program, "rays", texture, 10);
      program.set("rayCount", some);
      this.draw(target);
      const read: Uint32Array[] = [0, 1, 2].map((i) => {
        const words = new Uint32Array(1024 * rows * 4);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
        gl.readBuffer(gl.COLOR_ATTACHMENT0 + i);
        gl.readPixels(0, 0, 1024, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
        return words;
      });
      const hits = new Float32Array(read[0]!.buffer), places = new Float32Array(read[1]!.buffer),
            values = new Float32Array(read[2]!.buffer);
      for (let i = 0; i < some; ++i) {
        const leaf = read[1]![4 * i + 2]!, flags = read[1]![4 * i + 3]!, hit = leaf !== 0xffffffff;
        out.set([hit ? hits[4 * i]! : Infinity, hits[4 * i + 1]!, hits[4 * i + 2]!, hits[4 * i + 3]!,
                 places[4 * i]!, places[4 * i + 1]!, hit ? leaf : -1, flags & 3, flags >>> 8,
                 ...(values[4 * i + 3]! > 0 ? values.subarray(4 * i, 4 * i + 3) : [NaN, NaN, NaN])],
                (first + i) * HIT_WORDS);
      }
      this.drop(target);
      gl.deleteTexture(texture);
    }
    return out;
  }

  begin(sample: Sample): void {
    const gl = this.gl, { width, height } = sample.rays;
    if (!this.surface || this.surface.width !== width || this.surface.height !== height) {
      for (const target of [this.surface, this.light, ...this.sums]) this.drop(target);
      this.surface = this.target(width, height, [gl.RGBA32UI, gl.RGBA32UI], true);
      this.light = this.target(width, height, [gl.RGBA32UI]);
      this.sums = [this.target(width, height, [gl.RGBA32UI]), this.target(width, height, [gl.RGBA32UI])];
    }
    this.sample = sample;
    this.row = 0;
    this.stage = 0;
  }

  /** Rows [from, to) of the primary hits. */
  protected castPrimary(sample: Sample, from: number, to: number): void {
    const program = this.tracer(PRIMARY);
    this.setCamera(program, sample);
    this.draw(this.surface, [from, to]);
  }

  private castOcclusion(sample: Sample, from: number, to: number): void {
    const program = this.tracer(OCCLUSION);
    this.setCamera(program, sample);
    this.bind(program, "gNormal", this.surface!.textures[0]!, 10);
    const { lo, hi } = this.shown!.data;
    const diagonal = Math.hypot(hi[0]! - lo[0]!, hi[1]! - lo[1]!, hi[2]! - lo[2]!);
    program.set("skyDistance", 0.3 * diagonal);
    program.set("lift", 1e-4 * diagonal);
    program.set("sampleNumber", sample.number);
    this.draw(this.light, [from, to]);
  }

  private shade(sample: Sample): void {
    const program = this.use(SHADE);
    this.setCamera(program, sample);
    this.bind(program, "gNormal", this.surface!.textures[0]!, 10);
    this.bind(program, "gColor", this.surface!.textures[1]!, 11);
    this.bind(program, "gLight", this.light!.textures[0]!, 12);
    this.bind(program, "accumulated", this.sums[0]!.textures[0]!, 13);
    program.set("skyUp", sample.up);
    program.set("pixelAngle", Math.hypot(...sample.rays.down));
    program.set("weight", sample.weight);
    program.set("kept", sample.kept);
    program.set("radii", [1, 2.5, 6].map((r) => Math.max(1, Math.round((r * sample.rays.height) / 1024))));
    program.set("occluded", sample.occlusion);
    this.draw(this.sums[1]!);
    this.sums.reverse();
  }

  async work(milliseconds: number): Promise<boolean> {
    const sample = this.sample;
    if (!sample || !this.shown) return true;
    const started = performance.now(), { height } = sample.rays;
    for (;;) {
      const left = milliseconds - (performance.now() - started);
      if (left <= 0) return false;
      if (this.stage < 2) {
        const to = Math.min(height, this.row + Math.max(1, Math.floor(this.rowsPerMs * left)));
        const before = performance.now();
        if (this.stage === 0) this.castPrimary(sample, this.row, to);
        else this.castOcclusion(sample, this.row, to);
        this.finish(this.stage === 0 ? this.surface! : this.light!);
        const took = Math.max(0.1, performance.now() - before);
        this.rowsPerMs = 0.5 * this.rowsPerMs + 0.5 * Math.min(height, ((to - this.row) / took));
        this.row = to;
        if (to < height) continue;
        this.row = 0;
        this.stage += this.stage === 0 && !sample.occlusion ? 2 : 1;
        continue;
      }
      this.shade(sample);
      this.sample = null;
      return true;
    }
  }

  present(background: [number, number, number]): void {
    if (this.sums.length === 0) return;
    const program = this.use(PRESENT);
    this.bind(program, "accumulated", this.sums[0]!.textures[0]!, 10);
    program.set("targetSize", [this.canvas.width, this.canvas.height]);
    program.set("background", background);
    program.set("onScreen", true);
    this.draw(null);
  }

  async pixels(): Promise<Uint8ClampedArray> {
    const gl = this.gl, { width, height } = this.sums[0]!;
    const target = this.target(width, height, [gl.RGBA8]);
    const program = this.use(PRESENT);
    this.bind(program, "accumulated", this.sums[0]!.textures[0]!, 10);
    program.set("onScreen", false);
    this.draw(target);
    const bytes = new Uint8Array(width * height * 4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    this.drop(target);
    return new Uint8ClampedArray(bytes.buffer);
  }

  dispose(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
