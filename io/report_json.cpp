#include "io/report_json.h"

#include "pipeline/measure/measure_json.h"

namespace rbvh {

using Json = nlohmann::ordered_json;

const char* device_type(const DeviceInfo& info) {
  return info.is_gpu ? "gpu" : info.is_cpu ? "cpu" : "other";
}

Json device_json(const DeviceInfo& info) {
  return {{"index", info.index},
          {"name", info.name},
          {"platform", info.platform},
          {"version", info.version},
          {"driver", info.driver},
          {"type", device_type(info)},
          {"memory_bytes", info.memory_bytes},
          {"max_buffer_bytes", info.max_buffer_bytes},
          {"compute_units", info.compute_units},
          {"int64_atomics", info.has_int64_atomics}};
}

Json ingest_json(const IngestReport& counts, const Scan& scan, const std::vector<std::string>& inputs) {
  const CleanCounts& gone = counts.cleaned;
  const Bounds3f inner = bounds(scan);
  const Bounds3d box{Vec3d(inner.lo) + scan.shift, Vec3d(inner.hi) + scan.shift};
  return {
      {"inputs", inputs},
      {"kind", scan.is_cloud() ? "cloud" : "mesh"},
      {"vertices_in", counts.vertices_in},
      {"faces_in", counts.faces_in},
      {"vertices_out", counts.vertices_out},
      {"faces_out", counts.faces_out},
      {"objects", counts.objects},
      {"textures", scan.textures.size()},
      {"removed",
       {{"non_finite_vertices", gone.non_finite_vertices},
        {"non_finite_faces", gone.non_finite_faces},
        {"duplicate_vertices", gone.duplicate_vertices},
        {"duplicate_faces", gone.duplicate_faces},
        {"zero_area_faces", gone.zero_area_faces},
        {"coincident_faces",
         {{"flaps", gone.coincident.flaps},
          {"closing", gone.coincident.closing},
          {"sheets", gone.coincident.sheets}}},
        {"unreferenced_vertices", gone.unreferenced_vertices},
        {"far", counts.far},
        {"outliers", counts.outliers},
        {"thinned", counts.thinned},
        {"small_components", counts.small_components.components},
        {"small_component_vertices", counts.small_components.vertices},
        {"small_component_faces", counts.small_components.faces}}},
      {"added",
       {{"normals_estimated", counts.cloud.normals_estimated},
        {"normals_by_viewpoint", counts.cloud.normals_by_viewpoint},
        {"mesh_normals_completed", counts.mesh_normals_completed},
        {"radii_estimated", counts.cloud.radii_estimated}}},
      {"shift", {scan.shift.x, scan.shift.y, scan.shift.z}},
      {"bounds", {{"lo", {box.lo.x, box.lo.y, box.lo.z}}, {"hi", {box.hi.x, box.hi.y, box.hi.z}}}},
      {"area", counts.area},
      {"units", scan.units.empty() ? "unknown" : scan.units},
  };
}

Json timings_json(const BuildTimings& timings) {
  return {{"simplify", timings.simplify},
          {"upload", timings.upload},
          {"partition", timings.partition},
          {"rasterize", timings.rasterize},
          {"pack", timings.pack}};
}

Json timings_json(const BakeReport& report) {
  return {{"join", report.join_seconds},
          {"decimate", report.decimate_seconds},
          {"pair", report.pair_seconds},
          {"sample", report.sample_seconds}};
}

Json levels_json(const Rbvh& rbvh, const BuildTimings& timings) {
  Json list = Json::array();
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
    const Level& level = rbvh.levels[i];
    list.push_back({{"name", level.name},
                    {"leaves", level.leaves.size()},
                    {"primitive_leaves", level.primitive_leaves.size()},
                    {"texels", std::uint64_t{level.atlas_width} * level.atlas_height},
                    {"texels_used", level.texels_used},
                    {"error", level.error},
                    {"reached", level.reached},
                    {"seconds", timings.levels[i].seconds},
                    {"fidelity", fidelity_json(level.fidelity)}});
  }
  return list;
}

