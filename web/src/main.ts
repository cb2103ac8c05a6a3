// A page's only script. In a worker it decodes levels; in the page it does all else.
import type { Camera, Vec } from "./camera";
import { decodeLevel } from "./level";
import type { LevelData } from "./level";
import { levelText, readMeta } from "./page";
import type { LevelMeta } from "./page";
import { TRAVERSALS } from "./passes";
import type { Traversal } from "./passes";
import type { Renderer } from "./renderer";
import { HIT_WORDS } from "./renderer";
import { Ui, cameraLink, cameraOfLink, say } from "./ui";
import { HybridRenderer } from "./hybrid";
import { Viewer } from "./viewer";
import { GlRenderer } from "./webgl";
import { hasWebGpu, makeGpuRenderer } from "./webgpu";

interface Task {
  index: number;
  meta: LevelMeta;
  text: string;
}
type Result = { index: number; data: LevelData } | { index: number; error: string };

const MOST_HERE = 1 << 20; // bytes of a level

const message = (error: unknown): string => ((error as Error).message ?? String(error)).trim().split("\n")[0]!.replace(/\.$/, "");

function runWorker(): void {
  onmessage = async (event: MessageEvent<Task>) => {
    const { index, meta, text } = event.data;
    try {
      const data = await decodeLevel(meta, text);
      const buffers = [data.nodes, data.vertices, data.prims, data.tiles, data.heights, data.normals, data.colors,
                       ...data.layers.flatMap((layer) => [layer.leaves, layer.values])].map((a) => a.buffer);
      (postMessage as (message: Result, transfer: Transferable[]) => void)({ index, data }, [...new Set(buffers)] as ArrayBuffer[]);
    } catch (error) {
      postMessage({ index, error: message(error) } satisfies Result);
    }
  };
}

const here = (task: Task): Promise<LevelData> => decodeLevel(task.meta, task.text);

