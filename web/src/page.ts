// What a page holds beside its code: a description of the pair as JSON, and one compressed block a level.

import type { Lattice } from "./codec";

export interface LayerMeta {
  name: string;
  channels: number;
  lo: number;
  hi: number; // equal to lo: values are as they are stored
}

/** Of textured scans: sRGB, which is the surface's colour (docs/file_format.md). */
export const isTexture = (layer: LayerMeta | undefined): boolean => layer?.name === "texture" && layer.channels === 3;

/** A level's block is its chunks, one after the other. */
export interface LevelMeta {
  name: string;
  error: number; // that was asked for, of the diagonal; 0: none
  reached: number;
  leaves: number;
  tiles: number; // leaves that are height fields; the others hold primitives
  texels: number; // of the tiles
  vertices: number;
  triangles: number; // 0: the primitives are discs, one a vertex
  discs: boolean;
  colors: boolean;
  normals: boolean; // of the tiles; else they are those of the heights
  lattice: Lattice;
  bounds: { lo: number[]; hi: number[] };
  layers: LayerMeta[];
  bytes: number; // inflated
  crc: number; // of these
  chunks: Record<string, number>; // bytes of each, in order
}

export interface PageMeta {
  name: string;
  units: string;
  shift: number[]; // the file's coordinates = those here + shift
  up: number[];
  bounds: { lo: number[]; hi: number[] };
  source: string;
  primitives: number; // of the scan
  levels: LevelMeta[]; // coarsest first
}

export function readMeta(): PageMeta {
  return JSON.parse(document.getElementById("rbvh-meta")!.textContent!) as PageMeta;
}

export const levelText = (index: number): string | null =>
  document.getElementById(`rbvh-level-${index}`)?.textContent ?? null;
