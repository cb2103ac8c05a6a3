#include "io/report_text.h"

#include <spdlog/fmt/fmt.h>

#include <utility>

#include "io/report_json.h"
#include "pipeline/base/text.h"
#include "pipeline/trace/exact_words.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

/// "3 duplicate faces, 1 ..."; the ones that are not zero.
std::string list_counts(const std::vector<std::pair<std::size_t, const char*>>& counts) {
  std::string text;
  for (const auto& [count, noun] : counts)
    if (count > 0) text += (text.empty() ? "" : ", ") + counted(count, noun);
  return text;
}

}  // namespace

std::string device_line(const DeviceInfo& info) {
  return fmt::format("{}  {}  {}  ({}, {} units, {})\n", info.index, device_type(info), info.name,
                     info.platform, info.compute_units, format_bytes(info.memory_bytes));
}

std::string exact_methods_text() {
  std::string lines;
  for (const ExactTraversalInfo& t : kExactTraversals)
    lines += fmt::format("{:<14}{}; builders: {}\n", t.name, t.what, exact_builder_names(t.traversal));
  return lines;
}

std::string fidelity_table(const Json& list) {
  struct Row {
    const char *name, *pointer, *format;
  };
  static const Row kRows[] = {
      {"holes (worst view)", "/worst_view/holes", "{}"},
      {"leaks (worst view)", "/worst_view/leaks", "{}"},
      {"walls (worst view)", "/worst_view/walls", "{}"},
      {"mask mismatch, % of pixels", "/mask_mismatch_percent", "{:.3f}"},
      {"  of it at the silhouette, %", "/mismatch_at_silhouette_percent", "{:.1f}"},
      {"|dt| / diagonal: median", "/dt/median", "{:.1e}"},
      {"  p99", "/dt/p99", "{:.1e}"},
      {"  p99.9", "/dt/p99.9", "{:.1e}"},
      {"normal angle: median, degrees", "/normal_degrees/median", "{:.2f}"},
      {"  p95", "/normal_degrees/p95", "{:.2f}"},
      {"image RMSE", "/image/rmse", "{:.4f}"},
      {"  control: exact, jittered", "/image_control/rmse", "{:.4f}"},
      {"  over the control's", "/image_relative", "{:.2f}"},
      {"image PSNR, dB", "/image/psnr", "{:.1f}"},
      {"  control", "/image_control/psnr", "{:.1f}"},
      {"image SSIM", "/image/ssim", "{:.4f}"},
      {"  control", "/image_control/ssim", "{:.4f}"},
      {"level to scan: rms, % of diagonal", "/level_to_scan/rms_percent", "{:.4f}"},
      {"  max, % of diagonal", "/level_to_scan/max_percent", "{:.3f}"},
      {"  max, texels", "/level_to_scan/max_texels", "{:.1f}"},
      {"scan to level: rms, % of diagonal", "/scan_to_level/rms_percent", "{:.4f}"},
      {"  max, % of diagonal", "/scan_to_level/max_percent", "{:.3f}"},
      {"  max, texels", "/scan_to_level/max_texels", "{:.1f}"},
  };
  std::string text = fmt::format("{:<36}", "");
  for (const Json& f : list) text += fmt::format("{:>10}", f["level"].get<std::string>());
  text += "\n";
  for (const Row& row : kRows) {
    text += fmt::format("{:<36}", row.name);
    for (const Json& f : list) {
      const Json& value = f.at(Json::json_pointer(row.pointer));
      const std::string shown = value.is_null() ? "-"
                                : value.is_number_integer()
                                    ? value.dump()
                                    : fmt::format(fmt::runtime(row.format), value.get<double>());
      text += fmt::format("{:>10}", shown);
    }
    text += "\n";
  }
  return text;
}

std::string distance_text(const Json& distance) {
  std::string text;
  for (const auto& [name, value] : distance.items())
    text += fmt::format("{}: rms {:.4f}%, max {:.3f}% of the diagonal\n", name,
                        value["rms_percent"].get<double>(), value["max_percent"].get<double>());
  return text;
}

std::string file_line(const Json& json) {
  std::string text;
  for (const std::string noun :
       {"object", "instance", "level", "leaf", "patch", "texel", "vertex", "triangle"})
    if (const auto count = json.find(plural(noun)); count != json.end())
      text += (text.empty() ? "" : ", ") + counted(count->get<std::uint64_t>(), noun);
  return json["file"].get<std::string>() + ": whole (" + text + ")\n";
}

std::string missed_error(const std::string& level, float asked, float reached) {
  return fmt::format("{} {:.2g} (asked for: {:.2g})", level, reached, asked);
}

std::string larger_than_text(std::uint64_t bytes, std::uint64_t others, const std::string& other) {
  return fmt::format("{:.2f} times as large as {} ({})",
                     static_cast<double>(bytes) / static_cast<double>(others), other, format_bytes(others));
}

std::string joined_tiles_text(const LevelMeshCounts& counts) {
  if (counts.tile_quads == 0) return {};
  return fmt::format("tiles: {} quads, {} of them trimmed; gaps: {} vertices welded, {} triangles added",
                     counts.tile_quads, counts.trimmed_quads, counts.welded_vertices,
                     counts.stitch_triangles);
}

