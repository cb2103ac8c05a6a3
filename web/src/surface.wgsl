// The surface at a hit, and the passes; it follows trace.wgsl.
#if SURFACE
const CLAY = vec3f(0.50, 0.455, 0.41);
struct Surface { geometric: vec3f, smooth_: vec3f, color: vec3f, uv: vec2f, values: vec4f }

fn unpackNormal(code: u32) -> vec3f {
  let p = (vec2f(f32(code & 65535u), f32(code >> 16u)) - 32768.0) / 32767.0;
  let z = 1.0 - abs(p.x) - abs(p.y);
  let folded = (1.0 - abs(p.yx)) * select(vec2f(1), vec2f(-1), p < vec2f(0));
  return normalize(vec3f(select(p, folded, z < 0.0), z));
}
#if TINTED
fn toLinear(c: vec3f) -> vec3f { return select(pow((c + 0.055) / 1.055, vec3f(2.4)), c / 12.92, c <= vec3f(0.04045)); }
#endif
#if COLORS
fn vertexColor(v: u32) -> vec3f {
  let c = word4(u.vertices, 2u * v).w;
  return toLinear(vec3f(f32(c & 255u), f32((c >> 8u) & 255u), f32((c >> 16u) & 255u)) / 255.0);
}
fn texelColor(at: u32) -> vec3f {
  let c = half_(u.colors, at);
  return toLinear(vec3f(f32(c >> 11u) / 31.0, f32((c >> 5u) & 63u) / 63.0, f32(c & 31u) / 31.0));
}
#endif
#if LAYER
// Viridis, a polynomial in sRGB.
fn ramp(t: f32) -> vec3f {
  var powers = array<vec3f, 7>(
    vec3f(0.2777273, 0.0054073, 0.3340998),
    vec3f(0.105093, 1.4046135, 1.3845902),
    vec3f(-0.3308618, 0.2148476, 0.0950952),
    vec3f(-4.6342305, -5.799101, -19.332441),
    vec3f(6.2282699, 14.1799334, 56.6905526),
    vec3f(4.776385, -13.7451454, -65.3530326),
    vec3f(-5.4354559, 4.6458526, 26.3124352));
  var c = vec3f(0);
  for (var i = 6; i >= 0; i--) { c = c * t + powers[i]; }
  return toLinear(clamp(c, vec3f(0), vec3f(1)));
}

fn layerAt(leaf: u32, p: vec3f) -> vec4f {
  let rowU = float4(u.layerLeaves, 3u * leaf);
  let rowV = float4(u.layerLeaves, 3u * leaf + 1u);
  let of_ = word4(u.layerLeaves, 3u * leaf + 2u);
  let own = vec2f(f32(of_.y & 65535u), f32(of_.y >> 16u)) - 1.0;
  let tile = vec2f(f32(of_.z & 65535u), f32(of_.z >> 16u)) - 1.0;
  let start = vec2f(dot(rowU.xyz, p) + rowU.w, dot(rowV.xyz, p) + rowV.w);
  let per = own / tile;
  var sum = vec4f(0);
  var covered = 0.0;
#if TEXTURE
  covered = u.spread * found.t * length(rowU.xyz);
#endif
  let taps = clamp(u32(ceil(covered * max(per.x, per.y))), 1u, 8u);
  for (var i = 0u; i < 4u * taps * taps; i++) {
    let k = i & 3u;
    let tap = i >> 2u;
    let aside = covered * ((vec2f(f32(tap % taps), f32(tap / taps)) + 0.5) / f32(taps) - 0.5);
    let place = clamp((start + aside) * per, vec2f(0), own);
    let first = min(floor(place), own - 1.0);
    let f = place - first;
    let corner = vec2f(f32(k & 1u), f32(k >> 1u));
    let w2 = mix(1.0 - f, f, corner);
    let w = w2.x * w2.y;
    let at = (of_.x + u32(first.y + corner.y) * (of_.y & 65535u) + u32(first.x + corner.x)) * LAYER;
    if (w <= 0.0 || half_(u.layerValues, at) == 0u) { continue; }
#if TEXTURE
    let code = vec3f(f32(half_(u.layerValues, at)), f32(half_(u.layerValues, at + 1u)), f32(half_(u.layerValues, at + 2u)));
    let shown = toLinear(clamp(mix(vec3f(u.layerRange.x), vec3f(u.layerRange.y), (code - 1.0) / 65534.0), vec3f(0), vec3f(1)));
    sum += vec4f(w * shown, 0.0);
#else
    for (var c = 0u; c < min(LAYER, 3u); c++) {
      let code = f32(half_(u.layerValues, at + c));
      sum[c] += w * select(code, (code - 1.0) / 65534.0, u.layerInRange != 0u);
    }
#endif
    sum.w += w;
  }
  if (sum.w > 0.0) { sum = vec4f(sum.xyz / sum.w, sum.w); }
  return sum;
}

