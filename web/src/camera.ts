// Cameras in doubles, in the pair's stored coordinates, and their rays, as pipeline/render/camera.cpp has
// them.

export type Vec = [number, number, number];

export const add = (a: Vec, b: Vec): Vec => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec, b: Vec): Vec => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Vec, s: number): Vec => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a: Vec): number => Math.sqrt(dot(a, a));
export const normalize = (a: Vec): Vec => scale(a, 1 / (length(a) || 1));
export const cross = (a: Vec, b: Vec): Vec =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Rodrigues' rotation about a unit vector, in radians. */
export function rotate(v: Vec, axis: Vec, angle: number): Vec {
  const c = Math.cos(angle), s = Math.sin(angle);
  return add(add(scale(v, c), scale(cross(axis, v), s)), scale(axis, dot(axis, v) * (1 - c)));
}

export interface Camera {
  position: Vec;
  focalPoint: Vec;
  up: Vec;
  viewAngle: number; // degrees, vertical, full angle
}

export interface CameraRays {
  position: Vec;
  forward: Vec; // unit
  corner: Vec;
  right: Vec; // one pixel
  down: Vec; // one pixel
  width: number;
  height: number;
}

export function cameraRays(camera: Camera, width: number, height: number): CameraRays {
  const forward = normalize(sub(camera.focalPoint, camera.position));
  const right = normalize(cross(forward, camera.up)), up = cross(right, forward);
  const half = Math.tan((camera.viewAngle * Math.PI) / 360), pixel = (2 * half) / height;
  return {
    position: camera.position,
    forward,
    corner: add(sub(forward, scale(right, (pixel * width) / 2)), scale(up, half)),
    right: scale(right, pixel),
    down: scale(up, -pixel),
    width,
    height,
  };
}

/** Through a place of the picture, in pixels from its top left corner. */
export const pixelDirection = (rays: CameraRays, x: number, y: number): Vec =>
  normalize(add(rays.corner, add(scale(rays.right, x), scale(rays.down, y))));

/** Where the light of the shaded look comes from. */
export function keyDirection(rays: CameraRays, offset: [number, number]): Vec {
  const forward = pixelDirection(rays, Math.floor(rays.width / 2) + offset[0],
                                 Math.floor(rays.height / 2) + offset[1]);
  const up = scale(normalize(rays.down), -1), right = normalize(rays.right);
  return normalize(sub(add(scale(forward, -0.75), scale(up, 0.5)), scale(right, 0.4)));
}

/** Hammersley's points in the pixel; the centre for a single one. */
export function sampleOffset(sample: number, samples: number): [number, number] {
  let y = 0, digit = 0.5, cell = 1;
  for (let bits = sample; bits > 0; bits >>= 1, digit /= 2) if (bits & 1) y += digit;
  while (cell * samples > 1) cell /= 2;
  return [(sample + 0.5) / samples, y + cell / 2];
}

export interface Box {
  lo: Vec;
  hi: Vec;
}

/** From `back` of the box, as near as shows all of it. */
export function fitCamera(box: Box, back: Vec, up: Vec, viewAngle: number, aspect: number): Camera {
  const right = normalize(cross(up, back)), over = cross(back, right);
  const center = scale(add(box.lo, box.hi), 0.5);
  const slope = Math.tan((viewAngle * Math.PI) / 360) / 1.04;
  let distance = 0;
  const fit = (axis: Vec, most: number): void => {
    let plus = -Infinity, minus = -Infinity;
    for (let i = 0; i < 8; ++i) {
      const corner: Vec = [i & 1 ? box.hi[0] : box.lo[0], i & 2 ? box.hi[1] : box.lo[1],
                           i & 4 ? box.hi[2] : box.lo[2]];
      const p = sub(corner, center), x = dot(p, axis), z = dot(p, back);
      plus = Math.max(plus, x / most + z);
      minus = Math.max(minus, -x / most + z);
    }
    distance = Math.max(distance, plus, minus);
  };
  fit(right, slope * aspect);
  fit(over, slope);
  return { position: add(center, scale(back, distance || 1)), focalPoint: center, up: over, viewAngle };
}

/** As fitCamera(), turned by azimuth and elevation (degrees) from the front. */
export function viewFrom(box: Box, upAxis: Vec, azimuth: number, elevation: number, viewAngle: number,
                         aspect: number): Camera {
  const right: Vec = Math.abs(upAxis[0]) > 0.5 ? [0, 1, 0] : [1, 0, 0];
  let back = normalize(cross(right, upAxis)), side = normalize(cross(upAxis, back));
  back = rotate(back, upAxis, (azimuth * Math.PI) / 180);
  side = rotate(side, upAxis, (azimuth * Math.PI) / 180);
  const tilt = (-elevation * Math.PI) / 180;
  back = rotate(back, side, tilt);
  return fitCamera(box, back, rotate(upAxis, side, tilt), viewAngle, aspect);
}
