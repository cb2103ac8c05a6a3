#include "pipeline/scan/simplify.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "pipeline/base/parallel_for.h"
#include "pipeline/scan/collapse_edges.h"
#include "pipeline/scan/open_vertices.h"

namespace rbvh {
namespace {

/// Of each vertex that a triangle uses the first that agrees with it in these.
std::vector<std::uint32_t> first_alike(const Scan& scan, const std::vector<meshopt_Stream>& streams) {
  const std::size_t count = scan.positions.size();
  std::vector<std::uint32_t> first_of(count);
  const std::size_t unique = meshopt_generateVertexRemapMulti(
      first_of.data(), reinterpret_cast<const unsigned int*>(scan.triangles.data()),
      3 * scan.triangles.size(), count, streams.data(), streams.size());
  // From the new numbers to the first vertex of each; vertices that no triangle uses have none.
  std::vector<std::uint32_t> first(unique, 0xffffffffu);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (first_of[i] == 0xffffffffu) continue;
    std::uint32_t& vertex = first[first_of[i]];
    vertex = std::min(vertex, i);
    first_of[i] = vertex;
  }
  return first_of;
}

std::vector<std::uint32_t> first_at_place(const Scan& scan) {
  return first_alike(scan, {{scan.positions.data(), sizeof(Vec3f), sizeof(Vec3f)}});
}

/// Vertices that agree in all they have are one. `places`: of each the first at its place.
std::vector<std::uint32_t> weld(const Scan& scan, const std::vector<std::uint32_t>& places) {
  if (scan.normals.empty() && scan.colors.empty()) return places;
  std::vector<meshopt_Stream> streams = {{scan.positions.data(), sizeof(Vec3f), sizeof(Vec3f)}};
  if (!scan.normals.empty()) streams.push_back({scan.normals.data(), sizeof(Vec3f), sizeof(Vec3f)});
  if (!scan.colors.empty()) streams.push_back({scan.colors.data(), sizeof(Color8), sizeof(Color8)});
  return first_alike(scan, streams);
}

/// Of open vertices in one cell of close_seams(), so many with attributes of their own.
constexpr std::size_t kMostKinds = 8;

/// Makes one of open vertices in one cell of a grid, unless their attributes differ or a triangle would
/// vanish. Returns whether there are any.
bool close_seams(const Scan& scan, float cell, const std::vector<bool>& open,
                 std::vector<Triangle>& triangles) {
  const Vec3f origin = bounds(scan).lo;
  const auto are_alike = [&](std::uint32_t a, std::uint32_t b) {
    return (scan.normals.empty() || dot(scan.normals[a], scan.normals[b]) >= kAlikeNormal) &&
           (scan.colors.empty() || scan.colors[a] == scan.colors[b]);
  };
  std::map<std::array<std::int64_t, 3>, std::vector<std::uint32_t>> cells;
  std::vector<std::uint32_t> now(scan.positions.size());
  std::iota(now.begin(), now.end(), 0u);
  bool any = false;
  for (std::uint32_t v = 0; v < open.size(); ++v) {
    if (!open[v]) continue;
    const Vec3f p = (scan.positions[v] - origin) * (1 / cell);
    std::vector<std::uint32_t>& others = cells[{std::llround(p.x), std::llround(p.y), std::llround(p.z)}];
    const auto first =
        std::find_if(others.begin(), others.end(), [&](std::uint32_t w) { return are_alike(w, v); });
    if (first != others.end()) {
      now[v] = *first;
      any = true;
    } else if (others.size() < kMostKinds) {
      others.push_back(v);
    }
  }
  if (!any) return false;
  for (const Triangle& t : triangles)
    if (now[t[0]] == now[t[1]] || now[t[1]] == now[t[2]] || now[t[2]] == now[t[0]])
      for (const std::uint32_t corner : t) now[corner] = corner;
  for (Triangle& t : triangles)
    for (std::uint32_t& corner : t) corner = now[corner];
  return true;
}

/// Two edges of the surface that are no further apart than rounding puts them are one; the closest ones
/// first, as the wrong two could meet where triangles are as small.
void close_seams(const Scan& scan, float error, const std::vector<std::uint8_t>& stays,
                 std::vector<Triangle>& triangles) {
  const auto find_open = [&] {
    std::vector<bool> open = open_vertices(scan.positions.size(), triangles);
    for (std::size_t v = 0; v < stays.size(); ++v)
      if (stays[v] != 0) open[v] = false;
    return open;
  };
  std::vector<bool> open = find_open();
  for (const float closer : {1.0f / 64, 1.0f})
    if (close_seams(scan, closer * kLatticeStep * error, open, triangles)) open = find_open();
}

/// Triangles that are simplified together: what they need stays in the cache, and each part has a thread.
constexpr std::size_t kPartTriangles = 1 << 14;
/// Of the error, what a step may cost: most cost less, and vertices settle afterwards.
constexpr float kStepError = 1.5f;

/// The triangles of one object, by vertices; `places`: of each vertex the first at its place; `positions`:
/// those of places are moved, unless they must stay.
struct Object {
  std::vector<Vec3f>& positions;
  const std::vector<std::uint32_t>& places;
  const std::vector<std::uint8_t>& stays;  ///< of each place whether it must; empty: none
  std::vector<Triangle> triangles;
};

/// Orders triangles so that one half lies before the other along the longest axis.
void halve(const Object& object, std::span<std::uint32_t> triangles) {
  const auto first_corner = [&](std::uint32_t i) { return object.positions[object.triangles[i][0]]; };
  Bounds3f box;
  for (const std::uint32_t i : triangles) box.add(first_corner(i));
  const Vec3f e = box.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  const auto middle = triangles.begin() + static_cast<std::ptrdiff_t>(triangles.size() / 2);
  std::nth_element(triangles.begin(), middle, triangles.end(), [&](std::uint32_t a, std::uint32_t b) {
    const float at_a = first_corner(a)[axis], at_b = first_corner(b)[axis];
    return at_a < at_b || (at_a == at_b && a < b);
  });
}

/// Halves the triangles until they are few enough.
std::vector<std::span<std::uint32_t>> split_parts(const Object& object, std::span<std::uint32_t> triangles) {
  std::vector<std::span<std::uint32_t>> parts = {triangles};
  const auto is_large = [](const auto& part) { return part.size() > kPartTriangles; };
  while (std::any_of(parts.begin(), parts.end(), is_large)) {
    parallel_for(parts.size(), 1, [&](std::size_t i, std::size_t) {
      if (is_large(parts[i])) halve(object, parts[i]);
    });
    std::vector<std::span<std::uint32_t>> halves;
    for (const auto& part : parts) {
      if (!is_large(part)) {
        halves.push_back(part);
        continue;
      }
      halves.push_back(part.first(part.size() / 2));
      halves.push_back(part.subspan(part.size() / 2));
    }
    parts = std::move(halves);
  }
  return parts;
}

/// A part as it is and as it becomes.
struct Part {
  CollapseMesh mesh;
  std::vector<std::uint32_t> places;  ///< of the mesh's
};

/// `stays`: of each of the object's places whether it must.
Part simplify_part(const Object& object, std::span<const std::uint32_t> triangles,
                   const std::vector<std::uint8_t>& stays, float error) {
  Part part;
  CollapseMesh& mesh = part.mesh;
  std::uint32_t lo = 0xffffffffu, hi = 0;  // places' numbers are close together in a part of most scans
  for (const std::uint32_t i : triangles)
    for (const std::uint32_t v : object.triangles[i]) {
      lo = std::min(lo, object.places[v]);
      hi = std::max(hi, object.places[v]);
    }
  std::vector<std::uint32_t> numbers(hi - lo + std::size_t{1}, 0xffffffffu);
  for (const std::uint32_t i : triangles) {
    mesh.vertices.push_back(object.triangles[i]);
    Triangle& t = mesh.triangles.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t place = object.places[object.triangles[i][c]];
      std::uint32_t& number = numbers[place - lo];
      if (number == 0xffffffffu) {
        number = static_cast<std::uint32_t>(part.places.size());
        part.places.push_back(place);
        mesh.places.push_back(object.positions[place]);
        mesh.stays.push_back(stays[place] != 0 || (!object.stays.empty() && object.stays[place] != 0) ? 1
                                                                                                      : 0);
      }
      t[c] = number;
    }
  }
  collapse_edges(mesh, kStepError * error);
  return part;
}

