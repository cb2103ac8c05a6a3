// The shaders of the WebGL2 renderers, put together.
import trace from "./trace.glsl";
import surface from "./surface.glsl";
import { isTexture } from "./page";
import type { LevelMeta } from "./page";
import type { ShownLayer } from "./renderer";

/** How a shader traverses the hierarchy. */
export const TRAVERSALS = ["short-stack", "trail", "parent-link"] as const;
export type Traversal = (typeof TRAVERSALS)[number];

/** What shaders are made for. */
export interface Kind {
  traversal: Traversal;
  tiles: boolean;
  discs: boolean;
  colors: boolean;
  layer: number; // its channels; 0: none
  texture: boolean; // the layer is the surface's own colour
}

export const kindOf = (traversal: Traversal, meta: LevelMeta, layer: ShownLayer | null): Kind =>
  ({ traversal, tiles: meta.tiles > 0, discs: meta.discs, colors: meta.colors, layer: layer?.meta.channels ?? 0, texture: isTexture(layer?.meta) });

const head = "#version 300 es\n";
const tracing = (kind: Kind): string => {
  const { traversal, tiles, discs, colors, layer, texture } = kind;
  const words = { TRAVERSAL: TRAVERSALS.indexOf(traversal), TILES: +tiles, DISCS: +discs, COLORS: +colors, LAYER: layer, TEXTURE: +texture };
  return head + Object.entries(words).map(([name, value]) => "#define " + name + " " + value + "\n").join("") + trace + surface;
};

/** A triangle that covers everything. */
export const COVER = `${head}void main() {
  gl_Position = vec4(vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0), 0.0, 1.0);
}`;

/** A camera's rays; row 0 of the target is the picture's top row. */
const camera = `
uniform vec3 camPosition, camCorner, camRight, camDown;
uniform vec2 camOffset;
vec3 pixelDirection(vec2 pixel) {
  vec2 p = pixel + camOffset;
  return normalize(camCorner + camRight * p.x + camDown * p.y);
}
vec2 thisPixel() { return floor(gl_FragCoord.xy); }
`;

/** Turned to the viewer, as pipeline/render/shade.cpp does. */
const toViewer = `
layout(location = 0) out uvec4 outNormal;  // t, and the normal as it is shaded
layout(location = 1) out uvec4 outColor;   // albedo, leaf
const vec3 BACK_TINT = vec3(0.55, 0.60, 0.70);
void writeSurface(vec3 view) {
  Surface s = surfaceAt();
  bool behind = dot(s.geometric, view) < 0.0;
  vec3 n = behind ? -s.smooth_ : s.smooth_;
  float facing = dot(n, view);
  if (facing < 0.0) n = normalize(n - view * facing);
  outNormal = uvec4(floatBitsToUint(found.t), floatBitsToUint(n));
  outColor = uvec4(floatBitsToUint(behind ? s.color * BACK_TINT : s.color), found.leaf);
}
`;

export const primaryPass = (kind: Kind): string => `${tracing(kind)}${camera}${toViewer}
void main() {
  vec3 d = pixelDirection(thisPixel());
  castRay(camPosition, d, 0.0, FAR, false);
  outNormal = uvec4(0u);
  outColor = uvec4(0u, 0u, 0u, NONE);
  if (found.id != NONE) writeSurface(-d);
}`;

/** What passes that find primary hits in another way are made of. */
export const primaryPieces = (kind: Kind) => ({ tracing: tracing(kind), camera, toViewer });

/** Rays from a texture, two texels each: origin, tmin; direction, tmax. */
export const raysPass = (kind: Kind): string => `${tracing(kind)}
uniform usampler2D rays;
uniform int rayCount;
layout(location = 0) out uvec4 outHit;    // t, normal
layout(location = 1) out uvec4 outPlace;  // u, v, leaf, flags and steps
layout(location = 2) out uvec4 outValues; // of the layer
void main() {
  uint i = uint(gl_FragCoord.y) * 1024u + uint(gl_FragCoord.x);
  outHit = uvec4(0u);
  outPlace = uvec4(0u, 0u, NONE, 0u);
  outValues = uvec4(0u);
  if (i >= uint(rayCount)) return;
  vec4 o = float4(rays, 2u * i), d = float4(rays, 2u * i + 1u);
  castRay(o.xyz, d.xyz, o.w, d.w, false);
  outPlace.w = steps << 8;
  if (found.id == NONE) return;
  Surface s = surfaceAt();
  uint flags = (dot(s.geometric, d.xyz) > 0.0 ? 1u : 0u) | ((found.id & TILE) == 0u ? 2u : 0u);
  outHit = uvec4(floatBitsToUint(found.t), floatBitsToUint(s.geometric));
  outPlace = uvec4(floatBitsToUint(s.uv), found.leaf, flags | (steps << 8));
  outValues = floatBitsToUint(s.values);
}`;

