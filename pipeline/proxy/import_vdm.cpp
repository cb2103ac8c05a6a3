#include "pipeline/proxy/import_vdm.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <tuple>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/join_edges.h"
#include "pipeline/proxy/pack_map.h"
#include "pipeline/proxy/patch_point.h"
#include "pipeline/proxy/split_polygons.h"
#include "rbvh/scan.h"

namespace rbvh {
namespace {

constexpr double kWeldTolerance = 1e-6;  ///< of the diagonal: edges that differ by less do agree

// --- frames: tangent, bitangent, normal at every corner of every quad
// --------------------------------------------

struct Frame {
  Vec3d tangent, normal;
  double handedness = 1;
};
using Frames = std::vector<std::array<Frame, 4>>;

Vec3d corner_normal(const UvQuads& mesh, const Quad& quad, std::size_t k) {
  const auto point = [&](std::size_t c) { return mesh.positions[quad[c % 4]]; };
  return cross(point(k + 1) - point(k), point(k + 3) - point(k));
}

// The direction in which u grows, from the corner's two edges.
Vec3d corner_tangent(const UvQuads& mesh, std::size_t quad, std::size_t k, double& determinant) {
  const Quad& q = mesh.quads[quad];
  const auto& uv = mesh.uvs[quad];
  const std::size_t next = (k + 1) % 4, last = (k + 3) % 4;
  const Vec3d a = mesh.positions[q[next]] - mesh.positions[q[k]],
              b = mesh.positions[q[last]] - mesh.positions[q[k]];
  const double au = uv[next].u - uv[k].u, av = uv[next].v - uv[k].v;
  const double bu = uv[last].u - uv[k].u, bv = uv[last].v - uv[k].v;
  determinant = au * bv - av * bu;
  return (a * bv - b * av) * (determinant < 0 ? -1.0 : 1.0);
}

// Normals as the file has them, or smooth over the vertex; tangents smooth over what shares vertex and
// texture coordinate, as renderers make them.
Frames make_frames(const UvQuads& mesh) {
  std::vector<Vec3d> smooth(mesh.positions.size());
  for (const Quad& quad : mesh.quads)
    for (std::size_t k = 0; k < 4; ++k) smooth[quad[k]] = smooth[quad[k]] + corner_normal(mesh, quad, k);
  using Key = std::tuple<std::uint32_t, double, double, bool>;
  std::map<Key, Vec3d> tangents;
  const auto key = [&](std::size_t quad, std::size_t k, double determinant) {
    return Key(mesh.quads[quad][k], mesh.uvs[quad][k].u, mesh.uvs[quad][k].v, determinant < 0);
  };
  for (std::size_t quad = 0; quad < mesh.quads.size(); ++quad)
    for (std::size_t k = 0; k < 4; ++k) {
      double determinant = 0;
      const Vec3d tangent = normalized(corner_tangent(mesh, quad, k, determinant));
      Vec3d& sum = tangents[key(quad, k, determinant)];
      sum = sum + tangent;
    }
  Frames frames(mesh.quads.size());
  for (std::size_t quad = 0; quad < mesh.quads.size(); ++quad)
    for (std::size_t k = 0; k < 4; ++k) {
      Frame& frame = frames[quad][k];
      frame.normal = normalized(mesh.normals.empty() ? smooth[mesh.quads[quad][k]] : mesh.normals[quad][k]);
      double determinant = 0;
      static_cast<void>(corner_tangent(mesh, quad, k, determinant));
      frame.tangent = normalized(tangents[key(quad, k, determinant)]);
      frame.handedness = determinant < 0 ? -1 : 1;
    }
  return frames;
}

// --- the map
// ------------------------------------------------------------------------------------------------------

template <class T>
T bilinear(const std::array<T, 4>& corners, double s, double t) {
  return (corners[0] * (1 - s) + corners[1] * s) * (1 - t) + (corners[3] * (1 - s) + corners[2] * s) * t;
}

// Between texel centres, of which row 0 is on top. A quad that reaches out of [0, 1] sees the map repeated.
Vec3d look_up(const VdmMap& map, Uv uv, bool repeats) {
  const double x = uv.u * map.width - 0.5, y = (1 - uv.v) * map.height - 0.5;
  const auto index = [&](double at, std::uint32_t size) {
    const auto last = static_cast<double>(size);
    const double wrapped = repeats ? at - std::floor(at / last) * last : at;
    return static_cast<std::size_t>(std::clamp(wrapped, 0.0, last - 1));
  };
  const double left = std::floor(x), top = std::floor(y), fx = x - left, fy = y - top;
  Vec3d sum{};
  for (const int dy : {0, 1})
    for (const int dx : {0, 1}) {
      const double weight = (dx == 1 ? fx : 1 - fx) * (dy == 1 ? fy : 1 - fy);
      if (weight == 0) continue;
      const std::size_t at =
          (index(top + dy, map.height) * map.width + index(left + dx, map.width)) * map.channels;
      const float* v = &map.values[at];
      sum = sum + (map.channels == 1 ? Vec3d{v[0], v[0], v[0]} : Vec3d{v[0], v[1], v[2]}) * weight;
    }
  return sum;
}

struct Sampler {
  const UvQuads& mesh;
  const Frames& frames;
  const VdmMap& map;
  const VdmConvention& convention;

