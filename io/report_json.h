// What the reports of stages contain: counts, bytes, devices, levels.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "pipeline/device/device.h"
#include "pipeline/proxy/bake.h"
#include "pipeline/proxy/import_vdm.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/scan/ingest.h"
#include "pipeline/trace/trace_patch.h"
#include "rbvh/mesh.h"
#include "rbvh/update.h"

namespace rbvh {

nlohmann::ordered_json device_json(const DeviceInfo& info);

/// "gpu", "cpu" or "other".
const char* device_type(const DeviceInfo& info);

/// "inputs", "kind", counts of what was read, removed, added and is left, "shift", "bounds", "area", "units".
nlohmann::ordered_json ingest_json(const IngestReport& counts, const Scan& scan,
                                   const std::vector<std::string>& inputs);

/// The phases of a build, and of a bake.
nlohmann::ordered_json timings_json(const BuildTimings& timings);
nlohmann::ordered_json timings_json(const BakeReport& report);

/// A list of the levels: counts, the seconds that each took, its fidelity.
nlohmann::ordered_json levels_json(const Rbvh& rbvh, const BuildTimings& timings);

/// A list of the levels: what each is derived from, its bytes, its fidelity.
nlohmann::ordered_json levels_json(const Rbvh& rbvh, const RbvhBytes& bytes);

/// "levels", "change" (of the surface) and "notes"; seconds by phase in "phases".
nlohmann::ordered_json update_json(const UpdateReport& report);

/// Counts of a level's mesh, or of a cloud's points.
nlohmann::ordered_json mesh_json(const Scan& mesh, const LevelMeshCounts& counts);

/// "counts", "distortion" and "longest_displacement".
nlohmann::ordered_json bake_json(const BakeReport& report);

/// "counts" and "longest_displacement".
nlohmann::ordered_json import_json(const ImportReport& report);

/// Of a proxy's three files.
nlohmann::ordered_json proxy_bytes_json(const ProxyHeader& header);

/// What tracing proxies took: work items, patches built and evicted, bytes on the device.
nlohmann::ordered_json patch_tracing_json(const PatchTracer& tracer);

}  // namespace rbvh
