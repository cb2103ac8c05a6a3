// Ray casting a level in a fragment shader: a binary hierarchy, tiles that are marched, triangles, discs. The
// tests are those of kernels/. TILES, DISCS, COLORS and LAYER (a layer's channels) say what there is, as shaders compile
// the faster the less they hold; TRAVERSAL says how the tree is traversed:
//   0 short stack of STACK entries, with a trail for when it has run dry (Laine, "Restart Trail for Stackless
//     BVH Traversal", 2010); 1 the trail alone; 2 links to parents (Hapala et al., "Efficient Stack-less BVH
//     Traversal for Ray Tracing", 2011)
precision highp float;
precision highp int;
precision highp usampler2D;

uniform usampler2D nodes, prims, vertices, tiles, heights, normals, colors, layerLeaves, layerValues;
uniform vec3 sceneLo, sceneHi;

const float FAR = 3e38;
const int STACK = 8;
const uint NONE = 0xffffffffu, LEAF = 0x80000000u, TILE = 0x40000000u;

uvec4 word4(usampler2D from, uint at) { return texelFetch(from, ivec2(at & 4095u, at >> 12), 0); }
vec4 float4(usampler2D from, uint at) { return uintBitsToFloat(word4(from, at)); }

struct Found {
  float t;
  uint id;  // a primitive, or TILE and a tile; NONE
  uint leaf;
  vec2 uv;
};

// The ray, with what the tests need of it (kernels/bvh/prepared_ray.h).
vec3 rayO, rayD, inverse, nearOffset, farOffset;
bvec3 backwards;
float rayMin;
int longest;
vec3 sheared, shear;  // the origin along the permuted axes; the shear
bool anyHit;
Found found;
uint steps;

vec3 permuted(vec3 v) { return longest == 0 ? v.yzx : longest == 1 ? v.zxy : v; }

bool prepare(vec3 o, vec3 d, float tmin, float tmax) {
  rayO = o;
  rayD = d;
  rayMin = tmin;
  found = Found(min(tmax, FAR), NONE, NONE, vec2(0.0));
  vec3 size = abs(d);
  float most = max(size.x, max(size.y, size.z));
  if (!(most > 0.0) || most > FAR || !(tmin <= tmax)) return false;
  longest = size.x >= most ? 0 : size.y >= most ? 1 : 2;
  sheared = permuted(o);
  vec3 p = permuted(d);
  shear = vec3(p.xy / p.z, 1.0 / p.z);
  vec3 away = max(max(abs(sceneLo - o), abs(sceneHi - o)), abs(o));
  float margin = 1.2e-6 * max(away.x, max(away.y, away.z));
  bvec3 parallel = lessThanEqual(size, vec3(1e-18 * most));
  vec3 signs = mix(vec3(1.0), vec3(-1.0), lessThan(d, vec3(0.0)));
  inverse = mix(1.0 / d, signs * (1e18 / most), parallel);
  backwards = lessThan(inverse, vec3(0.0));
  vec3 outwards = mix(vec3(margin), vec3(-margin), backwards);
  nearOffset = -(o + outwards) * inverse;
  farOffset = -(o - outwards) * inverse;
  return true;
}

bool entersBox(vec3 lo, vec3 hi, out float enter) {
  vec3 a = mix(lo, hi, backwards) * inverse + nearOffset, b = mix(hi, lo, backwards) * inverse + farOffset;
  enter = max(max(a.x, a.y), max(a.z, rayMin));
  return enter <= min(min(b.x, b.y), min(b.z, found.t));
}

bool isNearer(float t, uint leaf) { return t < found.t || (t == found.t && leaf < found.leaf); }

