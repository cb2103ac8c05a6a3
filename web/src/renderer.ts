// What a page draws with, whichever way it is done.
import type { CameraRays } from "./camera";
import type { LevelData } from "./level";
import type { LayerMeta, LevelMeta } from "./page";

export interface Shown {
  meta: LevelMeta;
  data: LevelData;
}

export interface ShownLayer {
  index: number; // of the level's layers
  meta: LayerMeta;
  lo: number; // that colours stand for
  hi: number;
}

/** One sample of a picture. */
export interface Sample {
  rays: CameraRays;
  offset: [number, number]; // in the pixel
  weight: number;
  kept: number; // of what was accumulated before; 0: it is the first
  number: number;
  occlusion: boolean; // shadows and ambient occlusion, by a ray each
  up: [number, number, number];
}

/** How far apart samples are at distance 1: what textures are averaged over. */
export const spreadOf = ({ rays, weight }: Sample): number => Math.hypot(...rays.down) * Math.sqrt(weight);

export interface Renderer {
  readonly name: string;
  readonly canvas: HTMLCanvasElement;
  /** Has the shaders for such a level compiled, while it is decoded. */
  warm(meta: LevelMeta, layer: ShownLayer | null): void;
  setLevel(shown: Shown): void;
  setLayer(layer: ShownLayer | null): void;
  /** 8 numbers a ray: origin, direction, tmin, tmax. Of each 12: t (Infinity: none), normal, u, v, leaf (-1), flags, steps, values. */
  castRays(rays: Float32Array): Promise<Float32Array>;
  /** Begins a sample of width x height pixels; work() goes on with it. */
  begin(sample: Sample): void;
  /** Does about so much of the sample as fits the milliseconds; true when it is done. */
  work(milliseconds: number): Promise<boolean>;
  /** Onto the canvas, over a background of sRGB in [0, 1]. */
  present(background: [number, number, number]): void;
  /** The accumulated picture: sRGB and straight alpha, 8 bits, row by row from the top. */
  pixels(): Promise<Uint8ClampedArray>;
  dispose(): void;
}

export const HIT_WORDS = 12;