#endif

fn surfaceAt() -> Surface {
  var s = Surface(vec3f(0), vec3f(0), CLAY, found.uv, vec4f(0));
  var p = rayO + rayD * found.t;
  var normal = vec3f(0);
  var color = vec3f(0);
#if TILES
  if ((found.id & TILE) != 0u) {
    let tile = readTile(found.id & 0x3fffffffu);
    let place = tile.m0 * p.x + tile.m1 * p.y + tile.m2 * p.z + tile.m3;
    let most = vec2i(tile.width, tile.height) - 2;
    var cell = clamp(vec2i(place.xy), vec2i(0), most);
    var f = place.xy - vec2f(cell);
    let at = cell.y * tile.width + cell.x;
    let a = heightAt(tile, at);
    let b = heightAt(tile, at + 1);
    let c = heightAt(tile, at + tile.width);
    let d = heightAt(tile, at + tile.width + 1);
    let ab = a > 0.0 && b > 0.0;
    let cd = c > 0.0 && d > 0.0;
    let ac = a > 0.0 && c > 0.0;
    let bd = b > 0.0 && d > 0.0;
    let du = select(select(select(0.0, d - c, cd), b - a, ab), mix(b - a, d - c, f.y), ab && cd);
    let dv = select(select(select(0.0, d - b, bd), c - a, ac), mix(c - a, d - b, f.x), ac && bd);
    let rows = transpose(mat3x3f(tile.m0, tile.m1, tile.m2));
    s.geometric = normalize(rows[2] - rows[0] * du - rows[1] * dv);
    let size = vec2f(f32(tile.width - 1), f32(tile.height - 1));
    s.uv = clamp(place.xy / size, vec2f(0), vec2f(1));
    cell = min(vec2i(s.uv * size), most);
    f = s.uv * size - vec2f(cell);
    var weight = 0.0;
    for (var k = 0; k < 4; k++) {
      let corner = vec2i(k & 1, k >> 1u);
      let w2 = mix(1.0 - f, f, vec2f(corner));
      let w = w2.x * w2.y;
      let i = (cell.y + corner.y) * tile.width + cell.x + corner.x;
      if (w <= 0.0 || heightAt(tile, i) == 0.0) { continue; }
      weight += w;
      normal += w * unpackNormal(texels[u.normals + tile.offset + u32(i)]);
#if COLORS
      color += w * texelColor(tile.offset + u32(i));
#endif
    }
#if COLORS
    if (weight > 0.0) { s.color = color / weight; }
#endif
  } else
#endif
  {
    let prim = word4(u.prims, found.id);
#if DISCS
    let w = vec3f(1, 0, 0);
#else
    let w = vec3f(1.0 - found.uv.x - found.uv.y, found.uv);
#endif
    var corners: array<vec3f, 3>;
    for (var k = 0; k < 3; k++) {
      corners[k] = float4(u.vertices, 2u * prim[k]).xyz;
      normal += w[k] * float4(u.vertices, 2u * prim[k] + 1u).xyz;
#if COLORS
      color += w[k] * vertexColor(prim[k]);
#endif
    }
#if DISCS
    s.geometric = normal;
#else
    let e = corners[1] - corners[0];
    let g = corners[2] - corners[0];
    let most = max(abs(e), abs(g));
    let scale = 1.0 / max(max(most.x, max(most.y, most.z)), 1e-30);
    s.geometric = normalize(cross(e * scale, g * scale));
#endif
    p = w.x * corners[0] + w.y * corners[1] + w.z * corners[2];
#if COLORS
    s.color = color;
#endif
  }
  s.smooth_ = select(s.geometric, normalize(select(vec3f(1), normal, vec3<bool>(dot(normal, normal) > 1e-12))),
                     vec3<bool>(dot(normal, normal) > 1e-12));
#if LAYER
  s.values = layerAt(found.leaf, p);
#if TEXTURE
  if (s.values.w > 0.0) { s.color = s.values.xyz; }
#else
  let share = clamp((s.values.xyz - u.layerRange.x) / max(u.layerRange.y - u.layerRange.x, 1e-30), vec3f(0), vec3f(1));
  s.color = select(select(share, ramp(share.x), vec3<bool>(LAYER < 3u)), CLAY, vec3<bool>(s.values.w == 0.0));
#endif
#endif
  return s;
}
#endif