/// Puts what parts became into the object, after triangles that are in none.
void replace(Object& object, std::vector<Triangle> kept, const std::vector<Part>& parts) {
  object.triangles = std::move(kept);
  for (const Part& part : parts) {
    object.triangles.insert(object.triangles.end(), part.mesh.vertices.begin(), part.mesh.vertices.end());
    for (std::size_t i = 0; i < part.places.size(); ++i)
      object.positions[part.places[i]] = part.mesh.places[i];
  }
}

/// In parts, at the places of several of which the object stays; returns these.
std::vector<std::uint8_t> simplify_parts(Object& object, float error) {
  std::vector<std::uint32_t> triangles(object.triangles.size());
  std::iota(triangles.begin(), triangles.end(), 0u);
  const std::vector<std::span<std::uint32_t>> parts = split_parts(object, triangles);
  std::vector<std::uint8_t> is_shared(object.positions.size());
  std::vector<std::uint32_t> part_of(object.positions.size());  // 1 + the last part that uses the place
  for (std::uint32_t k = 0; k < parts.size(); ++k)
    for (const std::uint32_t i : parts[k])
      for (const std::uint32_t v : object.triangles[i]) {
        const std::uint32_t place = object.places[v], before = std::exchange(part_of[place], k + 1);
        if (before != 0 && before != k + 1) is_shared[place] = 1;
      }
  std::vector<Part> simplified(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      simplified[i] = simplify_part(object, parts[i], is_shared, error);
  });
  replace(object, {}, simplified);
  return is_shared;
}

