#include "pipeline/scan/winding.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "pipeline/scan/clean.h"

namespace rbvh {
namespace {

/// One side of a face: its edge as the smaller vertex, the larger, and which way the face goes along it.
struct Side {
  std::uint32_t low, high, face;
  bool forward;
};

/// An edge of exactly two faces.
struct Joint {
  std::uint32_t a, b;
  bool agrees;  ///< the faces go along it opposite ways, as neighbours on one side of a surface do
};

std::vector<Joint> joints_of(const Scan& scan, std::vector<std::uint8_t>& has_open_edge) {
  const std::vector<std::uint32_t> first = first_equal_vertices(scan, false);
  std::vector<Side> sides;
  sides.reserve(3 * scan.triangles.size());
  for (std::uint32_t f = 0; f < scan.triangles.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t from = first[scan.triangles[f][c]], to = first[scan.triangles[f][(c + 1) % 3]];
      if (from != to) sides.push_back({std::min(from, to), std::max(from, to), f, from < to});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    if (a.low != b.low) return a.low < b.low;
    return a.high != b.high ? a.high < b.high : a.face < b.face;
  });
  std::vector<Joint> joints;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i;
    while (end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high) ++end;
    if (end - i == 2) {
      joints.push_back({sides[i].face, sides[i + 1].face, sides[i].forward != sides[i + 1].forward});
    } else {
      for (std::size_t s = i; s < end; ++s) has_open_edge[sides[s].face] = 1;
    }
    i = end;
  }
  return joints;
}

}  // namespace

WindingCounts count_winding(const Scan& scan) {
  std::vector<std::uint8_t> open(scan.triangles.size());
  WindingCounts counts;
  for (const Joint& joint : joints_of(scan, open)) {
    ++counts.edges;
    counts.opposite += !joint.agrees;
  }
  return counts;
}

WindingCounts orient_faces(Scan& scan) {
  const std::size_t count = scan.triangles.size();
  std::vector<std::uint8_t> open(count);
  const std::vector<Joint> joints = joints_of(scan, open);
  WindingCounts counts;
  counts.edges = joints.size();
  std::vector<std::uint32_t> begin(count + 1);
  for (const Joint& joint : joints) {
    counts.opposite += !joint.agrees;
    ++begin[joint.a + 1];
    ++begin[joint.b + 1];
  }
  for (std::size_t f = 0; f < count; ++f) begin[f + 1] += begin[f];
  std::vector<std::pair<std::uint32_t, bool>> neighbors(2 * joints.size());
  std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
  for (const Joint& joint : joints) {
    neighbors[at[joint.a]++] = {joint.b, joint.agrees};
    neighbors[at[joint.b]++] = {joint.a, joint.agrees};
  }

  // Which faces are to be turned, within their part: relative to the part's first face.
  std::vector<std::uint8_t> seen(count), turn(count);
  std::vector<std::uint32_t> part;
  for (std::uint32_t start = 0; start < count; ++start) {
    if (seen[start]) continue;
    part = {start};
    seen[start] = 1;
    for (std::size_t i = 0; i < part.size(); ++i)
      for (std::uint32_t n = begin[part[i]]; n < begin[part[i] + 1]; ++n) {
        const auto [other, agrees] = neighbors[n];
        if (seen[other]) continue;
        seen[other] = 1;
        turn[other] = static_cast<std::uint8_t>(turn[part[i]] ^ (agrees ? 0 : 1));
        part.push_back(other);
      }
    double volume = 0, kept = 0, turned = 0;
    bool closed = true;
    const Vec3d origin(scan.positions[scan.triangles[start][0]]);
    for (const std::uint32_t f : part) {
      const Triangle& t = scan.triangles[f];
      const Vec3d a = Vec3d(scan.positions[t[0]]) - origin, b = Vec3d(scan.positions[t[1]]) - origin,
                  c = Vec3d(scan.positions[t[2]]) - origin;
      volume += (turn[f] ? -1 : 1) * dot(a, cross(b, c));
      (turn[f] ? turned : kept) += length(cross(b - a, c - a));
      closed &= !open[f];
    }
    if (closed && volume != 0 ? volume < 0 : turned > kept)
      for (const std::uint32_t f : part) turn[f] ^= 1;
  }
  for (std::size_t f = 0; f < count; ++f) {
    if (!turn[f]) continue;
    std::swap(scan.triangles[f][1], scan.triangles[f][2]);
    ++counts.turned;
  }
  if (counts.turned > 0) scan.normals.clear();
  return counts;
}

}  // namespace rbvh