#if DISCS == 0
void intersectTriangle(uint at, uvec4 prim) {
  vec3 a = permuted(float4(vertices, 2u * prim.x).xyz) - sheared,
       b = permuted(float4(vertices, 2u * prim.y).xyz) - sheared,
       c = permuted(float4(vertices, 2u * prim.z).xyz) - sheared;
  vec2 p = a.xy - shear.xy * a.z, q = b.xy - shear.xy * b.z, r = c.xy - shear.xy * c.z;
  float u = r.x * q.y - r.y * q.x, v = p.x * r.y - p.y * r.x, w = q.x * p.y - q.y * p.x, sum = u + v + w;
  bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
  if (!inside || sum == 0.0) return;
  float t = (u * (shear.z * a.z) + v * (shear.z * b.z) + w * (shear.z * c.z)) / sum;
  if (t >= rayMin && isNearer(t, prim.w)) found = Found(t, at, prim.w, vec2(v, w) / sum);
}
#else
void intersectDisc(uint at, uvec4 prim) {
  vec3 c = float4(vertices, 2u * prim.x).xyz - rayO;
  vec4 n = float4(vertices, 2u * prim.x + 1u);
  float slope = dot(n.xyz, rayD);
  if (slope == 0.0) return;
  float t = dot(c, n.xyz) / slope;
  vec3 off = rayD * t - c;
  if (dot(off, off) > n.w * n.w || !(t >= rayMin) || !isNearer(t, prim.w)) return;
  float s = n.z < 0.0 ? -1.0 : 1.0, e = -1.0 / (s + n.z), f = n.x * n.y * e;
  off /= n.w;
  found = Found(t, at, prim.w, vec2(off.x * (1.0 + s * n.x * n.x * e) + off.y * (s * f) - off.z * (s * n.x),
                                    off.x * f + off.y * (s + n.y * n.y * e) - off.z * n.y));
}
#endif

// --- tiles (kernels/trace/march.h, march_ray.h)

#if TILES
struct Tile {
  mat4x3 columns;
  vec3 lo, hi;
  int width, height;
  uint offset, leaf;
  float limit, top;
};

Tile readTile(uint id) {
  vec4 a = float4(tiles, 6u * id), b = float4(tiles, 6u * id + 1u), c = float4(tiles, 6u * id + 2u),
       d = float4(tiles, 6u * id + 3u);
  uvec4 e = word4(tiles, 6u * id + 4u), f = word4(tiles, 6u * id + 5u);
  return Tile(mat4x3(a.xyz, vec3(a.w, b.xy), vec3(b.zw, c.x), c.yzw), d.xyz,
              vec3(d.w, uintBitsToFloat(e.xy)), int(e.z & 65535u), int(e.z >> 16), e.w, f.z,
              uintBitsToFloat(f.x), uintBitsToFloat(f.y));
}

float heightAt(Tile tile, int at) {
  uint i = tile.offset + uint(at);
  return float(texelFetch(heights, ivec2(i & 4095u, i >> 12), 0).x);
}

// Bilinear; negative where a corner is missing.
float patchHeight(Tile tile, vec2 uv) {
  ivec2 p = clamp(ivec2(uv), ivec2(0), ivec2(tile.width, tile.height) - 2);
  int at = p.y * tile.width + p.x;
  float a = heightAt(tile, at), b = heightAt(tile, at + 1), c = heightAt(tile, at + tile.width),
        d = heightAt(tile, at + tile.width + 1);
  vec2 f = uv - vec2(p);
  if (min(min(a, b), min(c, d)) == 0.0) return -1.0;
  float h0 = a + (b - a) * f.x;
  return h0 + (c + (d - c) * f.x - h0) * f.y;
}

// Where a ray crosses a grid line: t, how far above the surface it is there, and in which row of cells.
struct Line {
  float t, D;
  int row;
  bool solid;
};

struct GridRay {
  float oMajor, dMajor, iMajor, oMinor, dMinor, ow, dw;
  int lastLine, lastRow, sMajor, sMinor;
};

Line sampleLine(Tile tile, GridRay g, int k) {
  Line l;
  l.t = (float(k) - g.oMajor) * g.iMajor;
  float minor = g.oMinor + g.dMinor * l.t;
  l.row = int(clamp(minor, 0.0, float(g.lastRow)));
  int at = clamp(k, 0, g.lastLine) * g.sMajor + l.row * g.sMinor;
  float h0 = heightAt(tile, at), h1 = heightAt(tile, at + g.sMinor), rise = h1 - h0;
  l.D = (g.ow - h0) + g.dw * l.t - rise * (minor - float(l.row));
  l.solid = h0 > 0.0 && h1 > 0.0 && abs(rise) <= tile.limit;
  return l;
}

