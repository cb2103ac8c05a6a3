#include "pipeline/scan/winding.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "pipeline/scan/clean.h"

namespace rbvh {
namespace {

/// One side of a face, by its edge's smaller vertex: the larger, and which way the face goes along it.
struct Side {
  std::uint32_t high, face;
  bool forward;
};

/// An edge of exactly two faces.
struct Joint {
  std::uint32_t a, b;
  bool agrees;  ///< the faces go along it opposite ways, as neighbours on one side of a surface do
};

/// Calls on_joint(Joint) for each edge of two faces, and on_open(face) for each side at any other edge.
template <class OnJoint, class OnOpen>
void visit_edges(const Scan& scan, OnJoint&& on_joint, OnOpen&& on_open) {
  const std::vector<std::uint32_t> first = first_equal_vertices(scan, false);
  const auto each_side = [&](auto&& visit) {
    for (std::uint32_t f = 0; f < scan.triangles.size(); ++f)
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t from = first[scan.triangles[f][c]], to = first[scan.triangles[f][(c + 1) % 3]];
        if (from != to) visit(std::min(from, to), Side{std::max(from, to), f, from < to});
      }
  };
  std::vector<std::size_t> begin(scan.positions.size() + 1);  // by the smaller vertex
  each_side([&](std::uint32_t low, const Side&) { ++begin[low + 1]; });
  for (std::size_t v = 0; v + 1 < begin.size(); ++v) begin[v + 1] += begin[v];
  std::vector<Side> sides(begin.back());
  each_side([&](std::uint32_t low, const Side& side) { sides[begin[low]++] = side; });

  std::size_t from = 0;
  for (std::size_t v = 0; v + 1 < begin.size(); from = begin[v++]) {  // begin[v] is now the end
    std::sort(sides.begin() + static_cast<std::ptrdiff_t>(from),
              sides.begin() + static_cast<std::ptrdiff_t>(begin[v]), [](const Side& a, const Side& b) {
                return a.high != b.high ? a.high < b.high : a.face < b.face;
              });
    for (std::size_t i = from, end = from; i < begin[v]; i = end) {
      while (end < begin[v] && sides[end].high == sides[i].high) ++end;
      if (end - i == 2)
        on_joint(Joint{sides[i].face, sides[i + 1].face, sides[i].forward != sides[i + 1].forward});
      else
        for (std::size_t s = i; s < end; ++s) on_open(sides[s].face);
    }
  }
}

}  // namespace

void turn_face(Scan& scan, std::size_t face) {
  std::swap(scan.triangles[face][1], scan.triangles[face][2]);
  if (scan.face_textures.empty()) return;
  auto& corners = scan.face_textures[face].corners;
  std::swap(corners[1], corners[2]);
}

WindingCounts count_winding(const Scan& scan) {
  WindingCounts counts;
  visit_edges(
      scan,
      [&](const Joint& joint) {
        ++counts.edges;
        counts.opposite += !joint.agrees;
      },
      [](std::uint32_t) {});
  return counts;
}

namespace {

/// Across which joints each face has which neighbours.
struct Neighbors {
  std::vector<std::uint32_t> begin;
  std::vector<std::pair<std::uint32_t, bool>> faces;  ///< and whether the two agree
};

Neighbors neighbors_of(const std::vector<Joint>& joints, std::size_t count) {
  Neighbors all{std::vector<std::uint32_t>(count + 1), {}};
  for (const Joint& joint : joints) {
    ++all.begin[joint.a + 1];
    ++all.begin[joint.b + 1];
  }
  for (std::size_t f = 0; f < count; ++f) all.begin[f + 1] += all.begin[f];
  all.faces.resize(2 * joints.size());
  std::vector<std::uint32_t> at(all.begin.begin(), all.begin.end() - 1);
  for (const Joint& joint : joints) {
    all.faces[at[joint.a]++] = {joint.b, joint.agrees};
    all.faces[at[joint.b]++] = {joint.a, joint.agrees};
  }
  return all;
}

/// Whether a part, with the turns that make it agree, is the wrong way round as a whole.
bool is_inside_out(const Scan& scan, const std::vector<std::uint32_t>& part,
                   const std::vector<std::uint8_t>& turn, const std::vector<std::uint8_t>& open) {
  double volume = 0, kept = 0, turned = 0;
  bool closed = true;
  const Vec3d origin(scan.positions[scan.triangles[part[0]][0]]);
  for (const std::uint32_t f : part) {
    const Triangle& t = scan.triangles[f];
    const Vec3d a = Vec3d(scan.positions[t[0]]) - origin, b = Vec3d(scan.positions[t[1]]) - origin,
                c = Vec3d(scan.positions[t[2]]) - origin;
    volume += (turn[f] ? -1 : 1) * dot(a, cross(b, c));
    (turn[f] ? turned : kept) += length(cross(b - a, c - a));
    closed &= !open[f];
  }
  return closed && volume != 0 ? volume < 0 : turned > kept;
}

}  // namespace

WindingCounts orient_faces(Scan& scan) {
  const std::size_t count = scan.triangles.size();
  std::vector<std::uint8_t> open(count);
  std::vector<Joint> joints;
  visit_edges(
      scan, [&](const Joint& joint) { joints.push_back(joint); },
      [&](std::uint32_t face) { open[face] = 1; });
  WindingCounts counts;
  counts.edges = joints.size();
  for (const Joint& joint : joints) counts.opposite += !joint.agrees;
  const Neighbors neighbors = neighbors_of(joints, count);

  // Which faces are to be turned, within their part: relative to the part's first face.
  std::vector<std::uint8_t> seen(count), turn(count);
  for (std::uint32_t start = 0; start < count; ++start) {
    if (seen[start]) continue;
    std::vector<std::uint32_t> part = {start};
    seen[start] = 1;
    for (std::size_t i = 0; i < part.size(); ++i)
      for (std::uint32_t n = neighbors.begin[part[i]]; n < neighbors.begin[part[i] + 1]; ++n) {
        const auto [other, agrees] = neighbors.faces[n];
        if (seen[other]) continue;
        seen[other] = 1;
        turn[other] = static_cast<std::uint8_t>(turn[part[i]] ^ (agrees ? 0 : 1));
        part.push_back(other);
      }
    if (is_inside_out(scan, part, turn, open))
      for (const std::uint32_t f : part) turn[f] ^= 1;
  }
  for (std::size_t f = 0; f < count; ++f) {
    if (!turn[f]) continue;
    turn_face(scan, f);
    ++counts.turned;
  }
  if (counts.turned > 0) scan.normals.clear();
  return counts;
}

}  // namespace rbvh
