// What is shown and how: the levels as they are decoded, the camera, and the loop that draws. Coarse while
// the camera moves, then all pixels, then shadows and occlusion, sample by sample.
import { add, cameraRays, cross, dot, length, normalize, pixelDirection, rotate, sampleOffset, scale, sub,
         viewFrom } from "./camera";
import type { Camera, Vec } from "./camera";
import type { LevelData } from "./level";
import { isTexture } from "./page";
import type { PageMeta } from "./page";
import { HIT_WORDS } from "./renderer";
import type { Renderer, ShownLayer } from "./renderer";

const FRAME_MS = 33, STILL_AFTER_MS = 180, STILL_SAMPLES = 48, STEEPEST = 0.9995;

export interface Probe {
  position: Vec; // in the scan's coordinates
  normal: Vec;
  leaf: number;
  values: number[]; // of the layer that is shown
}

export class Viewer {
  camera: Camera;
  pivot: Vec;
  level = -1; // that is shown
  wanted = -1; // by the user; -1: the finest there is
  layer: ShownLayer | null = null;
  readonly levels: (LevelData | null)[];
  background: [number, number, number] = [0.95, 0.95, 0.95];
  firstPicture = 0; // milliseconds since the page began
  frames = 0;
  rate = 0; // million rays a second, of the last whole sample
  onChange: () => void = () => {};
  onRefused: (what: string, error: unknown) => void = () => {}; // what the device has no room for

  onFailed: (error: unknown) => void = () => {}; // the renderer draws no more

  private renderer_: Renderer | null = null;
  private busy: Promise<unknown> = Promise.resolve();
  private changedAt = -Infinity;
  private moving = false;
  private begun!: () => void;
  /** The first picture is there. */
  readonly first = new Promise<void>((done) => (this.begun = done));
  done = 0; // samples of a still picture
  scale = 0.15; // of a moving picture: its pixels along a side, as a part of the canvas's
  private timer = 0;

  constructor(readonly meta: PageMeta, public canvas: HTMLCanvasElement) {
    this.levels = meta.levels.map(() => null);
    this.camera = this.standardView(30, 20);
    this.pivot = this.camera.focalPoint;
  }

  get renderer(): Renderer | null {
    return this.renderer_;
  }
  /** A new renderer gets the level that is shown. */
  setRenderer(renderer: Renderer | null): void {
    this.renderer_ = renderer;
    if (!renderer) return this.onChange();
    this.canvas = renderer.canvas;
    if (this.level >= 0) this.show(this.level, true);
    else renderer.warm(this.meta.levels[0]!, this.texture(0));
  }

  standardView(azimuth: number, elevation: number): Camera {
    const { lo, hi } = this.meta.bounds;
    const aspect = this.canvas.width / Math.max(1, this.canvas.height);
    return viewFrom({ lo: lo as Vec, hi: hi as Vec }, this.meta.up as Vec, azimuth, elevation, 30, aspect);
  }

  setCamera(camera: Camera, pivot: Vec = camera.focalPoint): void {
    this.camera = camera;
    this.pivot = pivot;
    this.changed();
  }

  /** Level `index` is decoded. */
  add(index: number, data: LevelData): void {
    this.levels[index] = data;
    if (this.wanted < 0 || this.wanted === index) this.show(index);
    this.onChange();
  }

  show(index: number, again = false): void {
    const data = this.levels[index];
    if (!data || (index === this.level && !again)) return;
    const name = this.layer?.meta.name;
    this.level = index;
    this.exclusive(async () => {
      const meta = this.meta.levels[index]!;
      this.renderer_?.setLevel({ meta, data });
      const same = meta.layers.findIndex((layer) => layer.name === name);
      this.layer = same < 0 ? null
        : { index: same, meta: meta.layers[same]!, lo: this.layer!.lo, hi: this.layer!.hi };
      this.renderer_?.setLayer(this.layer ?? this.texture(index));
    }).catch((error: unknown) => {
      // The next coarser one is there, as it was decoded before.
      this.level = -1;
      this.show(index - 1);
      this.onRefused(this.meta.levels[index]!.name, error);
    });
    this.changed();
  }

  /** What a textured surface shows where no layer is chosen. */
  private texture(level: number): ShownLayer | null {
    const { layers } = this.meta.levels[level]!, index = layers.findIndex(isTexture), meta = layers[index];
    return meta ? { index, meta, lo: meta.lo, hi: meta.hi } : null;
  }