Json levels_json(const Rbvh& rbvh, const RbvhBytes& bytes) {
  Json list = Json::array();
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
    const Level& level = rbvh.levels[i];
    list.push_back({{"name", level.name},
                    {"derived_from", level.derived_from},
                    {"bytes", bytes.levels[i]},
                    {"fidelity", fidelity_json(level.fidelity)}});
  }
  return list;
}

Json update_json(const UpdateReport& report) {
  Json levels = Json::array();
  for (const UpdateReport::PerLevel& level : report.levels)
    levels.push_back({{"name", level.name},
                      {"leaves", level.leaves},
                      {"removed", level.removed},
                      {"cut", level.cut},
                      {"added", level.added}});
  return {{"levels", std::move(levels)},
          {"change", {{"removed", report.removed_area}, {"added", report.added_area}}},
          {"phases", {{"cut", report.cut}, {"build", report.build}, {"join", report.join}}},
          {"notes", report.notes}};
}

Json mesh_json(const Scan& mesh, const LevelMeshCounts& counts) {
  Json json = {{"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}};
  if (mesh.is_cloud()) return json;
  json["tile_quads"] = counts.tile_quads;
  json["trimmed_quads"] = counts.trimmed_quads;
  json["primitive_triangles"] = counts.primitive_triangles;
  json["welded_vertices"] = counts.welded_vertices;
  json["stitch_triangles"] = counts.stitch_triangles;
  json["primitive_open_edges"] = counts.primitive_open_edges;
  json["open_edges"] = counts.open_edges;
  json["non_manifold_edges"] = counts.non_manifold_edges;
  return json;
}

Json bake_json(const BakeReport& report) {
  Json json;
  json["counts"] = {{"triangles_in", report.triangles_in},
                    {"flat_triangles", report.mesh.flat_triangles},
                    {"small_components", report.mesh.small_components},
                    {"small_component_triangles", report.mesh.small_triangles},
                    {"cut_edges", report.mesh.cut_edges},
                    {"cut_vertices", report.mesh.cut_vertices},
                    {"open_edges", report.mesh.open_edges},
                    {"components", report.mesh.components},
                    {"base_triangles", report.base_triangles},
                    {"alone_triangles", report.alone_triangles},
                    {"folded_steps", report.folded_steps},
                    {"patches", report.patches},
                    {"patches_of_level", report.patches_of_level},
                    {"patches_at_limit", report.patches_at_limit},
                    {"texels", report.texels},
                    {"projected_texels", report.projected_texels}};
  json["distortion"] = {{"stretch_median", report.stretch_median},
                        {"stretch_p95", report.stretch_p95},
                        {"area_p95", report.area_p95}};
  json["longest_displacement"] = report.longest_displacement;
  return json;
}

Json import_json(const ImportReport& report) {
  Json json;
  json["counts"] = {{"faces", report.faces},
                    {"patches", report.patches},
                    {"texels", report.texels},
                    {"split_faces", report.split_faces},
                    {"dropped_faces", report.dropped_faces},
                    {"zero_area_patches", report.zero_area_patches},
                    {"bad_texels", report.bad_texels},
                    {"welded_edges", report.welded_edges},
                    {"overlapping_patches", report.overlapping_patches},
                    {"coarser_patches", report.coarser_patches},
                    {"long_patches", report.long_patches}};
  json["longest_displacement"] = report.longest_displacement;
  return json;
}

Json proxy_bytes_json(const ProxyHeader& header) {
  return {{"mesh", header.mesh_bytes}, {"map", header.map_bytes}, {"sidecar", header.sidecar_bytes}};
}

Json patch_tracing_json(const PatchTracer& tracer) {
  const ProxyStats& s = stats(tracer);
  const ProxyBytes b = bytes(tracer);
  return {{"pairs", s.items},
          {"patches_built", s.built},
          {"micro_quads_built", s.built_leaves},
          {"patches_evicted", s.evicted},
          {"base_bytes", b.base},
          {"map_bytes", b.maps},
          {"cache_bytes", b.cache},
          {"cached_bytes", b.cached}};
}

}  // namespace rbvh