// --- the passes

fn pixelDirection(pixel: vec2u) -> vec3f {
  let p = vec2f(pixel) + u.camOffset;
  return normalize(u.camCorner + u.camRight * p.x + u.camDown * p.y);
}

#if primary
const BACK_TINT = vec3f(0.55, 0.60, 0.70);

@compute @workgroup_size(8, 8) fn primary(@builtin(global_invocation_id) id: vec3u) {
  let pixel = id.xy + vec2u(0, u.row);
  if (any(pixel >= u.size)) { return; }
  let at = 2u * (pixel.y * u.size.x + pixel.x);
  let d = pixelDirection(pixel);
  castRay(u.camPosition, d, 0.0, FAR, false);
  surfaces[at] = vec4u(0);
  surfaces[at + 1u] = vec4u(0, 0, 0, NONE);
  if (found.id == NONE) { return; }
  let s = surfaceAt();
  let behind = dot(s.geometric, d) > 0.0;
  var n = select(s.smooth_, -s.smooth_, vec3<bool>(behind));
  let facing = -dot(n, d);
  if (facing < 0.0) { n = normalize(n + d * facing); }
  surfaces[at] = vec4u(bitcast<u32>(found.t), bitcast<vec3u>(n));
  surfaces[at + 1u] = vec4u(bitcast<vec3u>(select(s.color, s.color * BACK_TINT, vec3<bool>(behind))), found.leaf);
}

#endif
#if occlusion
fn hash(number: u32) -> u32 {
  var n = (number ^ (number >> 16u)) * 0x7feb352du;
  n = (n ^ (n >> 15u)) * 0x846ca68bu;
  return n ^ (n >> 16u);
}
fn random(pixel: vec2u, salt: u32) -> vec2f {
  let seed = hash(pixel.x + hash(pixel.y + hash(salt)));
  return fract(vec2f(f32(seed & 65535u), f32(seed >> 16u)) / 65536.0 +
               f32(u.sampleNumber) * vec2f(0.7548776662466927, 0.5698402909980532));
}
fn frame(n: vec3f) -> mat2x3f {
  let s = select(1.0, -1.0, n.z < 0.0);
  let a = -1.0 / (s + n.z);
  let b = n.x * n.y * a;
  return mat2x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y));
}

@compute @workgroup_size(8, 8) fn occlusion(@builtin(global_invocation_id) id: vec3u) {
  let pixel = id.xy + vec2u(0, u.row);
  if (any(pixel >= u.size)) { return; }
  let at = pixel.y * u.size.x + pixel.x;
  lights[at] = vec2f(1);
  let g = surfaces[2u * at];
  let t = bitcast<f32>(g.x);
  if (t == 0.0) { return; }
  let n = bitcast<vec3f>(g.yzw);
  let p = u.camPosition + pixelDirection(pixel) * (t * (1.0 - 1e-5)) + n * u.lift;
  var r = random(pixel, 1u);
  var angle = 6.2831853 * r.x;
  let toKey = normalize(u.keyDirection + frame(u.keyDirection) * (0.14 * sqrt(r.y) * vec2f(cos(angle), sin(angle))));
  var key = 1.0;
  if (dot(toKey, n) > 0.0) {
    castRay(p, toKey, 0.0, FAR, true);
    if (found.id != NONE) { key = 0.0; }
  }
  r = random(pixel, 2u);
  angle = 6.2831853 * r.x;
  let toSky = frame(n) * (sqrt(r.y) * vec2f(cos(angle), sin(angle))) + n * sqrt(max(0.0, 1.0 - r.y));
  castRay(p, toSky, 0.0, u.skyDistance, true);
  lights[at] = vec2f(key, select(1.0, 0.0, found.id != NONE));
}

