#include "io/load_source.h"

#include <filesystem>
#include <set>

#include "io/hash.h"
#include "io/input_file.h"
#include "io/polygon_obj.h"
#include "io/proxy_file.h"
#include "io/scan_io.h"
#include "io/texture_files.h"
#include "pipeline/scan/ingest.h"

namespace rbvh {

SourceScan load_source(const std::string& path, const MemoryBudget& memory) {
  refuse_proxy(path);
  const InputBytes bytes = read_input(path);
  check_budget(memory, std::uint64_t{bytes.size} * 3, path, "reading it");
  SourceScan source{{}, source_name(path), hash_bytes(bytes.view()), bytes.size};
  RawScan raw = parse_scan(bytes.view(), path);
  load_textures(raw, path, memory);
  source.scan = shift_to_float(std::move(raw));
  std::set<const TextureImage*> images;
  for (const Texture& texture : source.scan.textures)
    if (images.insert(texture.image.get()).second) source.bytes += texture.image->file.size();
  check_usable(source.scan, path);
  return source;
}

SourcePolygons load_polygon_source(const std::string& path, const MemoryBudget& memory) {
  const InputBytes bytes = read_input(path);
  check_budget(memory, std::uint64_t{bytes.size} * 6, path, "reading it");
  return {read_polygon_obj(bytes.view(), input_name(path)), source_name(path), hash_bytes(bytes.view())};
}

std::string source_name(const std::string& path) {
  return path == "-" ? "stdin" : std::filesystem::path(path).filename().string();
}

}  // namespace rbvh
