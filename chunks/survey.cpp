#include "chunks/survey.h"

#include <cmath>

#include "io/hash.h"
#include "pipeline/base/error.h"
#include "pipeline/scan/float_shift.h"

namespace rbvh {
namespace {

/// A cloud's radius, as read_ply() finds it.
std::optional<PlyField> radius_field(const BigPly& ply) {
  std::size_t at = 0;
  for (const ply::Property& property : ply.header.elements[0].properties) {
    if (property.name == "radius") return PlyField{property.type, at};
    at += ply::size_of(property.type);
  }
  return std::nullopt;
}

void pass_points(const ScanSurvey& survey, const std::function<void(const PassedPrimitive&)>& visit,
                 const std::function<void(double)>& on_piece) {
  const BigPly& ply = survey.ply;
  const std::optional<PlyField> radius = radius_field(ply);
  RBVH_CHECK(radius.has_value());
  for_each_piece(ply, ply.vertices,
                 [&](std::uint64_t first, std::size_t count, std::span<const std::byte> entries) {
                   PassedPrimitive point;
                   for (std::size_t i = 0; i < count; ++i) {
                     const std::byte* entry = entries.data() + i * ply.vertices.bytes;
                     const auto number = static_cast<std::uint32_t>(first + i);
                     point.corners = {number, number, number};
                     point.center = static_cast<Vec3f>(position_at(entry, ply) - survey.moved);
                     point.box = {point.center, point.center};
                     point.radius = static_cast<float>(number_at(entry, *radius));
                     point.area = std::isfinite(point.radius)
                                      ? static_cast<double>(point.radius) * static_cast<double>(point.radius)
                                      : 0;
                     visit(point);
                   }
                   on_piece(static_cast<double>(first + count) / static_cast<double>(ply.vertices.count));
                 });
}

}  // namespace

ScanSurvey survey_scan(const BigPly& ply, const Progress& progress) {
  if (ply.is_cloud() && !(ply.has_normals && ply.has_radii))
    throw Error(ErrorKind::kInput, ply.path, "the points have no normals or radii; ingest it first");
  ScanSurvey survey;
  survey.ply = ply;
  Bounds3d box;
  Hasher hash;
  const auto add_to_hash = [&](std::uint64_t first, std::size_t count, std::span<const std::byte> bytes) {
    hash.add(bytes);
    report(progress, "survey", static_cast<double>(first + count) / static_cast<double>(ply.bytes));
  };
  for_each_piece(ply, {ply.vertices.at, 0, 1}, add_to_hash);
  for_each_piece(ply, ply.vertices,
                 [&](std::uint64_t first, std::size_t count, std::span<const std::byte> entries) {
                   hash.add(entries);
                   for (std::size_t i = 0; i < count; ++i) {
                     const Vec3d p = position_at(entries.data() + i * ply.vertices.bytes, ply);
                     if (!is_finite(static_cast<Vec3f>(p)))
                       throw Error(ErrorKind::kInput, ply.path,
                                   "vertex " + std::to_string(first + i) + " is not finite; ingest it first");
                     box.add(p);
                   }
                 });
  for_each_piece(ply, {ply.bytes - ply.faces.at, ply.faces.at, 1}, add_to_hash);
  survey.hash = hash.value();
  survey.source_hash = ply.source_hash.value_or(survey.hash);
  survey.moved = float_shift(box);
  survey.shift = ply.header.shift + survey.moved;
  survey.box = {static_cast<Vec3f>(box.lo - survey.moved), static_cast<Vec3f>(box.hi - survey.moved)};
  if (!(survey.box.diagonal() > 0))
    throw Error(ErrorKind::kInput, ply.path, "all points are equal: there is no surface");
  return survey;
}

void for_each_primitive(const ScanSurvey& survey, std::uint64_t cache_bytes,
                        const std::function<void(const PassedPrimitive&)>& visit,
                        const std::function<void(double)>& on_piece) {
  const BigPly& ply = survey.ply;
  if (ply.is_cloud()) return pass_points(survey, visit, on_piece);
  VertexCache vertices(ply, survey.moved, cache_bytes);
  for_each_piece(ply, ply.faces,
                 [&](std::uint64_t first, std::size_t count, std::span<const std::byte> entries) {
                   PassedPrimitive triangle;
                   for (std::size_t i = 0; i < count; ++i) {
                     const std::byte* entry = entries.data() + i * ply.faces.bytes;
                     triangle.corners = triangle_at(ply, first + i, entry);
                     if (ply.object_id)
                       triangle.object_id = static_cast<std::int32_t>(number_at(entry, *ply.object_id));
                     const Vec3f a = vertices.at(triangle.corners[0]), b = vertices.at(triangle.corners[1]),
                                 c = vertices.at(triangle.corners[2]);
                     triangle.box = {a, a};
                     triangle.box.add(b);
                     triangle.box.add(c);
                     triangle.center = triangle.box.center();
                     const Vec3d from(a);
                     triangle.area = length(cross(Vec3d(b) - from, Vec3d(c) - from)) / 2;
                     visit(triangle);
                   }
                   on_piece(static_cast<double>(first + count) / static_cast<double>(ply.faces.count));
                 });
}

SpaceGrid place_grid(const Bounds3f& box) {
  SpaceGrid grid;
  grid.lo = box.lo;
  const Vec3f extent = box.extent();
  for (int axis = 0; axis < 3; ++axis) {
    grid.box[axis] = extent[axis] / kGridSide;
    grid.boxes_per_unit[axis] = extent[axis] > 0 ? kGridSide / extent[axis] : 0;
  }
  return grid;
}

ScanMap map_scan(const ScanSurvey& survey, std::uint64_t cache_bytes, const Progress& progress) {
  ScanMap map;
  SpaceGrid& grid = map.grid;
  grid = place_grid(survey.box);
  grid.counts.resize(std::size_t{kGridSide} * kGridSide * kGridSide);
  for_each_primitive(
      survey, cache_bytes,
      [&](const PassedPrimitive& primitive) {
        ++grid.counts[SpaceGrid::index(grid.place(primitive.center))];
        map.area += primitive.area;
        const Vec3f half = primitive.box.extent() * 0.5f;
        map.reach = std::max({map.reach, half.x, half.y, half.z});
        if (std::isfinite(primitive.radius)) map.radius = std::max(map.radius, primitive.radius);
      },
      [&](double fraction) { report(progress, "map", fraction); });
  return map;
}

}  // namespace rbvh
