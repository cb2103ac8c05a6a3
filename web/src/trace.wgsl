// What trace.glsl does, in WGSL; with surface.wgsl the passes of passes.ts as compute shaders: a work-group
// of 8 x 8 pixels. What stands between #if, #else and #endif is there for what a level holds, as in trace.glsl, and for one
// pass (webgpu.ts): software renderers compile all that is there. A level's words lie in two buffers, from the offsets in `u` on.
struct Uniforms {
  sceneLo: vec3f, nodes: u32,
  sceneHi: vec3f, prims: u32,
  camPosition: vec3f, vertices: u32,
  camCorner: vec3f, tiles: u32,
  camRight: vec3f, layerLeaves: u32,
  camDown: vec3f, normals: u32,
  keyDirection: vec3f, heights: u32,
  skyUp: vec3f, colors: u32,
  camOffset: vec2f, layerRange: vec2f,
  background: vec3f, layerValues: u32,
  size: vec2u, target_: vec2u,
  radii: vec3i, row: u32,
  layerInRange: u32, sampleNumber: u32, occluded: u32, rayCount: u32,
  skyDistance: f32, lift: f32, pixelAngle: f32, weight: f32,
  kept: f32, spread: f32,
}
@group(0) @binding(0) var<uniform> u: Uniforms;
@group(0) @binding(1) var<storage, read> blocks: array<vec4u>;
@group(0) @binding(2) var<storage, read> texels: array<u32>;
@group(0) @binding(3) var<storage, read_write> surfaces: array<vec4u>;  // t, normal | albedo, leaf
@group(0) @binding(4) var<storage, read_write> lights: array<vec2f>;    // key, sky
@group(0) @binding(5) var<storage, read_write> sums: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> rays: array<vec4f>;      // two a ray
@group(0) @binding(7) var<storage, read_write> hits: array<vec4u>;      // three a ray

#if CASTS
const FAR = 3e38;
const NONE = 0xffffffffu;
const LEAF = 0x80000000u;
const TILE = 0x40000000u;
const STACK = 8u;

fn word4(base: u32, at: u32) -> vec4u { return blocks[base + at]; }
fn float4(base: u32, at: u32) -> vec4f { return bitcast<vec4f>(blocks[base + at]); }
fn half_(base: u32, at: u32) -> u32 { return (texels[base + (at >> 1u)] >> (16u * (at & 1u))) & 65535u; }

struct Found { t: f32, id: u32, leaf: u32, uv: vec2f }

var<private> rayO: vec3f;
var<private> rayD: vec3f;
var<private> inverse: vec3f;
var<private> nearOffset: vec3f;
var<private> farOffset: vec3f;
var<private> backwards: vec3<bool>;
var<private> rayMin: f32;
var<private> longest: i32;
var<private> sheared: vec3f;
var<private> shear: vec3f;
var<private> anyHit: bool;
var<private> found: Found;
var<private> steps: u32;
var<private> enter: f32;

fn permuted(v: vec3f) -> vec3f {
  if (longest == 0) { return v.yzx; }
  if (longest == 1) { return v.zxy; }
  return v;
}

fn prepare(o: vec3f, d: vec3f, tmin: f32, tmax: f32) -> bool {
  rayO = o;
  rayD = d;
  rayMin = tmin;
  found = Found(min(tmax, FAR), NONE, NONE, vec2f(0));
  let size = abs(d);
  let most = max(size.x, max(size.y, size.z));
  if (!(most > 0.0) || most > FAR || !(tmin <= tmax)) { return false; }
  longest = select(select(2, 1, size.y >= most), 0, size.x >= most);
  sheared = permuted(o);
  let p = permuted(d);
  shear = vec3f(p.xy / p.z, 1.0 / p.z);
  let away = max(max(abs(u.sceneLo - o), abs(u.sceneHi - o)), abs(o));
  let margin = 1.2e-6 * max(away.x, max(away.y, away.z));
  let signs = select(vec3f(1), vec3f(-1), d < vec3f(0));
  let parallel = size <= vec3f(1e-18 * most);
  inverse = select(1.0 / select(d, vec3f(1), parallel), signs * (1e18 / most), parallel);
  backwards = inverse < vec3f(0);
  let outwards = select(vec3f(margin), vec3f(-margin), backwards);
  nearOffset = -(o + outwards) * inverse;
  farOffset = -(o - outwards) * inverse;
  return true;
}

fn entersBox(lo: vec3f, hi: vec3f) -> bool {
  let a = select(lo, hi, backwards) * inverse + nearOffset;
  let b = select(hi, lo, backwards) * inverse + farOffset;
  enter = max(max(a.x, a.y), max(a.z, rayMin));
  return enter <= min(min(b.x, b.y), min(b.z, found.t));
}

