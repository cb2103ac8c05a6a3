// The accumulated picture onto the canvas, over a background.
struct Blit { background: vec3f, unused: f32, size: vec2u, target_: vec2u }
@group(0) @binding(0) var<uniform> u: Blit;
@group(0) @binding(1) var<storage, read> sums: array<vec4f>;

@vertex fn cover(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  return vec4f(select(-1.0, 3.0, i == 1u), select(-1.0, 3.0, i == 2u), 0.0, 1.0);
}

fn toSrgb(c: vec3f) -> vec3f {
  return select(1.055 * pow(max(c, vec3f(1e-6)), vec3f(1.0 / 2.4)) - 0.055, 12.92 * c, c <= vec3f(0.0031308));
}

@fragment fn blit(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let scaled = any(u.size != u.target_);
  let uv = position.xy / vec2f(u.target_) * vec2f(u.size) - 0.5;
  let first = select(floor(uv + 0.5), floor(uv), vec2<bool>(scaled));
  let f = select(vec2f(0), uv - first, vec2<bool>(scaled));
  var sum = vec4f(0);
  for (var k = 0; k < 4; k++) {
    let corner = vec2f(f32(k & 1), f32(k >> 1u));
    let w = mix(1.0 - f, f, corner);
    let p = vec2u(clamp(first + corner, vec2f(0), vec2f(u.size) - 1.0));
    sum += w.x * w.y * sums[p.y * u.size.x + p.x];
  }
  return vec4f(toSrgb(sum.xyz / max(sum.w, 1e-6)) * sum.w + (1.0 - sum.w) * u.background, 1.0);
}
