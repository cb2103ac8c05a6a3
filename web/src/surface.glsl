// What is at a hit: the geometric and the smooth normal, and the colour in linear light.
uniform bool layerInRange;  // codes are values from lo to hi; else values as they are stored
uniform vec2 layerRange;    // that colours stand for, as codes' shares of 65534 or as values
uniform float spread;       // a ray's width over its length

const vec3 CLAY = vec3(0.50, 0.455, 0.41);

struct Surface {
  vec3 geometric, smooth_, color;
  vec2 uv;
  vec4 values;  // of the layer; w: whether there are any
};

vec3 unpackNormal(uint code) {
  vec2 p = (vec2(float(code & 65535u), float(code >> 16)) - 32768.0) / 32767.0;
  vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * mix(vec2(1.0), vec2(-1.0), lessThan(n.xy, vec2(0.0)));
  return normalize(n);
}

#if COLORS || LAYER
vec3 toLinear(vec3 c) {
  return mix(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThanEqual(c, vec3(0.04045)));
}
#endif
#if COLORS
vec3 vertexColor(uint v) {
  uint c = word4(vertices, 2u * v).w;
  return toLinear(vec3(float(c & 255u), float((c >> 8) & 255u), float((c >> 16) & 255u)) / 255.0);
}
vec3 texelColor(uint at) {
  uint c = texelFetch(colors, ivec2(at & 4095u, at >> 12), 0).x;
  return toLinear(vec3(float(c >> 11) / 31.0, float((c >> 5) & 63u) / 63.0, float(c & 31u) / 31.0));
}
#endif

#if LAYER
// Viridis as pipeline/render/color_map.cpp has it: a polynomial, in sRGB.
const vec3 VIRIDIS[7] = vec3[7](
  vec3(0.2777273, 0.0054073, 0.3340998),
  vec3(0.105093, 1.4046135, 1.3845902),
  vec3(-0.3308618, 0.2148476, 0.0950952),
  vec3(-4.6342305, -5.799101, -19.332441),
  vec3(6.2282699, 14.1799334, 56.6905526),
  vec3(4.776385, -13.7451454, -65.3530326),
  vec3(-5.4354559, 4.6458526, 26.3124352));
vec3 ramp(float t) {
  vec3 c = vec3(0.0);
  for (int i = 6; i >= 0; --i) c = c * t + VIRIDIS[i];
  return toLinear(clamp(c, 0.0, 1.0));
}

uint layerCode(uint at) { return texelFetch(layerValues, ivec2(at & 4095u, at >> 12), 0).x; }

// The layer at a place of a leaf: bilinear in the texels that have a value. A texture is averaged, in linear light, over
// what the ray covers, as texture_color() of pipeline/rbvh/texture_layer.cpp does.
vec4 layerAt(uint leaf, vec3 p) {
  vec4 u = float4(layerLeaves, 3u * leaf), v = float4(layerLeaves, 3u * leaf + 1u);
  uvec4 of = word4(layerLeaves, 3u * leaf + 2u);
  vec2 own = vec2(float(of.y & 65535u), float(of.y >> 16)) - 1.0,
       tile = vec2(float(of.z & 65535u), float(of.z >> 16)) - 1.0;
  vec2 start = vec2(dot(u.xyz, p) + u.w, dot(v.xyz, p) + v.w), place, first, f, per = own / tile;
  vec4 sum = vec4(0.0);
  float covered = TEXTURE == 1 ? spread * found.t * length(u.xyz) : 0.0;
  int taps = clamp(int(ceil(covered * max(per.x, per.y))), 1, 8);
  for (int i = 0; i < 4 * taps * taps; ++i) {
    int k = i & 3, tap = i >> 2;
    if (k == 0) {
      place = start + covered * ((vec2(float(tap % taps), float(tap / taps)) + 0.5) / float(taps) - 0.5);
      place = clamp(place * per, vec2(0.0), own);
      first = min(floor(place), own - 1.0);
      f = place - first;
    }
    vec2 corner = vec2(float(k & 1), float(k >> 1));
    vec2 w2 = mix(1.0 - f, f, corner);
    float w = w2.x * w2.y;
    uint at = (of.x + uint(first.y + corner.y) * (of.y & 65535u) + uint(first.x + corner.x)) * uint(LAYER);
    if (w <= 0.0 || layerCode(at) == 0u) continue;
#if TEXTURE
    vec3 code = vec3(float(layerCode(at)), float(layerCode(at + 1u)), float(layerCode(at + 2u)));
    sum.xyz += w * toLinear(clamp(mix(vec3(layerRange.x), vec3(layerRange.y), (code - 1.0) / 65534.0), 0.0, 1.0));
#else
    for (int c = 0; c < min(LAYER, 3); ++c) {
      float code = float(layerCode(at + uint(c)));
      sum[c] += w * (layerInRange ? (code - 1.0) / 65534.0 : code);
    }
#endif
    sum.w += w;
  }
  if (sum.w > 0.0) sum.xyz /= sum.w;
  return sum;
}
#endif