fn isNearer(t: f32, leaf: u32) -> bool { return t < found.t || (t == found.t && leaf < found.leaf); }

#if DISCS
fn intersectDisc(at: u32, prim: vec4u) {
  let c = float4(u.vertices, 2u * prim.x).xyz - rayO;
  let n = float4(u.vertices, 2u * prim.x + 1u);
  let slope = dot(n.xyz, rayD);
  if (slope == 0.0) { return; }
  let t = dot(c, n.xyz) / slope;
  let off = rayD * t - c;
  if (dot(off, off) > n.w * n.w || !(t >= rayMin) || !isNearer(t, prim.w)) { return; }
  let s = select(1.0, -1.0, n.z < 0.0);
  let e = -1.0 / (s + n.z);
  let f = n.x * n.y * e;
  let p = off / n.w;
  found = Found(t, at, prim.w, vec2f(p.x * (1.0 + s * n.x * n.x * e) + p.y * (s * f) - p.z * (s * n.x),
                                     p.x * f + p.y * (s + n.y * n.y * e) - p.z * n.y));
}
#else
fn intersectTriangle(at: u32, prim: vec4u) {
  let a = permuted(float4(u.vertices, 2u * prim.x).xyz) - sheared;
  let b = permuted(float4(u.vertices, 2u * prim.y).xyz) - sheared;
  let c = permuted(float4(u.vertices, 2u * prim.z).xyz) - sheared;
  let p = a.xy - shear.xy * a.z;
  let q = b.xy - shear.xy * b.z;
  let r = c.xy - shear.xy * c.z;
  let e = r.x * q.y - r.y * q.x;
  let v = p.x * r.y - p.y * r.x;
  let w = q.x * p.y - q.y * p.x;
  let sum = e + v + w;
  let inside = (e >= 0.0 && v >= 0.0 && w >= 0.0) || (e <= 0.0 && v <= 0.0 && w <= 0.0);
  if (!inside || sum == 0.0) { return; }
  let t = (e * (shear.z * a.z) + v * (shear.z * b.z) + w * (shear.z * c.z)) / sum;
  if (t >= rayMin && isNearer(t, prim.w)) { found = Found(t, at, prim.w, vec2f(v, w) / sum); }
}
#endif

#if TILES
struct Tile {
  m0: vec3f, m1: vec3f, m2: vec3f, m3: vec3f, lo: vec3f, hi: vec3f,
  width: i32, height: i32, offset: u32, leaf: u32, limit: f32, top: f32,
}

fn readTile(id: u32) -> Tile {
  let a = float4(u.tiles, 6u * id);
  let b = float4(u.tiles, 6u * id + 1u);
  let c = float4(u.tiles, 6u * id + 2u);
  let d = float4(u.tiles, 6u * id + 3u);
  let e = word4(u.tiles, 6u * id + 4u);
  let f = word4(u.tiles, 6u * id + 5u);
  return Tile(a.xyz, vec3f(a.w, b.xy), vec3f(b.zw, c.x), c.yzw, d.xyz, vec3f(d.w, bitcast<vec2f>(e.xy)),
              i32(e.z & 65535u), i32(e.z >> 16u), e.w, f.z, bitcast<f32>(f.x), bitcast<f32>(f.y));
}

fn heightAt(tile: Tile, at: i32) -> f32 { return f32(half_(u.heights, tile.offset + u32(at))); }

fn patchHeight(tile: Tile, uv: vec2f) -> f32 {
  let p = clamp(vec2i(uv), vec2i(0), vec2i(tile.width, tile.height) - 2);
  let at = p.y * tile.width + p.x;
  let a = heightAt(tile, at);
  let b = heightAt(tile, at + 1);
  let c = heightAt(tile, at + tile.width);
  let d = heightAt(tile, at + tile.width + 1);
  let f = uv - vec2f(p);
  if (min(min(a, b), min(c, d)) == 0.0) { return -1.0; }
  let h0 = a + (b - a) * f.x;
  return h0 + (c + (d - c) * f.x - h0) * f.y;
}

struct Line { t: f32, D: f32, row: i32, solid: bool }
struct GridRay {
  oMajor: f32, dMajor: f32, iMajor: f32, oMinor: f32, dMinor: f32, ow: f32, dw: f32,
  lastLine: i32, lastRow: i32, sMajor: i32, sMinor: i32,
}