  setLayer(layer: ShownLayer | null): void {
    this.layer = layer;
    this.exclusive(async () => this.renderer_?.setLayer(layer ?? (this.level < 0 ? null : this.texture(this.level)))).catch((error: unknown) => {
      if (layer) this.setLayer(null);
      else this.renderer_?.setLayer(null);
      this.onRefused(layer?.meta.name ?? "texture", error);
    });
    this.changed();
  }

  /** One at a time uses the renderer. */
  exclusive<T>(work: () => Promise<T>): Promise<T> {
    const result = this.busy.then(work);
    this.busy = result.catch(() => undefined);
    return result;
  }

  changed(): void {
    this.changedAt = performance.now();
    this.moving = true;
    this.done = 0;
    this.onChange();
    this.wake();
  }

  private wake(): void {
    if (this.timer === 0) this.timer = requestAnimationFrame(() => void this.frame());
  }

  private async frame(): Promise<void> {
    const { renderer } = this;
    await this.exclusive(() => this.draw()).catch((error: unknown) => renderer === this.renderer && this.onFailed(error));
    this.timer = 0;
    if (this.renderer_ && this.level >= 0 && (this.moving || this.done < STILL_SAMPLES)) this.wake();
  }

  private async draw(): Promise<void> {
    const renderer = this.renderer_, { width, height } = this.canvas;
    if (!renderer || this.level < 0 || width === 0) return;
    const up = this.meta.up as Vec;
    if (this.moving) {
      const at = this.changedAt, started = performance.now();
      const rays = cameraRays(this.camera, Math.max(1, Math.round(width * this.scale)),
                              Math.max(1, Math.round(height * this.scale)));
      renderer.begin({ rays, offset: [0.5, 0.5], weight: 1, kept: 0, number: 0, occlusion: false, up });
      while (!(await renderer.work(1000))) continue;
      renderer.present(this.background);
      const took = performance.now() - started;
      this.scale = Math.min(1, Math.max(0.1, this.scale * Math.sqrt(FRAME_MS / Math.max(1, took))));
      if (this.firstPicture === 0) this.showFirst();
      ++this.frames;
      if (this.changedAt === at && performance.now() - at > STILL_AFTER_MS) this.moving = false;
      return;
    }
    // A still picture: the quick look first, then samples with shadows take its place.
    const started = performance.now(), done = this.done;
    const rays = cameraRays(this.camera, width, height);
    const quick = done === 0, number = Math.max(0, done - 1);
    renderer.begin({ rays, offset: quick ? [0.5, 0.5] : sampleOffset(number, STILL_SAMPLES), number,
                     weight: 1 / (number + 1), kept: number / (number + 1), occlusion: !quick, up });
    for (;;) {
      const whole = await renderer.work(20);
      if (this.done !== done || this.moving) return; // the camera moves again
      if (whole) break;
      await new Promise((next) => setTimeout(next, 0));
      if (this.done !== done || this.moving) return;
    }
    renderer.present(this.background);
    if (quick) this.rate = (width * height) / (performance.now() - started) / 1000;
    ++this.done;
    ++this.frames;
    this.onChange();
  }

  private showFirst(): void {
    this.firstPicture = performance.now();
    this.canvas.hidden = false;
    this.begun();
  }

  // --- what scripts ask for

  /** The look of `rbvh render --quick`: straight alpha, row by row from the top. */
  render(width: number, height: number, samples = 4): Promise<Uint8ClampedArray> {
    return this.exclusive(async () => {
      const renderer = this.renderer_;
      if (!renderer) throw new Error("there is no renderer");
      const rays = cameraRays(this.camera, width, height);
      for (let i = 0; i < samples; ++i) {
        renderer.begin({ rays, offset: sampleOffset(i, samples), weight: 1 / samples, kept: i > 0 ? 1 : 0,
                         number: i, occlusion: false, up: this.meta.up as Vec });
        while (!(await renderer.work(1000))) continue;
      }
      const pixels = await renderer.pixels();
      this.done = 0;
      this.wake();
      return pixels;
    });
  }

  castRays(rays: Float32Array): Promise<Float32Array> {
    return this.exclusive(async () => {
      if (!this.renderer_ || this.level < 0) throw new Error("there is no renderer");
      return this.renderer_.castRays(rays);
    });
  }