  Uv uv_at(std::size_t quad, double s, double t) const {
    const auto& uv = mesh.uvs[quad];
    return {bilinear<double>({uv[0].u, uv[1].u, uv[2].u, uv[3].u}, s, t),
            bilinear<double>({uv[0].v, uv[1].v, uv[2].v, uv[3].v}, s, t)};
  }
  bool repeats(std::size_t quad) const {
    return std::any_of(mesh.uvs[quad].begin(), mesh.uvs[quad].end(), [](const Uv& uv) {
      return uv.u < -1e-6 || uv.u > 1 + 1e-6 || uv.v < -1e-6 || uv.v > 1 + 1e-6;
    });
  }
  Vec3d at(std::size_t quad, bool wraps, double s, double t) const {
    const Vec3d value = look_up(map, uv_at(quad, s, t), wraps);
    Vec3d v{};
    for (int channel = 0; channel < 3; ++channel) {
      const VdmAxis& axis = convention.order[static_cast<std::size_t>(channel)];
      v[axis.axis] = axis.sign * convention.scale * (value[channel] - convention.midlevel);
    }
    if (map.channels == 3 && convention.space != VdmSpace::kTangent) return v;
    const auto& f = frames[quad];
    const Vec3d normal =
        normalized(bilinear<Vec3d>({f[0].normal, f[1].normal, f[2].normal, f[3].normal}, s, t));
    if (map.channels == 1) return normal * (convention.scale * (value.x - convention.midlevel));
    Vec3d tangent = bilinear<Vec3d>({f[0].tangent, f[1].tangent, f[2].tangent, f[3].tangent}, s, t);
    tangent = normalized(tangent - normal * dot(tangent, normal));
    const Vec3d bitangent = cross(normal, tangent) * f[0].handedness;
    return tangent * v.x + bitangent * v.y + normal * v.z;
  }
};

// As many texels as the map has along the quad's longest side.
std::uint32_t side_of(const UvQuads& mesh, std::size_t quad, const VdmMap& map, std::uint32_t max_side,
                      bool& is_coarser) {
  double longest = 1;
  for (std::size_t k = 0; k < 4; ++k) {
    const Uv &a = mesh.uvs[quad][k], &b = mesh.uvs[quad][(k + 1) % 4];
    longest = std::max({longest, std::abs(a.u - b.u) * map.width, std::abs(a.v - b.v) * map.height});
  }
  const double steps = std::ceil(std::min(longest, 1e6) - 1e-3);
  is_coarser = steps > max_side - 1;
  return std::min(std::bit_ceil(static_cast<std::uint32_t>(steps)) + 1, max_side);
}

// --- shared edges of patches
// -------------------------------------------------------------------------------------------

// All patches at a vertex get the mean of their displacements there, as join_edges() requires.
void weld_corners(Proxy& proxy) {
  std::vector<Vec3d> sum(proxy.positions.size());
  std::vector<std::uint32_t> count(proxy.positions.size(), 0);
  const auto texel = [&](std::size_t patch, std::size_t k) -> Vec3f& {
    const TexelPlace at = edge_texel(proxy.tiles[patch].side, k, 0);
    return proxy.map[texel_index(proxy, proxy.tiles[patch], at.i, at.j)];
  };
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch)
    for (std::size_t k = 0; k < 4; ++k) {
      sum[proxy.quads[patch][k]] = sum[proxy.quads[patch][k]] + Vec3d(texel(patch, k));
      ++count[proxy.quads[patch][k]];
    }
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch)
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t vertex = proxy.quads[patch][k];
      texel(patch, k) = Vec3f(sum[vertex] * (1.0 / count[vertex]));
    }
}