/** Decodes in a worker made of this script; without workers, here. */
function decoder(): (task: Task) => Promise<LevelData> {
  let worker: Worker;
  try {
    const text = document.getElementById("rbvh-script")!.textContent!;
    worker = new Worker(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
  } catch {
    return here;
  }
  let broken = false;
  return (task) => broken ? here(task) : new Promise((resolve, reject) => {
    worker.onmessage = (event: MessageEvent<Result>) =>
      "data" in event.data ? resolve(event.data.data) : reject(new Error(event.data.error));
    worker.onerror = (event) => {
      event.preventDefault();
      broken = true;
      here(task).then(resolve, reject);
    };
    worker.postMessage(task);
  });
}

/** A level's block as text. While the page is still being parsed, what follows a block says that it is whole. */
async function whenParsed(index: number): Promise<string> {
  const isWhole = document.getElementById(`rbvh-level-${index}`)?.nextElementSibling;
  if (document.readyState === "loading" && !isWhole)
    await new Promise((done) => addEventListener("DOMContentLoaded", done, { once: true }));
  const text = levelText(index);
  if (text === null) throw new Error("it is cut: its data are missing");
  return text;
}

async function makeRenderer(name: string, canvas: HTMLCanvasElement, traversal: Traversal,
                            onFailed: (error: unknown) => void): Promise<Renderer> {
  if (name === "webgpu") return makeGpuRenderer(canvas, traversal, onFailed);
  if (name === "webgl2") return new GlRenderer(canvas, traversal);
  if (name === "hybrid") return new HybridRenderer(canvas, traversal);
  throw new Error(`there is no renderer ${name}`);
}

async function main(): Promise<void> {
  const meta = readMeta(), query = new URLSearchParams(location.search);
  const traversal = TRAVERSALS.find((t) => t === query.get("traversal")) ?? TRAVERSALS[0];
  const viewer = new Viewer(meta, document.querySelector("canvas")!);
  const make = (name: string, on: HTMLCanvasElement): Promise<Renderer> => {
    on.addEventListener("webglcontextlost", (event) => {
      if (viewer.canvas !== on) return;
      event.preventDefault();
      viewer.setRenderer(null);
      say("The graphics device was lost; waiting for it");
    }, { once: true });
    on.addEventListener("webglcontextrestored", () => void make(name, on).then((renderer) => {
      viewer.setRenderer(renderer);
      say("");
    }), { once: true });
    return makeRenderer(name, on, traversal, (error) => viewer.canvas === on && viewer.onFailed(error));
  };
  /** On a canvas of its own: one that had another kind of context cannot get a new one. */
  const choose = (name: string): Promise<void> => viewer.exclusive(async () => {
    const old = viewer.renderer, fresh = viewer.canvas.cloneNode() as HTMLCanvasElement;
    const renderer = await make(name, fresh);
    viewer.canvas.replaceWith(fresh);
    viewer.setRenderer(renderer);
    old?.dispose();
  });
  const page = { renderers: ["webgl2", "hybrid", ...(hasWebGpu() ? ["webgpu"] : [])], chooseRenderer: choose };
  const ui = new Ui(viewer, page);
  const linked = cameraOfLink(viewer, location.hash);
  if (linked) viewer.setCamera(linked);
  else ui.reset();
  // While the renderer's shaders are compiled, the coarsest level is decoded: if it is small, here, as a worker takes as long to begin.
  let inWorker: ReturnType<typeof decoder> | null = null;
  const decode = async (index: number): Promise<LevelData> => {
    const level = meta.levels[index]!, task = { index, meta: level, text: await whenParsed(index) };
    return index === 0 && level.bytes <= MOST_HERE ? here(task) : (inWorker ??= decoder())(task);
  };
  const asked = query.get("renderer"), still = document.getElementById("still");
  const left = new Set([...(asked ? [asked] : []), "webgl2", ...(hasWebGpu() ? ["webgpu"] : []), "hybrid"]);
  let choosing = false;
  /** The first of those that have not failed; where all have, the thumbnail is back. */
  const chooseNext = async (why: unknown): Promise<void> => {
    choosing = true;
    for (const name of left) {
      try {
        await choose(name);
        choosing = false;
        return why ? say(`${message(why)}; ${name} draws instead`) : undefined;
      } catch (error) {
        left.delete(name);
        why ??= error;
      }
    }
    viewer.setRenderer(null);
    viewer.canvas.hidden = true;
    if (still) document.getElementById("stage")!.before(still);
    say(`This browser cannot draw the scan: ${message(why)}.${still ? " The picture is a still." : ""}`);
  };
  viewer.onFailed = (error) => {
    if (choosing || viewer.canvas.getContext("webgl2")?.isContextLost()) return;
    const { name } = viewer.renderer!;
    console.warn(error);
    left.delete(name);
    void chooseNext(`${name} failed: ${message(error)}`);
  };
  const chosen = chooseNext(null), coarsest = decode(0);
  coarsest.catch(() => undefined);
  await chosen;
  if (!viewer.renderer) return;

  const decoded = meta.levels.map(() => {
    let done!: () => void, failed!: (error: unknown) => void;
    const promise = new Promise<void>((resolve, reject) => ([done, failed] = [resolve, reject]));
    promise.catch(() => undefined);
    return { promise, done, failed };
  });
  expose(viewer, ui, decoded.map((d) => d.promise), choose);
  void viewer.first.then(() => still?.remove());
  for (const index of meta.levels.keys()) {
    try {
      // The first picture has both cores of a small machine; pages that are not seen draw none.
      if (index === 1) await Promise.race([viewer.first, new Promise((done) => setTimeout(done, 2000))]);
      viewer.add(index, await (index === 0 ? coarsest : decode(index)));
      decoded[index]!.done();
    } catch (error) {
      say(`This page is broken: ${message(error)}`);
      decoded[index]!.failed(error);
    }
  }
}

/** What scripts drive: coordinates are the scan's own. */
function expose(viewer: Viewer, ui: Ui, decoded: Promise<void>[], chooseRenderer: (name: string) => Promise<void>): void {
  const { meta } = viewer;
  const index = (name: string): number => {
    const found = meta.levels.findIndex((level) => level.name === name);
    if (found < 0) throw new Error(`there is no level ${name}`);
    return found;
  };
  const api = {
    meta,
    ui,
    viewer,
    /** The coarsest level can be cast at. */
    ready: decoded[0]!,
    /** All levels can. */
    loaded: Promise.all(decoded),
    async setLevel(name: string): Promise<void> {
      const wanted = index(name);
      await decoded[wanted];
      ui.setLevel(wanted);
    },
    async setLayer(name: string | null): Promise<void> {
      const found = meta.levels[viewer.level]!.layers.findIndex((layer) => layer.name === name);
      if (name !== null && found < 0) throw new Error(`there is no layer ${name}`);
      ui.setLayer(found);
    },
    setRenderer: chooseRenderer,
    setCamera(camera: { position: Vec; focalPoint: Vec; viewUp: Vec; viewAngle?: number }): void {
      viewer.setCamera({ position: viewer.toStored(camera.position), focalPoint: viewer.toStored(camera.focalPoint),
                         up: camera.viewUp, viewAngle: camera.viewAngle ?? 30 });
    },
    getCamera(): { position: Vec; focalPoint: Vec; viewUp: Vec; viewAngle: number } {
      const { position, focalPoint, up, viewAngle }: Camera = viewer.camera;
      return { position: viewer.toScan(position), focalPoint: viewer.toScan(focalPoint), viewUp: up, viewAngle };
    },
    link: () => cameraLink(viewer),
    /**
     * `width` numbers a ray: 6 (origin, direction) or 8 (and tmin, tmax). Resolves to 8 a ray, as `rbvh trace`
     * writes them: t (Infinity: none), normal, u, v, leaf (-1: none), flags.
     */
    async castRays(rays: Float32Array | Float64Array, width = 6): Promise<Float32Array> {
      if ((width !== 6 && width !== 8) || rays.length % width !== 0) throw new Error("rays are 6 or 8 numbers each");
      const count = rays.length / width, inner = new Float32Array(8 * count);
      for (let i = 0; i < count; ++i) {
        for (let k = 0; k < width; ++k)
          inner[8 * i + k] = rays[width * i + k]! - (k < 3 ? meta.shift[k]! : 0);
        if (width === 6) inner[8 * i + 7] = Infinity;
      }
      const hits = await viewer.castRays(inner), out = new Float32Array(8 * count);
      for (let i = 0; i < count; ++i)
        out.set(hits.subarray(HIT_WORDS * i, HIT_WORDS * i + 8), 8 * i);
      return out;
    },
    /** The look of `rbvh render --quick`: sRGB, straight alpha, row by row from the top. */
    async render(width: number, height: number, samples = 4): Promise<ImageData> {
      return new ImageData((await viewer.render(width, height, samples)) as Uint8ClampedArray<ArrayBuffer>, width, height);
    },
    stats: () => ({
      renderer: viewer.renderer?.name, firstPicture: viewer.firstPicture, rate: viewer.rate, frames: viewer.frames,
      scale: viewer.scale, samples: viewer.done,
      levels: viewer.levels.map((level) => level && {
        seconds: level.seconds, depth: level.depth,
        bytes: [level.nodes, level.vertices, level.prims, level.tiles, level.heights, level.normals, level.colors,
                ...level.layers.flatMap((l) => [l.leaves, l.values])].reduce((sum, a) => sum + a.byteLength, 0) }),
    }),
  };
  (globalThis as unknown as { rbvh: typeof api }).rbvh = api;
}

if (typeof document === "undefined") runWorker();
else main().catch((error: unknown) => console.warn(message(error)));