  /** What lies at a place of the canvas, in its pixels; null: nothing. */
  async probe(x: number, y: number): Promise<Probe | null> {
    const rays = cameraRays(this.camera, this.canvas.width, this.canvas.height);
    const d = pixelDirection(rays, x, y), o = this.camera.position, layer = this.layer;
    const hit = await this.castRays(new Float32Array([...o, ...d, 0, Infinity]));
    if (hit.length < HIT_WORDS || !Number.isFinite(hit[0]!)) return null;
    const values = Array.from(hit.subarray(9, 9 + Math.min(3, layer?.meta.channels ?? 0)), (v) =>
      layer && layer.meta.hi > layer.meta.lo ? layer.meta.lo + v * (layer.meta.hi - layer.meta.lo) : v);
    return { position: this.toScan(add(o, scale(d, hit[0]!))), normal: [hit[1]!, hit[2]!, hit[3]!],
             leaf: hit[6]!, values };
  }

  toScan = (p: Vec): Vec => add(p, this.meta.shift as Vec);
  toStored = (p: Vec): Vec => sub(p, this.meta.shift as Vec);

  /** Where a point of the scan is on the canvas, in its pixels; null: behind the camera. */
  project(point: Vec): [number, number] | null {
    const rays = cameraRays(this.camera, this.canvas.width, this.canvas.height);
    const p = sub(this.toStored(point), this.camera.position);
    const forward = normalize(sub(this.camera.focalPoint, this.camera.position)), depth = dot(p, forward);
    if (!(depth > 0)) return null;
    const q = sub(scale(p, 1 / depth), rays.corner), pixel = length(rays.right);
    return [dot(q, rays.right) / (pixel * pixel), dot(q, rays.down) / (pixel * pixel)];
  }

  // --- what people do

  /** About the pivot: `azimuth` about the scan's up, `elevation` about the camera's right; radians. */
  orbit(azimuth: number, elevation: number): void {
    const axis = this.meta.up as Vec, camera = this.camera;
    let back = normalize(sub(camera.position, camera.focalPoint));
    const right = normalize(cross(camera.up, back));
    const tilted = rotate(back, right, -elevation);
    const steep = Math.abs(dot(tilted, axis));
    const tilt = steep < STEEPEST || steep < Math.abs(dot(back, axis)) ? -elevation : 0;
    const turn = (v: Vec): Vec => rotate(rotate(v, right, tilt), axis, azimuth);
    this.setCamera({ ...camera, position: add(this.pivot, turn(sub(camera.position, this.pivot))),
                     focalPoint: add(this.pivot, turn(sub(camera.focalPoint, this.pivot))),
                     up: turn(camera.up) }, this.pivot);
  }

  /** The surface at the focal point follows by so many pixels of the canvas. */
  pan(dx: number, dy: number): void {
    const camera = this.camera, back = sub(camera.position, camera.focalPoint);
    const pixel = (2 * Math.tan((camera.viewAngle * Math.PI) / 360) * length(back)) / this.canvas.height;
    const right = normalize(cross(camera.up, back)), up = normalize(cross(back, right));
    const by = add(scale(right, -dx * pixel), scale(up, dy * pixel));
    this.setCamera({ ...camera, position: add(camera.position, by), focalPoint: add(camera.focalPoint, by) },
                   this.pivot);
  }

  /** The distance to the focal point becomes `factor` of what it is. */
  zoom(factor: number): void {
    const camera = this.camera, back = sub(camera.position, camera.focalPoint);
    const size = length(sub(this.meta.bounds.hi as Vec, this.meta.bounds.lo as Vec)) || 1;
    const distance = Math.min(1e3 * size, Math.max(1e-5 * size, length(back) * factor));
    this.setCamera({ ...camera,
                     position: add(camera.focalPoint, scale(normalize(back), distance)) }, this.pivot);
  }

  /** The camera turns about the surface at that place from now on, and comes no nearer than it. */
  async setPivot(x: number, y: number): Promise<boolean> {
    const found = await this.probe(x, y);
    if (!found) return false;
    const pivot = this.toStored(found.position), camera = this.camera;
    const forward = normalize(sub(camera.focalPoint, camera.position));
    const depth = dot(sub(pivot, camera.position), forward);
    this.setCamera({ ...camera, focalPoint: add(camera.position, scale(forward, depth)) }, pivot);
    return true;
  }
}