// The first patch of an edge gets the mean of all at the texels of the coarsest; the rest is join_edges()'s.
std::uint64_t weld_edges(Proxy& proxy, double tolerance) {
  std::uint64_t welded = 0;
  for_each_edge(proxy, [&](std::span<const QuadEdge> patches, std::uint32_t steps) {
    if (patches.size() == 1) return;
    const auto texel = [&](const QuadEdge& e, std::uint32_t k) -> Vec3f& {
      const PatchTile& tile = proxy.tiles[e.patch];
      const TexelPlace place = texel_along(proxy, e, k * ((tile.side - 1) / steps));
      return proxy.map[texel_index(proxy, tile, place.i, place.j)];
    };
    double worst = 0;
    for (std::uint32_t k = 0; k <= steps; ++k) {
      Vec3d sum{};
      for (const QuadEdge& patch : patches) sum = sum + Vec3d(texel(patch, k));
      const Vec3f mean(sum * (1.0 / static_cast<double>(patches.size())));
      worst = std::max<double>(worst, length(texel(patches[0], k) - mean));
      texel(patches[0], k) = mean;
    }
    welded += worst > tolerance;
  });
  return welded;
}

// --- what is odd
// --------------------------------------------------------------------------------------------------

std::uint64_t count_overlaps(const Sampler& sampler, const Proxy& proxy) {
  const VdmMap& map = sampler.map;
  std::vector<std::uint32_t> owner(std::size_t{map.width} * map.height, 0);
  std::uint64_t overlapping = 0;
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch) {
    const std::uint32_t cells = std::min(proxy.tiles[patch].side - 1, 64u);
    std::uint64_t taken = 0;
    for (std::uint32_t j = 0; j < cells; ++j)
      for (std::uint32_t i = 0; i < cells; ++i) {
        const Uv uv = sampler.uv_at(patch, (i + 0.5) / cells, (j + 0.5) / cells);
        const auto cell = [](double at, std::uint32_t size) {
          return std::min(static_cast<std::size_t>((at - std::floor(at)) * size), std::size_t{size} - 1);
        };
        std::uint32_t& first = owner[cell(1 - uv.v, map.height) * map.width + cell(uv.u, map.width)];
        if (first == 0) first = static_cast<std::uint32_t>(patch) + 1;
        taken += first != patch + 1;
      }
    // Quads of a texel or two share cells with their neighbours.
    overlapping += cells > 2 && 4 * taken >= std::uint64_t{cells} * cells;
  }
  return overlapping;
}

std::uint64_t clear_bad_texels(VdmMap& map, double midlevel) {
  std::uint64_t bad = 0;
  for (std::size_t i = 0; i < map.values.size(); i += map.channels) {
    bool is_fine = true;
    for (std::uint32_t c = 0; c < map.channels; ++c)
      is_fine &= std::abs(map.values[i + c]) <= kLargestProxyValue;
    if (is_fine) continue;
    ++bad;
    std::fill_n(map.values.begin() + static_cast<std::ptrdiff_t>(i), map.channels,
                static_cast<float>(midlevel));
  }
  return bad;
}

// The map's values were sane, so what is not comes of their scale.
void check_displacements(const Proxy& proxy, const std::string& file) {
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch) {
    const PatchTile& tile = proxy.tiles[patch];
    for (std::uint32_t j = 0; j < tile.side; ++j)
      for (std::uint32_t i = 0; i < tile.side; ++i) {
        const Vec3f& v = proxy.map[texel_index(proxy, tile, i, j)];
        if (!(std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}) <= kLargestProxyValue))
          throw Error(ErrorKind::kInput, file,
                      "patch " + std::to_string(patch) + " would be displaced by more than 1e18 units",
                      Remedy::kDisplacementScale);
      }
  }
}

double quad_area(const Proxy& proxy, const Quad& q) {
  const auto point = [&](std::size_t k) { return Vec3d(proxy.positions[q[k]]); };
  return (length(cross(point(1) - point(0), point(2) - point(0))) +
          length(cross(point(2) - point(0), point(3) - point(0)))) /
         2;
}

void check_finite(const UvQuads& mesh, const std::string& file) {
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3d& p = mesh.positions[i];
    const bool is_known = is_finite(p);
    if (!is_known || !(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= double{kLargestProxyValue}))
      throw Error(
          ErrorKind::kInput, file,
          "vertex " + std::to_string(i + 1) + (is_known ? " is too large: beyond 1e18" : " is not finite"));
  }
  for (std::size_t quad = 0; quad < mesh.uvs.size(); ++quad)
    for (const Uv& uv : mesh.uvs[quad])
      if (!(std::abs(uv.u) < 1e6 && std::abs(uv.v) < 1e6))
        throw Error(ErrorKind::kInput, file,
                    "has a texture coordinate that is not finite, or beyond a million");
}

}  // namespace