/// At the places of several parts, among those around them, which stay.
void simplify_borders(Object& object, const std::vector<std::uint8_t>& is_shared, float error) {
  const auto mark = [&](std::vector<std::uint8_t>& marks, const std::vector<std::uint8_t>& of) {
    for (const Triangle& t : object.triangles)
      if (std::any_of(t.begin(), t.end(), [&](std::uint32_t v) { return of[object.places[v]] != 0; }))
        for (const std::uint32_t v : t) marks[object.places[v]] = 1;
  };
  std::vector<std::uint8_t> is_near(is_shared.size()), stays(is_shared.size());
  mark(is_near, is_shared);
  for (std::size_t i = 0; i < stays.size(); ++i) stays[i] = is_shared[i] == 0 ? 1 : 0;
  std::vector<std::uint32_t> near;
  std::vector<Triangle> kept;
  for (std::uint32_t i = 0; i < object.triangles.size(); ++i) {
    const Triangle& t = object.triangles[i];
    if (std::any_of(t.begin(), t.end(), [&](std::uint32_t v) { return is_near[object.places[v]] != 0; }))
      near.push_back(i);
    else
      kept.push_back(t);
  }
  if (!near.empty()) replace(object, std::move(kept), {simplify_part(object, near, stays, error)});
}

/// Its triangles are those that are left.
void simplify_object(Object& object, float error) {
  if (object.triangles.empty()) return;
  const std::vector<std::uint8_t> is_shared = simplify_parts(object, error);
  simplify_borders(object, is_shared, error);
}

/// The triangles' corners after welding, by object; those that weld to nothing go.
std::map<std::int32_t, std::vector<Triangle>> by_object(const Scan& scan,
                                                        const std::vector<std::uint32_t>& places,
                                                        const std::vector<std::uint8_t>& stays, float error) {
  const std::vector<std::uint32_t> first_of = weld(scan, places);
  std::vector<Triangle> triangles = scan.triangles;
  for (Triangle& t : triangles)
    for (std::uint32_t& corner : t) corner = first_of[corner];
  if (error > 0) close_seams(scan, error, stays, triangles);
  std::map<std::int32_t, std::vector<Triangle>> objects;
  for (std::size_t i = 0; i < scan.triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    const Triangle at{places[t[0]], places[t[1]], places[t[2]]};
    if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) continue;
    objects[scan.object_ids.empty() ? 0 : scan.object_ids[i]].push_back(t);
  }
  return objects;
}