Surface surfaceAt() {
  Surface s;
  s.color = CLAY;
  s.values = vec4(0.0);
  s.uv = found.uv;
  vec3 p = rayO + rayD * found.t;
#if TILES
  if ((found.id & TILE) != 0u) {
    Tile tile = readTile(found.id & 0x3fffffffu);
    vec3 place = mat3(tile.columns) * p + tile.columns[3];
    ivec2 most = ivec2(tile.width, tile.height) - 2;
    ivec2 cell = clamp(ivec2(place.xy), ivec2(0), most);
    vec2 f = place.xy - vec2(cell);
    int at = cell.y * tile.width + cell.x;
    float a = heightAt(tile, at), b = heightAt(tile, at + 1), c = heightAt(tile, at + tile.width),
          d = heightAt(tile, at + tile.width + 1);
    // Where a corner is missing, the slope along the edge that is there stands for it.
    bool ab = a > 0.0 && b > 0.0, cd = c > 0.0 && d > 0.0, ac = a > 0.0 && c > 0.0, bd = b > 0.0 && d > 0.0;
    float du = ab && cd ? mix(b - a, d - c, f.y) : ab ? b - a : cd ? d - c : 0.0;
    float dv = ac && bd ? mix(c - a, d - b, f.x) : ac ? c - a : bd ? d - b : 0.0;
    mat3 rows = transpose(mat3(tile.columns));
    s.geometric = normalize(rows[2] - rows[0] * du - rows[1] * dv);
    s.uv = clamp(place.xy / vec2(float(tile.width - 1), float(tile.height - 1)), 0.0, 1.0);
    vec2 inside = s.uv * vec2(float(tile.width - 1), float(tile.height - 1));
    cell = min(ivec2(inside), most);
    f = inside - vec2(cell);
    vec3 normal = vec3(0.0), color = vec3(0.0);
    float weight = 0.0;
    for (int k = 0; k < 4; ++k) {
      ivec2 corner = ivec2(k & 1, k >> 1);
      vec2 w2 = mix(1.0 - f, f, vec2(corner));
      float w = w2.x * w2.y;
      int i = (cell.y + corner.y) * tile.width + cell.x + corner.x;
      if (w <= 0.0 || heightAt(tile, i) == 0.0) continue;
      uint texel = tile.offset + uint(i);
      weight += w;
      normal += w * unpackNormal(texelFetch(normals, ivec2(texel & 4095u, texel >> 12), 0).x);
#if COLORS
      color += w * texelColor(texel);
#endif
    }
    s.smooth_ = dot(normal, normal) > 0.0 ? normalize(normal) : s.geometric;
#if COLORS
    if (weight > 0.0) s.color = color / weight;
#endif
  } else
#endif
  {
    uvec4 prim = word4(prims, found.id);
    vec3 w = DISCS == 1 ? vec3(1.0, 0.0, 0.0) : vec3(1.0 - found.uv.x - found.uv.y, found.uv);
    vec3 normal = vec3(0.0), color = vec3(0.0), corners[3];
    for (int k = 0; k < 3; ++k) {
      corners[k] = float4(vertices, 2u * prim[k]).xyz;
      normal += w[k] * float4(vertices, 2u * prim[k] + 1u).xyz;
#if COLORS
      color += w[k] * vertexColor(prim[k]);
#endif
    }
    if (DISCS == 1) {
      s.geometric = normal;
    } else {
      vec3 e = corners[1] - corners[0], g = corners[2] - corners[0], most = max(abs(e), abs(g));
      float scale = 1.0 / max(most.x, max(most.y, most.z));
      s.geometric = normalize(cross(e * scale, g * scale));
      p = w.x * corners[0] + w.y * corners[1] + w.z * corners[2];
    }
    if (DISCS == 1) p = corners[0];
    s.smooth_ = dot(normal, normal) > 1e-12 ? normalize(normal) : s.geometric;
#if COLORS
    s.color = color;
#endif
  }
#if LAYER
  s.values = layerAt(found.leaf, p);
#if TEXTURE
  if (s.values.w > 0.0) s.color = s.values.xyz;
#else
  vec3 share = clamp((s.values.xyz - layerRange.x) / max(layerRange.y - layerRange.x, 1e-30), 0.0, 1.0);
  s.color = s.values.w == 0.0 ? CLAY : LAYER < 3 ? ramp(share.x) : share;
#endif
#endif
  return s;
}