std::array<VdmAxis, 3> parse_vdm_order(std::string_view text) {
  std::array<VdmAxis, 3> order{};
  std::size_t count = 0;
  bool is_seen[3] = {false, false, false};
  double sign = 1;
  const auto fail = [&] {
    throw Error(
        ErrorKind::kUsage, "",
        "'" + std::string(text) + "' is not three of x, y, z or of t, b, n in some order, as in tnb or x-zy");
  };
  for (const char c : text) {
    if (c == '-' && sign > 0) {
      sign = -1;
      continue;
    }
    const std::size_t letter = std::string_view("xtybzn").find(c);
    if (letter == std::string_view::npos || count == 3 || is_seen[letter / 2]) fail();
    is_seen[letter / 2] = true;
    order[count++] = {static_cast<int>(letter / 2), sign};
    sign = 1;
  }
  if (count != 3 || sign < 0) fail();
  return order;
}

VdmConvention vdm_preset(std::string_view name, VdmSpace space) {
  VdmConvention c;
  c.space = space;
  const bool is_tnb = name == "blender" || name == "mudbox" || name == "arnold" || name == "moonray";
  if (!is_tnb && name != "vray")
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(name) + "' is none of blender, mudbox, arnold, vray and moonray");
  if (space != VdmSpace::kTangent) return c;
  c.order = parse_vdm_order(is_tnb ? "tnb" : "tbn");
  if (!is_tnb) c.midlevel = 0.5;
  return c;
}

VdmConvention vdm_convention(const VdmWords& words) {
  VdmConvention convention;
  if (!words.preset.empty()) convention = vdm_preset(words.preset, words.space.value_or(VdmSpace::kTangent));
  if (words.space) convention.space = *words.space;
  if (words.order) convention.order = *words.order;
  if (words.scale) convention.scale = *words.scale;
  if (words.midlevel) convention.midlevel = *words.midlevel;
  return convention;
}

Proxy import_vdm(const PolygonMesh& polygons, const VdmMap& source_map, const ImportConfig& config,
                 const std::string& file, ImportReport& counts) {
  counts = {};
  const VdmConvention& convention = config.convention;
  if (source_map.is_integer && source_map.channels == 3 && convention.midlevel == 0)
    throw Error(ErrorKind::kInput, file, "its map holds integers, which cannot be negative, and vectors are",
                Remedy::kDisplacementZero);
  UvQuads mesh = split_polygons(polygons, file, counts.split_faces, counts.dropped_faces);
  check_finite(mesh, file);
  counts.faces = polygons.face_count();
  VdmMap map = source_map;
  counts.bad_texels = clear_bad_texels(map, convention.midlevel);

  Proxy proxy;
  RawScan raw;
  raw.positions = mesh.positions;
  Scan narrow = shift_to_float(std::move(raw));
  counts.shift = narrow.shift;
  proxy.positions = std::move(narrow.positions);
  for (std::size_t i = 0; i < proxy.positions.size(); ++i) mesh.positions[i] = Vec3d(proxy.positions[i]);
  proxy.quads = mesh.quads;
  for (std::size_t quad = 0; quad < mesh.quads.size(); ++quad) {
    bool is_coarser = false;
    const std::uint32_t side = side_of(mesh, quad, map, config.max_side, is_coarser);
    counts.coarser_patches += is_coarser;
    counts.texels += std::uint64_t{side} * side;
    proxy.tiles.push_back({0, 0, side, 0});
  }
  if (counts.texels > config.max_texels)
    throw Error(ErrorKind::kBudget, file, "would have " + std::to_string(counts.texels) + " texels",
                Remedy::kPatchSide);
  pack_map(proxy);

  const Frames frames = make_frames(mesh);
  const Sampler sampler{mesh, frames, map, convention};
  parallel_for(mesh.quads.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t quad = begin; quad < end; ++quad) {
      const PatchTile& tile = proxy.tiles[quad];
      const double step = 1.0 / (tile.side - 1);
      const bool wraps = sampler.repeats(quad);
      for (std::uint32_t j = 0; j < tile.side; ++j)
        for (std::uint32_t i = 0; i < tile.side; ++i)
          proxy.map[texel_index(proxy, tile, i, j)] = Vec3f(sampler.at(quad, wraps, i * step, j * step));
    }
  });
  check_displacements(proxy, file);
  Bounds3f box;
  for (const Quad& quad : proxy.quads)
    for (const std::uint32_t vertex : quad) box.add(proxy.positions[vertex]);
  counts.diagonal = box.diagonal();
  weld_corners(proxy);
  counts.welded_edges = weld_edges(proxy, kWeldTolerance * counts.diagonal);
  join_edges(proxy);

  counts.patches = proxy.quads.size();
  counts.overlapping_patches = count_overlaps(sampler, proxy);
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch) {
    const double longest = proxy.tiles[patch].longest_displacement;
    counts.longest_displacement = std::max(counts.longest_displacement, longest);
    counts.long_patches += longest > counts.diagonal;
    counts.zero_area_patches +=
        quad_area(proxy, proxy.quads[patch]) <= 1e-14 * counts.diagonal * counts.diagonal;
  }
  return proxy;
}

}  // namespace rbvh