/** Of each pixel's hit: how much of the key light and of the sky it sees, by one ray each. */
export const occlusionPass = (kind: Kind): string => `${tracing(kind)}${camera}
uniform usampler2D gNormal;
uniform vec3 keyDirection;
uniform float skyDistance, lift;
uniform uint sampleNumber;
layout(location = 0) out uvec4 outLight;  // key, sky
uint hash(uint n) {
  n = (n ^ (n >> 16)) * 0x7feb352du;
  n = (n ^ (n >> 15)) * 0x846ca68bu;
  return n ^ (n >> 16);
}
vec2 random(uint salt) {
  uvec2 p = uvec2(gl_FragCoord.xy);
  uint seed = hash(p.x + hash(p.y + hash(salt)));
  // Golden-ratio steps from sample to sample, from a start of the pixel's own.
  vec2 start = vec2(float(seed & 65535u), float(seed >> 16)) / 65536.0;
  return fract(start + float(sampleNumber) * vec2(0.7548776662466927, 0.5698402909980532));
}
void frame(vec3 n, out vec3 x, out vec3 y) {
  float s = n.z < 0.0 ? -1.0 : 1.0, a = -1.0 / (s + n.z), b = n.x * n.y * a;
  x = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
  y = vec3(b, s + n.y * n.y * a, -n.y);
}
void main() {
  uvec4 g = texelFetch(gNormal, ivec2(gl_FragCoord.xy), 0);
  outLight = uvec4(floatBitsToUint(vec2(1.0)), 0u, 0u);
  float t = uintBitsToFloat(g.x);
  if (t == 0.0) return;
  vec3 n = uintBitsToFloat(g.yzw), d = pixelDirection(thisPixel());
  vec3 p = camPosition + d * (t * (1.0 - 1e-5)) + n * lift, x, y;
  vec2 r = random(1u);
  frame(keyDirection, x, y);
  float angle = 6.2831853 * r.x, radius = 0.14 * sqrt(r.y);
  vec3 toKey = normalize(keyDirection + radius * (cos(angle) * x + sin(angle) * y));
  float key = 1.0;
  if (dot(toKey, n) > 0.0) {
    castRay(p, toKey, 0.0, FAR, true);
    if (found.id != NONE) key = 0.0;
  }
  r = random(2u);
  frame(n, x, y);
  angle = 6.2831853 * r.x;
  vec3 toSky = sqrt(r.y) * (cos(angle) * x + sin(angle) * y) + n * sqrt(max(0.0, 1.0 - r.y));
  castRay(p, toSky, 0.0, skyDistance, true);
  outLight = uvec4(floatBitsToUint(key), floatBitsToUint(found.id != NONE ? 0.0 : 1.0), 0u, 0u);
}`;