std::string mesh_text(const Scan& mesh, const LevelMeshCounts& counts) {
  if (mesh.is_cloud()) return fmt::format("{} points", mesh.positions.size());
  return fmt::format("{} vertices, {} triangles; {} open edges, {} non-manifold", mesh.positions.size(),
                     mesh.triangles.size(), counts.open_edges, counts.non_manifold_edges);
}

std::vector<std::string> manifold_lines(const ManifoldCounts& counts) {
  std::vector<std::string> lines;
  if (counts.small_components > 0)
    lines.push_back(fmt::format("left out: {} small components ({} triangles)", counts.small_components,
                                counts.small_triangles));
  if (counts.cut_edges > 0)
    lines.push_back(
        fmt::format("cut {} non-manifold edges: more than two triangles share them, or two of opposite "
                    "orientation",
                    counts.cut_edges));
  return lines;
}

std::string bake_text(const BakeReport& counts, std::uint64_t bytes, const Json& distance) {
  return fmt::format("{} patches, {} texels, {}; RMS distance {:.2g}% to the scan, {:.2g}% back",
                     counts.patches, counts.texels, format_bytes(bytes),
                     distance["proxy_to_scan"]["rms_percent"].get<double>(),
                     distance["scan_to_proxy"]["rms_percent"].get<double>());
}

std::vector<std::string> import_warnings(const ImportReport& counts) {
  std::vector<std::string> lines;
  const auto say = [&](std::uint64_t count, const char* what) {
    if (count > 0) lines.push_back(fmt::format("{} {}", count, what));
  };
  say(counts.split_faces, "faces are no quads; every face was split around its middle");
  say(counts.dropped_faces, "faces with fewer than three different corners were left out");
  say(counts.zero_area_patches, "patches have no area");
  say(counts.bad_texels, "texels are not finite, or too large (beyond 1e18); they displace nothing");
  say(counts.overlapping_patches, "patches overlap others in the map");
  say(counts.coarser_patches, "patches have fewer texels than the map; allow more texels a side");
  say(counts.long_patches,
      "patches are displaced by more than the object is long; are the map's scale and midlevel right?");
  return lines;
}

std::string import_text(const ImportReport& counts, std::uint64_t bytes) {
  return fmt::format("{} patches, {} texels, {}; {} seams welded", counts.patches, counts.texels,
                     format_bytes(bytes), counts.welded_edges);
}

std::vector<std::string> ingest_lines(const std::string& output, const IngestReport& counts,
                                      const Scan& scan) {
  std::vector<std::string> lines;
  const CleanCounts& gone = counts.cleaned;
  std::string made =
      scan.is_cloud() ? counted(counts.vertices_out, "point")
                      : counted(counts.faces_out, "triangle") + ", " + counted(counts.vertices_out, "vertex");
  if (counts.objects > 1) made += ", " + counted(counts.objects, "object");
  if (!scan.textures.empty()) made += ", " + counted(scan.textures.size(), "texture");
  lines.push_back(output + ": " + made);
  const std::string removed = list_counts({{gone.non_finite_vertices, "non-finite vertex"},
                                           {gone.non_finite_faces, "non-finite face"},
                                           {gone.duplicate_vertices, "duplicate vertex"},
                                           {gone.duplicate_faces, "duplicate face"},
                                           {gone.zero_area_faces, "zero-area face"},
                                           {gone.unreferenced_vertices, "unreferenced vertex"},
                                           {counts.far, "far point"},
                                           {counts.outliers, "outlier"},
                                           {counts.thinned, "thinned point"},
                                           {counts.small_components.components, "small component"}});
  if (!removed.empty()) lines.push_back("removed: " + removed);
  if (gone.coincident.pairs() > 0)
    lines.push_back(fmt::format(
        "coincident faces, wound both ways: {} removed (flaps without thickness), {} left with the face that "
        "closes the surface, {} with one (a sheet)",
        counted(gone.coincident.flaps, "pair"), gone.coincident.closing, gone.coincident.sheets));
  if (counts.winding.opposite > 0)
    lines.push_back(fmt::format(
        "winding: {} of {} between faces that are wound opposite ways{}", counts.winding.opposite,
        counted(counts.winding.edges, "edge"),
        counts.winding.turned > 0 ? "; " + counted(counts.winding.turned, "face") + " turned" : ""));
  const std::string added = list_counts({{counts.cloud.normals_estimated, "normal"},
                                         {counts.cloud.normals_by_viewpoint, "viewpoint-facing normal"},
                                         {counts.mesh_normals_completed, "vertex normal"},
                                         {counts.cloud.radii_estimated, "radius"}});
  if (!added.empty()) lines.push_back("estimated: " + added);
  if (scan.shift != Vec3d{}) {
    const nlohmann::json shift = {scan.shift.x, scan.shift.y, scan.shift.z};
    lines.push_back("shifted: original coordinates are these plus " + shift.dump());
  }
  return lines;
}

std::vector<std::string> update_lines(const UpdateReport& report) {
  std::uint64_t leaves = 0, removed = 0, cut = 0, added = 0;
  for (const UpdateReport::PerLevel& level : report.levels) {
    leaves += level.leaves;
    removed += level.removed;
    cut += level.cut;
    added += level.added;
  }
  std::vector<std::string> lines = report.notes;
  lines.push_back(fmt::format(
      "{:.3g}% of the surface went and {:.3g}% came; {} removed, {} cut, {} added, of {} in all levels",
      100 * report.removed_area, 100 * report.added_area, counted(removed, "leaf"), cut, added, leaves));
  return lines;
}

}  // namespace rbvh