#endif
#if shade
fn halfInverse(p: vec2i) -> f32 {
  let t = bitcast<f32>(surfaces[2u * (u32(p.y) * u.size.x + u32(p.x))].x);
  return select(0.0, 0.5 / max(t, 1e-30), t > 0.0);
}
fn relief(p: vec2i, t: f32, radius: i32) -> f32 {
  var directions = array<vec2i, 4>(vec2i(1, 0), vec2i(0, 1), vec2i(1, 1), vec2i(1, -1));
  var sum = 0.0;
  for (var k = 0; k < 4; k++) {
    let a = p + radius * directions[k];
    let b = p - radius * directions[k];
    if (any(min(a, b) < vec2i(0)) || any(max(a, b) >= vec2i(u.size))) { continue; }
    let ha = halfInverse(a);
    let hb = halfInverse(b);
    if (ha == 0.0 || hb == 0.0) { continue; }
    sum += clamp((ha + hb - 1.0 / t) * t / (u.pixelAngle * f32(radius)), -1.0, 1.0);
  }
  return sum / 4.0;
}

const KEY = vec3f(0.92, 0.88, 0.82);
const SKY = vec3f(0.34, 0.39, 0.47);
const GROUND = vec3f(0.08, 0.07, 0.06);

@compute @workgroup_size(8, 8) fn shade(@builtin(global_invocation_id) id: vec3u) {
  if (any(id.xy >= u.size)) { return; }
  let at = id.y * u.size.x + id.x;
  let g = surfaces[2u * at];
  let t = bitcast<f32>(g.x);
  var sum = vec4f(0);
  if (u.kept > 0.0) { sum = u.kept * sums[at]; }
  if (t > 0.0) {
    let n = bitcast<vec3f>(g.yzw);
    let view = -pixelDirection(id.xy);
    let albedo = bitcast<vec3f>(surfaces[2u * at + 1u].xyz);
    let light = select(vec2f(1), lights[at], vec2<bool>(u.occluded != 0u));
    let facing = clamp(dot(n, view), 0.0, 1.0);
    let key = max(0.0, dot(n, u.keyDirection)) * light.x;
    let sky = mix(GROUND, SKY, 0.5 + 0.5 * dot(n, u.skyUp)) * light.y;
    let gloss = 0.06 * pow(max(0.0, dot(n, normalize(u.keyDirection + view))), 24.0) * light.x;
    let away = 1.0 - facing;
    var color = albedo * (KEY * key + sky + 0.10 * facing) + sky * (0.16 * away * away * away) + KEY * gloss;
    let p = vec2i(id.xy);
    let bend = clamp(relief(p, t, u.radii.x) + relief(p, t, u.radii.y) + relief(p, t, u.radii.z), -1.0, 1.0);
    color *= select(1.0 - 0.25 * bend, 1.0 - 0.45 * bend, bend > 0.0);
    sum += vec4f(clamp(color, vec3f(0), vec3f(1)), 1.0) * u.weight;
  }
  sums[at] = sum;
}

#endif
#if castRays
@compute @workgroup_size(64) fn castRays(@builtin(global_invocation_id) id: vec3u) {
  let i = id.x;
  if (i >= u.rayCount) { return; }
  let o = rays[2u * i];
  let d = rays[2u * i + 1u];
  castRay(o.xyz, d.xyz, o.w, d.w, false);
  hits[3u * i] = vec4u(0);
  hits[3u * i + 1u] = vec4u(0, 0, NONE, steps << 8u);
  hits[3u * i + 2u] = vec4u(0);
  if (found.id == NONE) { return; }
  let s = surfaceAt();
  let flags = select(0u, 1u, dot(s.geometric, d.xyz) > 0.0) | select(2u, 0u, (found.id & TILE) != 0u);
  hits[3u * i] = vec4u(bitcast<u32>(found.t), bitcast<vec3u>(s.geometric));
  hits[3u * i + 1u] = vec4u(bitcast<vec2u>(s.uv), found.leaf, flags | (steps << 8u));
  hits[3u * i + 2u] = bitcast<vec4u>(s.values);
}
#endif
