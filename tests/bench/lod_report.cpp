#include "tests/bench/lod_report.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace rbvh::bench {
namespace {

using Json = nlohmann::ordered_json;

Json or_null(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

Json rate_json(const std::optional<RaysResult>& rays) { return rays ? Json(rays->mrays()) : Json(nullptr); }

Json error_json(const LodFigures& f) {
  const HitFidelity& all = f.views.all;
  Json j = {{"median", or_null(all.dt.median)},
            {"p99", or_null(all.dt.p99)},
            {"p999", or_null(all.dt.p999)},
            {"normal_p95_degrees", or_null(all.normal_degrees.p95)},
            {"mask_percent", all.mismatch_percent()},
            {"holes", all.holes},
            {"leaks", all.leaks},
            {"walls", all.walls},
            {"worst_holes", f.views.worst_holes},
            {"worst_leaks", f.views.worst_leaks},
            {"worst_walls", f.views.worst_walls}};
  if (f.to_scan_rms) j["to_scan_rms"] = or_null(f.to_scan_rms);
  if (f.from_scan_rms) j["from_scan_rms"] = or_null(f.from_scan_rms);
  return j;
}

void add_figures(Json& j, const LodFigures& f) {
  j["error"] = error_json(f);
  j["disk_bytes"] = f.disk_bytes;
  j["memory_bytes"] = f.memory_bytes;
  j["primary_mrays"] = rate_json(f.primary);
  j["diffuse_mrays"] = rate_json(f.diffuse);
  j["build_s"] = or_null(f.build_s);
}

Json twin_json(const TwinFigures& twin) {
  Json j = {{"triangles", twin.triangles}, {"vertices", twin.vertices}, {"trials", twin.trials}};
  add_figures(j, twin);
  j["disk_bytes_zstd"] = twin.stored.zstd;
  j["disk_bytes_best"] = twin.stored.best;
  j["decimate_s"] = or_null(twin.decimate_s);
  if (twin.primary) j["primary_by"] = twin.primary->name;
  if (twin.diffuse) j["diffuse_by"] = twin.diffuse->name;
  return j;
}

std::string number(const char* pattern, const std::optional<double>& value) {
  return value && std::isfinite(*value) ? format(pattern, *value) : "-";
}

std::string rate(const std::optional<RaysResult>& rays) { return rays ? format("%.1f", rays->mrays()) : "-"; }

std::string faults(std::uint64_t all, std::uint64_t worst) {
  return format("%llu (%llu)", static_cast<unsigned long long>(all), static_cast<unsigned long long>(worst));
}

std::string cells(const LodFigures& f) {
  const HitFidelity& all = f.views.all;
  return format(" %.2e | %.2e | %.3f | ", all.dt.median, all.dt.p99, all.mismatch_percent()) +
         faults(all.holes, f.views.worst_holes) + " | " + faults(all.leaks, f.views.worst_leaks) + " | " +
         faults(all.walls, f.views.worst_walls) +
         format(" | %.1f | %.1f | ", static_cast<double>(f.disk_bytes) * 1e-3,
                static_cast<double>(f.memory_bytes) * 1e-3) +
         rate(f.primary) + " | " + rate(f.diffuse) + " | " + number("%.2f", f.build_s) + " |\n";
}

/// The level's over the twin's; "-" where the twin has none.
std::string ratio_cells(const LodResult& r) {
  const TwinFigures& twin = *r.twin;
  const HitFidelity &own = r.figures.views.all, &other = twin.views.all;
  const auto ratio = [](auto a, auto b) {
    return " " + number("%.2f", static_cast<double>(a) / static_cast<double>(b)) + " |";
  };
  const double no_time = std::numeric_limits<double>::quiet_NaN();
  return ratio(own.dt.median, other.dt.median) + ratio(own.dt.p99, other.dt.p99) +
         ratio(own.mismatches, other.mismatches) + " | | |" + ratio(r.figures.disk_bytes, twin.disk_bytes) +
         ratio(r.figures.memory_bytes, twin.memory_bytes) + " " + number("%.2f", r.primary_of_twin) + " | " +
         number("%.2f", r.diffuse_of_twin) + " |" +
         ratio(r.figures.build_s.value_or(no_time), twin.build_s.value_or(no_time)) + "\n";
}

}  // namespace

std::string markdown(const std::vector<LodResult>& results) {
  std::string out =
      "Errors are of |t difference| / diagonal; faults are sums over the views (worst view); rates are "
      "million "
      "rays per second.\n\n"
      "| Scan | | Triangles | Median | p99 | Mask [%] | Holes | Leaks | Walls | Disk [kB] | Memory [kB] | "
      "Primary | Diffuse | Build [s] |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const LodResult& r : results) {
    out += "| " + r.scan + " | " + r.level + " | |" + cells(r.figures);
    if (!r.twin) continue;
    out += format("| | twin | %zu |", r.twin->triangles) + cells(*r.twin);
    out += "| | level / twin | |" + ratio_cells(r);
  }
  return out;
}

std::string json(const std::vector<LodResult>& results) {
  Json all = Json::array();
  for (const LodResult& r : results) {
    Json j = {{"scan", r.scan}, {"level", r.level}, {"scan_triangles", r.scan_triangles}};
    add_figures(j, r.figures);
    j["primary_of_twin"] = or_null(r.primary_of_twin);
    j["diffuse_of_twin"] = or_null(r.diffuse_of_twin);
    j["twin"] = r.twin ? twin_json(*r.twin) : Json(nullptr);
    all.push_back(j);
  }
  return all.dump(2) + "\n";
}

}  // namespace rbvh::bench
