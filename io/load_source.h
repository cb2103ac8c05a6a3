// Reads the scan that a pair or a proxy is made of, as its file has it: nothing is cleaned or completed,
// but where there are several.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/base/memory_budget.h"
#include "pipeline/proxy/polygon_mesh.h"
#include "rbvh/scan.h"

namespace rbvh {

struct SourceScan {
  Scan scan;
  std::string name;         ///< of the file, without folders; "stdin" for "-"
  std::uint64_t hash = 0;   ///< of its bytes
  std::uint64_t bytes = 0;  ///< how many these are, and those of its textures' images
};

/// Throws Error(kInput), also where nothing finite is left or all points are equal; Error(kBudget).
SourceScan load_source(const std::string& path, const MemoryBudget& memory = {});

/// Throws Error(kInput) for what cannot be read twice: standard input and pipes.
void check_is_file(const std::string& path);

/// How several inputs are named as one.
std::string joined_name(const std::vector<std::string>& inputs);

/// Several files as one scan, merged and cleaned as by an ingest of its defaults; one alone as load_source().
/// What was left out, guessed and completed goes to `notes`. Throws as both do.
SourceScan load_sources(const std::vector<std::string>& paths, const MemoryBudget& memory,
                        std::vector<std::string>& notes);

/// A base mesh of another program, of which a proxy is made.
struct SourcePolygons {
  PolygonMesh mesh;
  std::string name;        ///< as SourceScan's
  std::uint64_t hash = 0;  ///< of the file's bytes
};

/// Reads an OBJ ("-": standard input). Throws as read_polygon_obj(), and Error(kBudget).
SourcePolygons load_polygon_source(const std::string& path, const MemoryBudget& memory = {});

/// How a pair or a proxy names the file that it was made of: SourceScan.name.
std::string source_name(const std::string& path);

}  // namespace rbvh