/// Where more of the triangles are narrower than half a step's error, a finer step comes before it:
/// boundaries that are round would go at once, as no edge there is sharp yet.
constexpr double kMostNarrow = 1.0 / 64;
constexpr float kNarrow = 0.5f, kFinerStep = 1.0f / 8;
constexpr int kMostSteps = 6;

bool is_fine(const Scan& scan, float width) {
  std::atomic<std::size_t> narrow = 0;
  parallel_for(scan.triangles.size(), kPartTriangles, [&](std::size_t begin, std::size_t end) {
    narrow += static_cast<std::size_t>(std::count_if(
        scan.triangles.begin() + static_cast<std::ptrdiff_t>(begin),
        scan.triangles.begin() + static_cast<std::ptrdiff_t>(end), [&](const Triangle& t) {
          const Vec3f a = scan.positions[t[0]], b = scan.positions[t[1]], c = scan.positions[t[2]];
          const float twice = length(cross(b - a, c - a)),
                      longest = std::max({length(b - a), length(c - b), length(a - c)});
          return twice > 0 && twice < width * longest;
        }));
  });
  return static_cast<double>(narrow) > kMostNarrow * static_cast<double>(scan.triangles.size());
}

/// `stays`: of each vertex whether it must, or empty.
Scan simplify_once(const Scan& scan, float error, std::vector<std::uint8_t>& stays) {
  Scan result;
  std::vector<std::uint8_t> result_stays;
  result.shift = scan.shift;
  std::vector<std::uint32_t> numbers(scan.positions.size(), 0xffffffffu);
  const std::vector<std::uint32_t> places = first_at_place(scan);
  std::vector<Vec3f> positions = scan.positions;
  for (std::size_t v = 0; v < stays.size(); ++v)  // vertices that no triangle uses have no place
    if (stays[v] != 0 && places[v] < stays.size()) stays[places[v]] = 1;
  for (auto& [id, triangles] : by_object(scan, places, stays, error)) {
    const std::vector<Triangle> before = triangles;
    Object object{positions, places, stays, std::move(triangles)};
    simplify_object(object, error);
    for (const Triangle& t : object.triangles) {
      Triangle& triangle = result.triangles.emplace_back();
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const std::uint32_t vertex = t[corner];
        std::uint32_t& number = numbers[vertex];
        if (number == 0xffffffffu) {
          number = static_cast<std::uint32_t>(result.positions.size());
          result.positions.push_back(positions[places[vertex]]);
          if (!stays.empty()) result_stays.push_back(stays[places[vertex]]);
          if (!scan.normals.empty()) result.normals.push_back(scan.normals[vertex]);
          if (!scan.colors.empty()) result.colors.push_back(scan.colors[vertex]);
        }
        triangle[corner] = number;
      }
      if (!scan.object_ids.empty()) result.object_ids.push_back(id);
    }
    for (const Triangle& t : before)  // another object begins with the scan's own places
      for (const std::uint32_t vertex : t) {
        numbers[vertex] = 0xffffffffu;
        positions[places[vertex]] = scan.positions[places[vertex]];
      }
  }
  stays = std::move(result_stays);
  return result;
}

}  // namespace

Scan simplify(const Scan& scan, float error, std::vector<std::uint8_t>* stays) {
  if (scan.is_cloud()) return scan;
  std::vector<std::uint8_t> none;
  if (stays == nullptr) stays = &none;
  Scan result;
  const Scan* from = &scan;
  std::vector<float> steps = {error};
  while (steps.size() < kMostSteps && is_fine(scan, kNarrow * steps.back()))
    steps.push_back(kFinerStep * steps.back());
  for (; !steps.empty(); steps.pop_back()) {
    result = simplify_once(*from, steps.back(), *stays);
    from = &result;
  }
  return result;
}

}  // namespace rbvh