fn sampleLine(tile: Tile, g: GridRay, k: i32) -> Line {
  let t = (f32(k) - g.oMajor) * g.iMajor;
  let minor = g.oMinor + g.dMinor * t;
  let row = i32(clamp(minor, 0.0, f32(g.lastRow)));
  let at = clamp(k, 0, g.lastLine) * g.sMajor + row * g.sMinor;
  let h0 = heightAt(tile, at);
  let h1 = heightAt(tile, at + g.sMinor);
  let rise = h1 - h0;
  return Line(t, (g.ow - h0) + g.dw * t - rise * (minor - f32(row)), row,
              h0 > 0.0 && h1 > 0.0 && abs(rise) <= tile.limit);
}

fn march(id: u32) {
  let tile = readTile(id);
  let o = tile.m0 * rayO.x + tile.m1 * rayO.y + tile.m2 * rayO.z + tile.m3;
  var d = tile.m0 * rayD.x + tile.m1 * rayD.y + tile.m2 * rayD.z;
  d = select(d, select(vec3f(1e-20), vec3f(-1e-20), d < vec3f(0)), abs(d) < vec3f(1e-20));
  let inv = 1.0 / d;
  let ta = -o * inv;
  let tb = (vec3f(f32(tile.width - 1), f32(tile.height - 1), tile.top + 1.0) - o) * inv;
  let tIn = min(ta, tb);
  let tOut = max(ta, tb);
  let t0 = max(max(tIn.x, tIn.y), max(tIn.z, rayMin));
  let t1 = min(min(tOut.x, tOut.y), min(tOut.z, found.t));
  if (!(t0 <= t1)) { return; }
  let alongU = abs(d.x) >= abs(d.y);
  let toward = select(d.y, d.x, alongU);
  let lines = select(tile.height, tile.width, alongU);
  var g: GridRay;
  g.oMajor = select(o.y, o.x, alongU);
  g.dMajor = max(abs(toward), 1e-8 * abs(d.z)) * select(1.0, -1.0, toward < 0.0);
  g.iMajor = 1.0 / g.dMajor;
  g.oMinor = select(o.x, o.y, alongU);
  g.dMinor = select(d.x, d.y, alongU);
  g.ow = o.z;
  g.dw = d.z;
  g.lastLine = lines - 1;
  g.lastRow = select(tile.width, tile.height, alongU) - 2;
  g.sMajor = select(tile.width, 1, alongU);
  g.sMinor = select(1, tile.width, alongU);
  let stride = select(-1, 1, g.dMajor > 0.0);
  let begin = g.oMajor + g.dMajor * t0;
  var k = i32(clamp(select(ceil(begin + 1e-3), floor(begin - 1e-3), stride > 0), 0.0, f32(lines - 1)));
  let graze = (0.05 / 8.0) * tile.limit;
  let steepest = abs(g.dw * g.iMajor) + (2.0 / 8.0) * tile.limit;
  var here = sampleLine(tile, g, k);
  var hasBefore = false;
  var before = 0.0;
  for (var n = 0; n < 65536; n++) {
    if (here.t >= t1 || k < 0 || k > g.lastLine) { return; }
    steps++;
    let there = sampleLine(tile, g, k + stride);
    var fromT = here.t;
    var fromD = here.D;
    var toT = there.t;
    var toD = there.D;
    var from_ = here.solid;
    var to = there.solid;
    let grazed = from_ && to && hasBefore && n % 15 != 0 && abs(fromD) < graze && abs(fromD) <= abs(toD) &&
                 abs(fromD) < abs(before);
    if (from_ != to && abs(select(toD, fromD, from_)) <= steepest && here.row != there.row) {
      let row = max(here.row, there.row);
      let h0 = heightAt(tile, clamp(k, 0, g.lastLine) * g.sMajor + row * g.sMinor);
      let h1 = heightAt(tile, clamp(k + stride, 0, g.lastLine) * g.sMajor + row * g.sMinor);
      let t = (f32(row) - g.oMinor) / g.dMinor;
      let along = abs(g.oMajor + g.dMajor * t - f32(k));
      if (h0 > 0.0 && h1 > 0.0 && abs(h1 - h0) <= tile.limit) {
        let D = g.ow + g.dw * t - (h0 + (h1 - h0) * along);
        if (from_) {
          toT = t;
          toD = D;
        } else {
          fromT = t;
          fromD = D;
        }
        from_ = true;
        to = true;
      }
    }
    let crossed = from_ && to && fromD * toD <= 0.0;
    if (crossed || grazed) {
      var hit = fromT;
      if (crossed) {
        let slope = (toD - fromD) / (toT - fromT);
        let secant = fromT - fromD / slope;
        let h = patchHeight(tile, o.xy + d.xy * secant);
        let newton = secant - (o.z + d.z * secant - h) / slope;
        hit = select(secant, newton, h >= 0.0 && newton >= fromT && newton <= toT);
      }
      let span = toT - fromT;
      let p = rayO + rayD * hit;
      if (hit >= rayMin && isNearer(hit, tile.leaf) && hit >= t0 - span && hit <= t1 + span &&
          all(p >= tile.lo) && all(p <= tile.hi)) {
        found = Found(hit, id | TILE, tile.leaf, vec2f(0));
        return;
      }
    }
    before = here.D;
    hasBefore = here.solid;
    here = there;
    k += stride;
  }
}

