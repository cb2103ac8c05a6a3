#include "io/load_source.h"

#include <filesystem>
#include <set>

#include "io/hash.h"
#include "io/input_file.h"
#include "io/polygon_obj.h"
#include "io/proxy_file.h"
#include "io/report_text.h"
#include "io/scan_io.h"
#include "io/texture_files.h"
#include "pipeline/base/error.h"
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

void check_is_file(const std::string& path) {
  std::error_code code;
  const std::filesystem::file_status status = std::filesystem::status(path, code);
  if (path == "-" || (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)))
    throw Error(ErrorKind::kInput, input_name(path), "cannot be read twice, as is wanted here; name a file");
}

std::string joined_name(const std::vector<std::string>& inputs) {
  return inputs.size() == 1 ? input_name(inputs[0])
                            : input_name(inputs[0]) + " and " + std::to_string(inputs.size() - 1) + " more";
}

SourceScan load_sources(const std::vector<std::string>& paths, const MemoryBudget& memory,
                        std::vector<std::string>& notes) {
  if (paths.size() == 1) return load_source(paths[0], memory);
  SourceScan source;
  source.name = source_name(joined_name(paths));
  std::string hashes;
  for (const std::string& path : paths) {
    check_is_file(path);
    hashes += hash_digits(hash_file(path));
    source.bytes += std::filesystem::file_size(path);
  }
  source.hash = hash_bytes(hashes);
  RawScan all = read_scans(paths, memory, [&](const std::string& path, const std::string& note) {
    notes.push_back(path + ": " + note);
  });
  IngestReport counts;
  source.scan = ingest(std::move(all), joined_name(paths), {}, counts);
  for (std::string& line : ingest_lines(joined_name(paths), counts, source.scan))
    notes.push_back(std::move(line));
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
