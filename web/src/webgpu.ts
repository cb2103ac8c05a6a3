// The renderer in WebGPU compute shaders: work-groups of 8 x 8 pixels write the hits into buffers, which a
// last pass draws.
import { keyDirection } from "./camera";
import type { LevelMeta } from "./page";
import { kindOf } from "./passes";
import type { Traversal } from "./passes";
import type { Renderer, Sample, Shown, ShownLayer } from "./renderer";
import { HIT_WORDS, spreadOf } from "./renderer";
import { isTexture } from "./page";
import blitText from "./blit.wgsl";
import surfaceText from "./surface.wgsl";
import traceText from "./trace.wgsl";

type Pass = "primary" | "occlusion" | "shade" | "castRays";

export const hasWebGpu = (): boolean => "gpu" in navigator && !!navigator.gpu;

/** Uniforms of trace.wgsl: names and words, in their order. */
const UNIFORMS: [string, number][] = [
  ["sceneLo", 3], ["nodes", 1], ["sceneHi", 3], ["prims", 1], ["camPosition", 3], ["vertices", 1], ["camCorner", 3],
  ["tiles", 1], ["camRight", 3], ["layerLeaves", 1], ["camDown", 3], ["normals", 1], ["keyDirection", 3],
  ["heights", 1], ["skyUp", 3], ["colors", 1], ["camOffset", 2], ["layerRange", 2], ["background", 3],
  ["layerValues", 1], ["size", 2], ["target", 2], ["radii", 3], ["row", 1], ["layerInRange", 1], ["sampleNumber", 1],
  ["occluded", 1], ["rayCount", 1], ["skyDistance", 1], ["lift", 1], ["pixelAngle", 1], ["weight", 1],
  ["kept", 1], ["spread", 1], ["-", 2]];
const FLOATS = new Set(["sceneLo", "sceneHi", "camPosition", "camCorner", "camRight", "camDown", "keyDirection", "skyUp",
  "camOffset", "layerRange", "background", "skyDistance", "lift", "pixelAngle", "weight", "kept", "spread"]);

type Words = Record<string, number | boolean>;
/** A shader's lines, without those between #if and #else or #endif that are not for these words. */
function chosen(text: string, words: Words): string {
  const open: boolean[] = [];
  return text.split("\n").filter((line) => {
    if (line[0] !== "#") return open.every(Boolean);
    if (line[1] === "i") open.push(!!words[line.slice(4)]);
    else if (line === "#else") open.push(!open.pop());
    else open.pop();
    return false;
  }).join("\n");
}

type Values = Record<string, number | boolean | number[]>;

export async function makeGpuRenderer(canvas: HTMLCanvasElement, traversal: Traversal,
                                      onFailed: (error: unknown) => void): Promise<Renderer> {
  const adapter = await navigator.gpu?.requestAdapter();
  if (!adapter) throw new Error("no WebGPU");
  const most = adapter.limits.maxStorageBufferBindingSize;
  const device = await adapter.requestDevice({ requiredLimits: {
    maxStorageBufferBindingSize: most, maxBufferSize: adapter.limits.maxBufferSize } });
  void device.lost.then((info) => info.reason !== "destroyed" && onFailed(info));
  device.addEventListener("uncapturederror", ({ error }) => onFailed(error));
  const storage = (binding: number, type: GPUBufferBindingType): GPUBindGroupLayoutEntry =>
    ({ binding, visibility: GPUShaderStage.COMPUTE, buffer: { type } });
  const layout = device.createBindGroupLayout({ entries: [storage(0, "uniform"), storage(1, "read-only-storage"),
    storage(2, "read-only-storage"), ...[3, 4, 5, 6, 7].map((i) => storage(i, "storage"))] });
  const context = canvas.getContext("webgpu");
  if (!context) throw new Error("no WebGPU canvas");
  const format = navigator.gpu.getPreferredCanvasFormat();
  context.configure({ device, format, alphaMode: "opaque" });
  const blitModule = device.createShaderModule({ code: blitText });
  const blit = device.createRenderPipelineAsync({ layout: "auto", vertex: { module: blitModule },
    fragment: { module: blitModule, targets: [{ format }] } });
  return new GpuRenderer(canvas, traversal, device, layout, context, blit);
}