void march(uint id) {
  Tile tile = readTile(id);
  vec3 o = mat3(tile.columns) * rayO + tile.columns[3], d = mat3(tile.columns) * rayD;
  d = mix(d, mix(vec3(1e-20), vec3(-1e-20), lessThan(d, vec3(0.0))), lessThan(abs(d), vec3(1e-20)));
  vec3 inv = 1.0 / d, ta = -o * inv,
       tb = (vec3(float(tile.width - 1), float(tile.height - 1), tile.top + 1.0) - o) * inv,
       tIn = min(ta, tb), tOut = max(ta, tb);
  float t0 = max(max(tIn.x, tIn.y), max(tIn.z, rayMin)),
        t1 = min(min(tOut.x, tOut.y), min(tOut.z, found.t));
  if (!(t0 <= t1)) return;
  bool alongU = abs(d.x) >= abs(d.y);
  GridRay g;
  g.oMajor = alongU ? o.x : o.y;
  float toward = alongU ? d.x : d.y;
  g.dMajor = max(abs(toward), 1e-8 * abs(d.z)) * (toward < 0.0 ? -1.0 : 1.0);
  g.iMajor = 1.0 / g.dMajor;
  g.oMinor = alongU ? o.y : o.x;
  g.dMinor = alongU ? d.y : d.x;
  g.ow = o.z;
  g.dw = d.z;
  int lines = alongU ? tile.width : tile.height;
  g.lastLine = lines - 1;
  g.lastRow = (alongU ? tile.height : tile.width) - 2;
  g.sMajor = alongU ? 1 : tile.width;
  g.sMinor = alongU ? tile.width : 1;
  int step = g.dMajor > 0.0 ? 1 : -1;
  float enter = g.oMajor + g.dMajor * t0;
  int k = int(clamp(step > 0 ? floor(enter - 1e-3) : ceil(enter + 1e-3), 0.0, float(lines - 1)));
  float graze = (0.05 / 8.0) * tile.limit, steepest = abs(g.dw * g.iMajor) + (2.0 / 8.0) * tile.limit;
  Line here = sampleLine(tile, g, k);
  bool hasBefore = false;
  float before = 0.0;
  for (int n = 0; n < 65536; ++n) {
    if (here.t >= t1 || k < 0 || k > g.lastLine) return;
    ++steps;
    Line there = sampleLine(tile, g, k + step);
    float fromT = here.t, fromD = here.D, toT = there.t, toD = there.D;
    bool from = here.solid, to = there.solid;
    bool grazed = from && to && hasBefore && n % 15 != 0 && abs(fromD) < graze && abs(fromD) <= abs(toD) &&
                  abs(fromD) < abs(before);
    if (from != to && abs(from ? fromD : toD) <= steepest && here.row != there.row) {
      // One end has no surface, but on the line between the rows of cells there may be some.
      int row = max(here.row, there.row);
      float h0 = heightAt(tile, clamp(k, 0, g.lastLine) * g.sMajor + row * g.sMinor),
            h1 = heightAt(tile, clamp(k + step, 0, g.lastLine) * g.sMajor + row * g.sMinor);
      float t = (float(row) - g.oMinor) / g.dMinor, along = abs(g.oMajor + g.dMajor * t - float(k));
      if (h0 > 0.0 && h1 > 0.0 && abs(h1 - h0) <= tile.limit) {
        float D = g.ow + g.dw * t - (h0 + (h1 - h0) * along);
        if (from) {
          toT = t;
          toD = D;
        } else {
          fromT = t;
          fromD = D;
        }
        from = to = true;
      }
    }
    bool crossed = from && to && fromD * toD <= 0.0;
    if (crossed || grazed) {
      float hit = fromT;
      if (crossed) {
        float slope = (toD - fromD) / (toT - fromT), secant = fromT - fromD / slope;
        float h = patchHeight(tile, o.xy + vec2(alongU ? toward : d.x, alongU ? d.y : toward) * secant);
        float newton = secant - (o.z + d.z * secant - h) / slope;
        hit = h >= 0.0 && newton >= fromT && newton <= toT ? newton : secant;
      }
      float span = toT - fromT;
      vec3 p = rayO + rayD * hit;
      if (hit >= rayMin && isNearer(hit, tile.leaf) && hit >= t0 - span && hit <= t1 + span &&
          all(greaterThanEqual(p, tile.lo)) && all(lessThanEqual(p, tile.hi))) {
        found = Found(hit, id | TILE, tile.leaf, vec2(0.0));
        return;
      }
    }
    before = here.D;
    hasBefore = here.solid;
    here = there;
    k += step;
  }
}