/** The look of pipeline/render/shade.cpp, added to what was accumulated. */
export const shadePass = `${head}
precision highp float;
precision highp int;
precision highp usampler2D;
uniform usampler2D gNormal, gColor, gLight, accumulated;
uniform vec3 skyUp, keyDirection;
uniform float pixelAngle, weight, kept;
uniform ivec3 radii;
uniform bool occluded;
${camera}
layout(location = 0) out uvec4 outSum;
const vec3 KEY = vec3(0.92, 0.88, 0.82), SKY = vec3(0.34, 0.39, 0.47), GROUND = vec3(0.08, 0.07, 0.06);
float halfInverse(ivec2 p) {
  float t = uintBitsToFloat(texelFetch(gNormal, p, 0).x);
  return t > 0.0 ? 0.5 / t : 0.0;
}
float relief(ivec2 p, float t, int radius) {
  ivec2 size = textureSize(gNormal, 0);
  float sum = 0.0;
  for (int k = 0; k < 4; ++k) {
    ivec2 step = radius * (k == 0 ? ivec2(1, 0) : k == 1 ? ivec2(0, 1) : k == 2 ? ivec2(1, 1) : ivec2(1, -1));
    ivec2 a = p + step, b = p - step;
    if (any(lessThan(min(a, b), ivec2(0))) || any(greaterThanEqual(max(a, b), size))) continue;
    float ha = halfInverse(a), hb = halfInverse(b);
    if (ha == 0.0 || hb == 0.0) continue;
    sum += clamp((ha + hb - 1.0 / t) * t / (pixelAngle * float(radius)), -1.0, 1.0);
  }
  return sum / 4.0;
}
void main() {
  ivec2 p = ivec2(gl_FragCoord.xy);
  vec4 sum = kept * uintBitsToFloat(texelFetch(accumulated, p, 0));
  uvec4 g = texelFetch(gNormal, p, 0);
  float t = uintBitsToFloat(g.x);
  if (t > 0.0) {
    vec3 n = uintBitsToFloat(g.yzw), view = -pixelDirection(thisPixel());
    vec3 albedo = uintBitsToFloat(texelFetch(gColor, p, 0).xyz);
    vec2 light = occluded ? uintBitsToFloat(texelFetch(gLight, p, 0).xy) : vec2(1.0);
    float facing = clamp(dot(n, view), 0.0, 1.0), key = max(0.0, dot(n, keyDirection)) * light.x;
    vec3 sky = mix(GROUND, SKY, 0.5 + 0.5 * dot(n, skyUp)) * light.y;
    float gloss = 0.06 * pow(max(0.0, dot(n, normalize(keyDirection + view))), 24.0) * light.x;
    float away = 1.0 - facing;
    vec3 color = albedo * (KEY * key + sky + 0.10 * facing) + sky * (0.16 * away * away * away) + KEY * gloss;
    float bend = clamp(relief(p, t, radii.x) + relief(p, t, radii.y) + relief(p, t, radii.z), -1.0, 1.0);
    color *= bend > 0.0 ? 1.0 - 0.45 * bend : 1.0 - 0.25 * bend;
    sum += vec4(clamp(color, 0.0, 1.0), 1.0) * weight;
  }
  outSum = floatBitsToUint(sum);
}`;

/** From light to bytes: alone with straight alpha, or upside down over a background. */
export const presentPass = `${head}
precision highp float;
precision highp int;
precision highp usampler2D;
uniform usampler2D accumulated;
uniform vec2 targetSize;
uniform vec3 background;
uniform bool onScreen;
layout(location = 0) out vec4 outPixel;
vec3 toSrgb(vec3 c) {
  return mix(1.055 * pow(max(c, 1e-6), vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}
void main() {
  ivec2 size = textureSize(accumulated, 0);
  if (!onScreen) {
    vec4 sum = uintBitsToFloat(texelFetch(accumulated, ivec2(gl_FragCoord.xy), 0));
    outPixel = vec4(sum.w > 0.0 ? toSrgb(clamp(sum.xyz / sum.w, 0.0, 1.0)) : vec3(0.0), sum.w);
    return;
  }
  vec2 uv = vec2(gl_FragCoord.x, targetSize.y - gl_FragCoord.y) / targetSize * vec2(size) - 0.5;
  ivec2 p = ivec2(floor(uv));
  vec2 f = size == ivec2(targetSize) ? vec2(0.0) : uv - vec2(p);
  if (size == ivec2(targetSize)) p = ivec2(floor(uv + 0.5));
  vec4 sum = vec4(0.0);
  for (int k = 0; k < 4; ++k) {
    ivec2 corner = ivec2(k & 1, k >> 1);
    vec2 w = mix(1.0 - f, f, vec2(corner));
    sum += w.x * w.y * uintBitsToFloat(texelFetch(accumulated, clamp(p + corner, ivec2(0), size - 1), 0));
  }
  outPixel = vec4(toSrgb(sum.xyz / max(sum.w, 1e-6)) * sum.w + (1.0 - sum.w) * background, 1.0);
}`;