class GpuRenderer implements Renderer {
  readonly name = "webgpu";
  private readonly uniforms: GPUBuffer;
  private readonly blitUniforms: GPUBuffer;
  private readonly nothing: GPUBuffer;
  private readonly blitIsThere: Promise<void>;
  private blit!: GPURenderPipeline;
  private blocks: GPUBuffer | null = null;
  private texels: GPUBuffer | null = null;
  private picture: GPUBuffer[] = []; // surfaces, lights, sums
  private pixelCount = 0;
  private size: [number, number] = [0, 0];
  private places: Values = {};
  private shown: Shown | null = null;
  private layer: ShownLayer | null = null;
  private sample: Sample | null = null;
  private row = 0;
  private stage = 0;
  private rowsPerMs = 0.5;

  private readonly pipelines = new Map<string, Promise<GPUComputePipeline>>();

  constructor(readonly canvas: HTMLCanvasElement, readonly traversal: Traversal, private readonly device: GPUDevice,
              private readonly layout: GPUBindGroupLayout, private readonly context: GPUCanvasContext, blit: Promise<GPURenderPipeline>) {
    const words = UNIFORMS.reduce((sum, [, count]) => sum + count, 0);
    this.uniforms = device.createBuffer({ size: 4 * words, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    this.blitUniforms = device.createBuffer({ size: 32, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    this.nothing = this.buffer(64);
    this.blitIsThere = blit.then((there) => void (this.blit = there));
    this.blitIsThere.catch(() => undefined); // told by what waits for it
  }

  private pipeline(entryPoint: Pass, meta: LevelMeta, layer: ShownLayer | null): Promise<GPUComputePipeline> {
    const { device } = this, { traversal, tiles, discs, colors, texture, layer: channels } = kindOf(this.traversal, meta, layer);
    const casts = entryPoint !== "shade", words: Words = { [entryPoint]: 1, CASTS: casts, SURFACE: casts && entryPoint !== "occlusion",
      TILES: tiles, DISCS: discs, COLORS: colors, LAYER: channels, TEXTURE: texture, TINTED: colors || channels, SHORT: traversal === "short-stack", LINKS: traversal === "parent-link" };
    const key = casts ? JSON.stringify(words) : entryPoint;
    if (!this.pipelines.has(key)) {
      const module = device.createShaderModule({ code: `const LAYER=${channels}u;` + chosen(traceText + surfaceText, words) });
      this.pipelines.set(key, device.createComputePipelineAsync({
        layout: device.createPipelineLayout({ bindGroupLayouts: [this.layout] }), compute: { module, entryPoint } }));
    }
    return this.pipelines.get(key)!;
  }
  warm(meta: LevelMeta, layer: ShownLayer | null): void {
    for (const pass of ["primary", "shade"] as const) this.pipeline(pass, meta, layer).catch(() => undefined);
  }

  private buffer(size: number): GPUBuffer {
    return this.device.createBuffer({ size: Math.max(64, size), usage:
      GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC });
  }

  /** Arrays one after the other, each from a multiple of 16 bytes on; where each begins, in words of `unit`. */
  private upload(arrays: (Uint32Array | Uint16Array)[], unit: number): [GPUBuffer, number[]] {
    const starts: number[] = [];
    let bytes = 0;
    for (const array of arrays) {
      starts.push(bytes / unit);
      bytes += Math.ceil(array.byteLength / 16) * 16;
    }
    if (bytes > this.device.limits.maxStorageBufferBindingSize)
      throw new Error(`it takes a buffer of ${bytes} bytes, which has at most ${this.device.limits.maxStorageBufferBindingSize} here`);
    const buffer = this.buffer(bytes);
    arrays.forEach((array, i) => {
      if (array.byteLength > 0)
        this.device.queue.writeBuffer(buffer, starts[i]! * unit, array.buffer as ArrayBuffer, array.byteOffset,
                                      array.byteLength & ~3);
    });
    return [buffer, starts];
  }

  private load(): void {
    const { data } = this.shown!, layer = this.layer ? data.layers[this.layer.index] : undefined;
    this.blocks?.destroy();
    this.texels?.destroy();
    const [blocks, b] = this.upload([data.nodes, data.prims, data.vertices, data.tiles,
                                     layer?.leaves ?? new Uint32Array(4)], 16);
    const [texels, t] = this.upload([data.normals, data.heights, data.colors, layer?.values ?? new Uint16Array(8)], 4);
    this.blocks = blocks;
    this.texels = texels;
    ["nodes", "prims", "vertices", "tiles", "layerLeaves"].forEach((name, i) => (this.places[name] = b[i]!));
    ["normals", "heights", "colors", "layerValues"].forEach((name, i) => (this.places[name] = t[i]!));
  }

  setLevel(shown: Shown): void {
    this.shown = shown;
    this.layer = null;
    this.load();
  }
  setLayer(layer: ShownLayer | null): void {
    const same = layer?.index === this.layer?.index;
    this.layer = layer;
    if (this.shown && !same) this.load();
  }

  private levelValues(): Values {
    const { data } = this.shown!, layer = this.layer;
    const coded = !!layer && layer.meta.hi > layer.meta.lo;
    const code = (value: number): number =>
      coded ? (value - layer!.meta.lo) / (layer!.meta.hi - layer!.meta.lo) : value;
    const range = isTexture(layer?.meta) ? [layer!.meta.lo, layer!.meta.hi] : layer ? [code(layer.lo), code(layer.hi)] : [0, 1];
    return { ...this.places, sceneLo: data.lo, sceneHi: data.hi, layerInRange: coded, layerRange: range };
  }

  private setUniforms(values: Values): void {
    const words = UNIFORMS.reduce((sum, [, count]) => sum + count, 0), data = new Uint32Array(words),
          floats = new Float32Array(data.buffer);
    let at = 0;
    for (const [name, count] of UNIFORMS) {
      const value = values[name];
      const numbers = value === undefined ? [] : Array.isArray(value) ? value : [Number(value)];
      numbers.forEach((n, i) => ((FLOATS.has(name) ? floats : data)[at + i] = n));
      at += count;
    }
    this.device.queue.writeBuffer(this.uniforms, 0, data);
  }

  private async run(pass: Pass, values: Values, x: number, y: number, rays = this.nothing, hits = this.nothing): Promise<void> {
    const pipeline = await this.pipeline(pass, this.shown!.meta, this.layer);
    this.setUniforms(values);
    const encoder = this.device.createCommandEncoder(), compute = encoder.beginComputePass();
    const [surfaces, lights, sums] = this.picture.length > 0 ? this.picture
      : [this.buffer(64), this.buffer(64), this.buffer(64)];
    compute.setPipeline(pipeline);
    compute.setBindGroup(0, this.device.createBindGroup({ layout: this.layout, entries:
      [this.uniforms, this.blocks!, this.texels!, surfaces!, lights!, sums!, rays === hits ? this.buffer(64) : rays,
       rays === hits ? this.buffer(64) : hits].map((buffer, binding) => ({ binding, resource: { buffer } })) }));
    compute.dispatchWorkgroups(x, y);
    compute.end();
    this.device.queue.submit([encoder.finish()]);
  }

  private async read(from: GPUBuffer, bytes: number): Promise<ArrayBuffer> {
    const to = this.device.createBuffer({ size: bytes, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
    const encoder = this.device.createCommandEncoder();
    encoder.copyBufferToBuffer(from, 0, to, 0, bytes);
    this.device.queue.submit([encoder.finish()]);
    await to.mapAsync(GPUMapMode.READ);
    const copy = to.getMappedRange().slice(0);
    to.destroy();
    return copy;
  }

  async castRays(rays: Float32Array): Promise<Float32Array> {
    const count = rays.length / 8, out = new Float32Array(count * HIT_WORDS), most = 65536;
    for (let first = 0; first < count; first += most) {
      const some = Math.min(most, count - first), data = new Float32Array(8 * some);
      for (let i = 0; i < some; ++i) {
        const r = rays.subarray(8 * (first + i), 8 * (first + i) + 8);
        data.set([r[0]!, r[1]!, r[2]!, r[6]!, r[3]!, r[4]!, r[5]!, Math.min(r[7]!, 3e38)], 8 * i);
      }
      const from = this.buffer(data.byteLength), to = this.buffer(48 * some);
      this.device.queue.writeBuffer(from, 0, data);
      await this.run("castRays", { ...this.levelValues(), rayCount: some }, Math.ceil(some / 64), 1, from, to);
      const words = new Uint32Array(await this.read(to, 48 * some)), floats = new Float32Array(words.buffer);
      for (let i = 0; i < some; ++i) {
        const at = 12 * i, leaf = words[at + 6]!, flags = words[at + 7]!, hit = leaf !== 0xffffffff;
        out.set([hit ? floats[at]! : Infinity, ...floats.subarray(at + 1, at + 6), hit ? leaf : -1, flags & 3,
                 flags >>> 8, ...(floats[at + 11]! > 0 ? floats.subarray(at + 8, at + 11) : [NaN, NaN, NaN])],
                (first + i) * HIT_WORDS);
      }
      from.destroy();
      to.destroy();
    }
    return out;
  }

  begin(sample: Sample): void {
    const { width, height } = sample.rays;
    if (this.size[0] !== width || this.size[1] !== height) {
      this.size = [width, height];
      if (width * height > this.pixelCount) {
        this.pixelCount = width * height;
        for (const buffer of this.picture) buffer.destroy();
        this.picture = [32, 8, 16].map((bytes) => this.buffer(bytes * this.pixelCount));
      }
    }
    this.sample = sample;
    this.row = 0;
    this.stage = 0;
  }

  async work(milliseconds: number): Promise<boolean> {
    const sample = this.sample;
    if (!sample || !this.shown) return true;
    const { rays } = sample, { lo, hi } = this.shown.data, started = performance.now();
    const diagonal = Math.hypot(hi[0]! - lo[0]!, hi[1]! - lo[1]!, hi[2]! - lo[2]!);
    const values: Values = { ...this.levelValues(), camPosition: rays.position, camCorner: rays.corner,
      camRight: rays.right, camDown: rays.down, camOffset: sample.offset,
      keyDirection: keyDirection(rays, sample.offset), skyUp: sample.up, size: this.size,
      radii: [1, 2.5, 6].map((r) => Math.max(1, Math.round((r * rays.height) / 1024))), skyDistance: 0.3 * diagonal,
      lift: 1e-4 * diagonal, pixelAngle: Math.hypot(...rays.down), spread: spreadOf(sample), weight: sample.weight, kept: sample.kept,
      sampleNumber: sample.number, occluded: sample.occlusion };
    for (;;) {
      const left = milliseconds - (performance.now() - started);
      if (left <= 0) return false;
      if (this.stage < 2) {
        const rows = Math.min(rays.height - this.row, Math.max(8, 8 * Math.floor((this.rowsPerMs * left) / 8)));
        const before = performance.now();
        await this.run(this.stage === 0 ? "primary" : "occlusion", { ...values, row: this.row }, Math.ceil(rays.width / 8), Math.ceil(rows / 8));
        await this.device.queue.onSubmittedWorkDone();
        if (this.sample !== sample) return true;
        this.rowsPerMs = 0.5 * this.rowsPerMs + 0.5 * (rows / Math.max(0.1, performance.now() - before));
        this.row += rows;
        if (this.row < rays.height) continue;
        this.row = 0;
        this.stage += this.stage === 0 && !sample.occlusion ? 2 : 1;
        continue;
      }
      await this.blitIsThere;
      await this.run("shade", values, Math.ceil(rays.width / 8), Math.ceil(rays.height / 8));
      this.sample = null;
      return true;
    }
  }

  present(background: [number, number, number]): void {
    const sums = this.picture[2];
    if (!sums) return;
    const data = new Uint32Array(8);
    new Float32Array(data.buffer).set(background);
    data.set([...this.size, this.canvas.width, this.canvas.height], 4);
    this.device.queue.writeBuffer(this.blitUniforms, 0, data);
    const encoder = this.device.createCommandEncoder();
    const pass = encoder.beginRenderPass({ colorAttachments: [{ view: this.context.getCurrentTexture().createView(),
      loadOp: "clear", storeOp: "store", clearValue: [0, 0, 0, 1] }] });
    pass.setPipeline(this.blit);
    pass.setBindGroup(0, this.device.createBindGroup({ layout: this.blit.getBindGroupLayout(0), entries: [
      { binding: 0, resource: { buffer: this.blitUniforms } }, { binding: 1, resource: { buffer: sums } }] }));
    pass.draw(3);
    pass.end();
    this.device.queue.submit([encoder.finish()]);
  }

  async pixels(): Promise<Uint8ClampedArray> {
    const count = this.size[0] * this.size[1], bytes = new Uint8ClampedArray(4 * count);
    const sums = new Float32Array(await this.read(this.picture[2]!, 16 * count));
    for (let i = 0; i < count; ++i) {
      const alpha = sums[4 * i + 3]!;
      for (let c = 0; c < 3; ++c) {
        const v = alpha > 0 ? Math.min(1, Math.max(0, sums[4 * i + c]! / alpha)) : 0;
        bytes[4 * i + c] = 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
      }
      bytes[4 * i + 3] = 255 * alpha;
    }
    return bytes;
  }

  dispose(): void {
    this.context.unconfigure();
    this.device.destroy();
  }
}