#endif

fn visitLeaf(link: u32) {
#if TILES
  if ((link & TILE) != 0u) {
    march(link & 0x3fffffffu);
    return;
  }
#endif
  let first = link & 0x7ffffffu;
  let end = first + ((link >> 27u) & 7u) + 1u;
  for (var i = first; i < end; i++) {
    steps++;
    let prim = word4(u.prims, i);
#if DISCS
    intersectDisc(i, prim);
#else
    intersectTriangle(i, prim);
#endif
    if (anyHit && found.id != NONE) { return; }
  }
}

// The three of trace.glsl.
#if LINKS
fn isSwapped(up: u32) -> bool {
  let axis = up & 3u;
  return select(select(backwards.z, backwards.y, axis == 1u), backwards.x, axis == 0u);
}

fn traverse() {
  var node = 0u;
  var state = 0u;
  loop {
    let up = word4(u.nodes, 4u * node + 1u).w;
    if (state < 2u) {
      let side = select(0u, 1u, (state == 0u) == isSwapped(up));
      let lo = word4(u.nodes, 4u * node + 2u * side);
      let hi = float4(u.nodes, 4u * node + 2u * side + 1u);
      state++;
      steps++;
      if (!entersBox(bitcast<vec3f>(lo.xyz), hi.xyz)) { continue; }
      if ((lo.w & LEAF) == 0u) {
        node = lo.w;
        state = 0u;
      } else {
        visitLeaf(lo.w);
        if (anyHit && found.id != NONE) { return; }
      }
      continue;
    }
    if (node == 0u) { return; }
    node = up >> 3u;
    let swapped = isSwapped(word4(u.nodes, 4u * node + 1u).w);
    state = select(2u, 1u, ((up & 4u) != 0u) == swapped);
  }
}

#else
fn traverse() {
  var trail = 0u;
  var level = 0x80000000u;
  var popLevel = 0u;
  var current = 0u;
#if SHORT
  var stack: array<u32, STACK>;
  var top = 0u;
  var kept = 0u;
#endif
  loop {
    var pop = false;
    if ((current & LEAF) == 0u) {
      steps++;
      let words0 = word4(u.nodes, 4u * current);
      let words2 = word4(u.nodes, 4u * current + 2u);
      let hit0 = entersBox(bitcast<vec3f>(words0.xyz), float4(u.nodes, 4u * current + 1u).xyz);
      let enter0 = enter;
      let hit1 = entersBox(bitcast<vec3f>(words2.xyz), float4(u.nodes, 4u * current + 3u).xyz);
      if (hit0 || hit1) {
        level >>= 1u;
        let swapped = enter < enter0;
        if (hit0 && hit1) {
          let far = select(words2.w, words0.w, swapped);
          if ((trail & level) != 0u) {
            current = far;
          } else {
            current = select(words0.w, words2.w, swapped);
#if SHORT
            stack[top % STACK] = far;
            top++;
            kept = min(kept + 1u, STACK);
#endif
          }
        } else if (level != popLevel) {
          trail |= level;
          current = select(words2.w, words0.w, hit0);
        } else {
          pop = true;
        }
      } else {
        pop = true;
      }
    } else {
      visitLeaf(current);
      if (anyHit && found.id != NONE) { return; }
      pop = true;
    }
    if (!pop) { continue; }
    trail &= ~(level - 1u);
    trail += level;
    if ((trail & 0x80000000u) != 0u || trail == 0u) { return; }
    level = trail & ~(trail - 1u);
    popLevel = level;
#if SHORT
    if (kept > 0u) {
      kept--;
      top--;
      current = stack[top % STACK];
      continue;
    }
#endif
    current = 0u;
    level = 0x80000000u;
  }
}

#endif

fn castRay(o: vec3f, d: vec3f, tmin: f32, tmax: f32, any_: bool) {
  anyHit = any_;
  steps = 0u;
  if (prepare(o, d, tmin, tmax)) { traverse(); }
}
#endif