#endif

// --- the hierarchy

void visitLeaf(uint link) {
#if TILES
  if ((link & TILE) != 0u) {
    march(link & 0x3fffffffu);
    return;
  }
#endif
  uint first = link & 0x7ffffffu, end = first + ((link >> 27) & 7u) + 1u;
  for (uint i = first; i < end; ++i) {
    ++steps;
    uvec4 prim = word4(prims, i);
#if DISCS
    intersectDisc(i, prim);
#else
    intersectTriangle(i, prim);
#endif
    if (anyHit && found.id != NONE) return;
  }
}

#if TRAVERSAL == 2
void traverse() {
  uint node = 0u;
  int state = 0;  // of its children, how many are done
  for (;;) {
    uint up = word4(nodes, 4u * node + 1u).w;
    uint axis = up & 3u;
    bool swapped = axis == 0u ? backwards.x : axis == 1u ? backwards.y : backwards.z;
    if (state < 2) {
      uint side = (state == 0) == swapped ? 1u : 0u;
      vec4 lo = float4(nodes, 4u * node + 2u * side), hi = float4(nodes, 4u * node + 2u * side + 1u);
      float enter;
      ++state;
      ++steps;
      if (!entersBox(lo.xyz, hi.xyz, enter)) continue;
      uint link = floatBitsToUint(lo.w);
      if ((link & LEAF) == 0u) {
        node = link;
        state = 0;
      } else {
        visitLeaf(link);
        if (anyHit && found.id != NONE) return;
      }
      continue;
    }
    if (node == 0u) return;
    bool second = (up & 4u) != 0u;
    node = up >> 3;
    axis = word4(nodes, 4u * node + 1u).w & 3u;
    swapped = axis == 0u ? backwards.x : axis == 1u ? backwards.y : backwards.z;
    state = second == swapped ? 1 : 2;
  }
}
#else
void traverse() {
  // A bit a level, from bit 31 on: whether the nearer child is done with.
  uint trail = 0u, level = 0x80000000u, popLevel = 0u, current = 0u;
#if TRAVERSAL == 0
  uint stack[STACK];
  uint top = 0u, kept = 0u;  // a ring: what is pushed over the oldest entry is found by the trail
#endif
  for (;;) {
    bool pop = false;
    if ((current & LEAF) == 0u) {
      ++steps;
      uvec4 words0 = word4(nodes, 4u * current), words2 = word4(nodes, 4u * current + 2u);
      vec3 hi0 = float4(nodes, 4u * current + 1u).xyz, hi1 = float4(nodes, 4u * current + 3u).xyz;
      float enter0, enter1;
      bool hit0 = entersBox(uintBitsToFloat(words0.xyz), hi0, enter0),
           hit1 = entersBox(uintBitsToFloat(words2.xyz), hi1, enter1);
      if (hit0 || hit1) {
        level >>= 1;
        bool swapped = enter1 < enter0;
        uint near = swapped ? words2.w : words0.w, far = swapped ? words0.w : words2.w;
        if (hit0 && hit1) {
          if ((trail & level) != 0u) {
            current = far;
          } else {
            current = near;
#if TRAVERSAL == 0
            stack[top & uint(STACK - 1)] = far;
            ++top;
            kept = min(kept + 1u, uint(STACK));
#endif
          }
        } else if (level != popLevel) {
          trail |= level;
          current = hit0 ? words0.w : words2.w;
        } else {
          pop = true;  // it was the farther one's turn, and that is no longer entered
        }
      } else {
        pop = true;
      }
    } else {
      visitLeaf(current);
      if (anyHit && found.id != NONE) return;
      pop = true;
    }
    if (!pop) continue;
    trail &= -level;  // those below begin anew
    trail += level;
    if ((trail & 0x80000000u) != 0u || trail == 0u) return;
    level = trail & -trail;
    popLevel = level;
#if TRAVERSAL == 0
    if (kept > 0u) {
      --kept;
      --top;
      current = stack[top & uint(STACK - 1)];
      continue;
    }
#endif
    current = 0u;
    level = 0x80000000u;
  }
}
#endif

void castRay(vec3 o, vec3 d, float tmin, float tmax, bool any) {
  anyHit = any;
  steps = 0u;
  if (prepare(o, d, tmin, tmax)) traverse();
}
