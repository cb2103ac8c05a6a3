#include "chunks/chunk_report.h"

namespace rbvh {

nlohmann::ordered_json chunks_json(const ChunkReport& report) {
  nlohmann::ordered_json json = {
      {"counts",
       {{"vertices", report.vertices},
        {"triangles", report.triangles},
        {"parts", report.chunks},
        {"resumed", report.resumed}}},
      {"bytes",
       {{"scan", report.scan_bytes},
        {"pair", report.bytes},
        {"pair_to_scan", static_cast<double>(report.bytes) / static_cast<double>(report.scan_bytes)}}},
      {"levels", nlohmann::ordered_json::array()}};
  for (const ChunkReport::Level& level : report.levels)
    json["levels"].push_back({{"name", level.name},
                              {"leaves", level.leaves},
                              {"bytes", level.bytes},
                              {"error", level.error},
                              {"reached", level.reached}});
  return json;
}

}  // namespace rbvh
