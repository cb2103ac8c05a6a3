#include "chunks/build_in_chunks.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "chunks/chunk_folder.h"
#include "chunks/chunk_journal.h"
#include "chunks/load_cell.h"
#include "io/hash.h"
#include "io/input_file.h"
#include "io/load_asset.h"
#include "io/load_source.h"
#include "io/output_file.h"
#include "io/parts_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/base/text.h"
#include "pipeline/rbvh/build_options.h"
#include "pipeline/rbvh/build_part.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/scan/radii.h"
#include "rbvh/version.h"

namespace rbvh {
namespace {

/// What the process takes before anything is read, with the device's compiler.
constexpr std::uint64_t kProcessBytes = std::uint64_t{300} << 20;
/// Of build_memory(): what a whole scan takes, as measured at 4 million triangles, and what a cell does, with
/// those near it, uneven cells and freed memory that is not given back.
constexpr double kWhole = 1.8, kUneven = 2.5;
constexpr std::uint32_t kMostChunks = 256;  // each has a file open while the scan is sorted
/// Of the scan's primitives, bytes of the result, at most, as measured.
constexpr std::uint64_t kResultBytesPerPrimitive = 12;
/// What gathering a scan takes on the disk: its vertices and faces, polygons anew, then the scan; those of a
/// cloud in cells as well.
constexpr std::uint64_t kGatherBytesPerVertex = 48 + 31 + 26, kGatherBytesPerFace = 20 + 20 + 17;
/// Tiles go on over what is not farther than so many of their texels.
constexpr float kMarginTexels = 4;

std::uint64_t bytes_of_vertices(const BigPly& ply, std::uint64_t primitives) {
  return primitives * ply.vertices.count / std::max<std::uint64_t>(1, ply.primitives());
}

/// About what the process takes while it builds a cell of so many primitives.
std::uint64_t chunk_memory(const BigPly& ply, const BuildConfig& config, std::uint64_t primitives) {
  const double share = static_cast<double>(primitives) / static_cast<double>(ply.primitives());
  BuildConfig own = config;
  own.levels.front().rho = static_cast<float>(static_cast<double>(own.levels.front().rho) * share);
  const std::uint64_t most = std::max(build_memory(bytes_of_vertices(ply, primitives), primitives, own),
                                      cell_memory(ply, primitives));
  const std::uint64_t sets = ply.vertices.count / 2;  // of a cell's vertices among all
  return kProcessBytes + sets + static_cast<std::uint64_t>(kUneven * static_cast<double>(most));
}

std::uint32_t choose_chunk_count(const BigPly& ply, const BuildConfig& config, const ChunkConfig& chunks) {
  if (chunks.chunks > 0) return chunks.chunks;
  const std::uint64_t limit = memory_limit(chunks.memory);
  for (std::uint32_t count = 1; count <= kMostChunks; ++count)
    if (chunk_memory(ply, config, (ply.primitives() + count - 1) / count) <= limit) return count;
  check_budget(chunks.memory, chunk_memory(ply, config, ply.primitives() / kMostChunks), ply.path,
               "building it in " + std::to_string(kMostChunks) + " chunks");
  return kMostChunks;
}

std::uint64_t cache_bytes(const MemoryBudget& memory) { return memory_limit(memory) / 4; }

std::uint64_t chunk_key(const ScanSurvey& survey, const BuildConfig& config, std::uint32_t count) {
  std::string words = std::string(version()) + " " + std::to_string(kFormatMajor) + "." +
                      std::to_string(kFormatMinor) + " " + std::to_string(survey.hash) + " " +
                      std::to_string(count) + " " + build_options_json(config);
  char level_words[160];
  for (const LevelConfig& level : config.levels) {
    std::snprintf(level_words, sizeof level_words, " %s %a %a %a %a", level.name.c_str(),
                  static_cast<double>(level.rho), static_cast<double>(level.alpha),
                  static_cast<double>(level.phi_degrees), static_cast<double>(level.error));
    words += level_words;
  }
  return hash_bytes(words);
}

ScanPart whole_of(const ScanSurvey& survey, double area) {
  ScanPart whole;
  whole.box = survey.box;
  whole.area = area;
  whole.vertices = survey.ply.vertices.count;
  whole.triangles = survey.ply.faces.count;
  return whole;
}

/// Of a cloud's points more than the surface, as discs overlap.
double most_area(const ScanSurvey& survey, double area) { return survey.ply.is_cloud() ? 4 * area : area; }

/// Surveys the space, cuts it and sorts the primitives: the journal of a build that has just begun.
ChunkJournal sort_scan(const ScanSurvey& survey, const BuildConfig& config, const ChunkConfig& chunks,
                       std::uint32_t count, const ChunkFolder& folder, std::uint64_t key,
                       const Progress& progress) {
  const std::uint64_t cache = cache_bytes(chunks.memory);
  const ScanMap map = map_scan(survey, cache, progress);
  if (!(map.area > 0)) throw Error(ErrorKind::kInput, survey.ply.path, "the scan has no area");
  CellPlan plan;
  plan.cells = split_cells(map.grid, count);
  plan.cell_of_box = cells_of_boxes(plan.cells);
  const Vec3f& box = map.grid.box;
  plan.margin = kMarginTexels * widest_texel(whole_of(survey, most_area(survey, map.area)), config) +
                std::min(map.reach, std::max({box.x, box.y, box.z}));
  ChunkJournal journal{.key = key,
                       .cells = plan.cells,
                       .counts = write_cells(survey, map, plan, folder.path, cache, progress),
                       .area = map.area,
                       .margin = plan.margin,
                       .parts = {}};
  write_journal(folder.path, journal);
  return journal;
}

/// About how many bytes a level takes where it is cast at, here and on the device.
std::uint64_t traced_bytes(const Level& level) {
  std::uint64_t bytes = level.leaves.size() * std::uint64_t{320} +
                        primitive_count(level) * std::uint64_t{60} +
                        level.primitives.positions.size() * std::uint64_t{24};
  for (const Layer& layer : level.layers) bytes += 2 * layer.texels.size() * sizeof(std::uint16_t);
  return bytes;
}

PairPart write_part(const std::string& path, const std::string& file, const Rbvh& rbvh,
                    const LoadedCell& cell) {
  const RbvhBytes bytes = write_rbvh(path, rbvh, true);
  PairHeader header;
  read_rbvh(path, &header);
  PairPart part{.file = file,
                .bytes = bytes.hierarchy + bytes.atlas,
                .hierarchy = header.hierarchy_hash,
                .atlas = header.atlas_hash,
                .vertices = cell.part.own_vertices,
                .triangles = rbvh.source.triangles > 0 ? cell.part.own_primitives : 0,
                .levels = {}};
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
    const Level& level = rbvh.levels[i];
    const RbvhNode& root = level.nodes[0];
    part.levels.push_back(
        {.leaves = level.leaves.size(),
         .bytes = bytes.levels[i],
         .memory = traced_bytes(level),
         .bounds = {{root.lo[0], root.lo[1], root.lo[2]}, {root.hi[0], root.hi[1], root.hi[2]}},
         .reached = level.reached});
  }
  return part;
}

/// The cell's pair, beside the others.
PairPart build_cell(const Device& device, const ScanSurvey& survey, const ChunkJournal& journal,
                    const CellPlan& plan, const SpaceGrid& grid, const ChunkFolder& folder,
                    std::size_t number, const BuildConfig& config, const Progress& progress) {
  LoadedCell cell = load_cell(survey, grid, plan, folder.path, number);
  if (cell.part.own_primitives != journal.counts[number].own)
    throw Error(ErrorKind::kInput, cell_path(folder.path, number), "is damaged; build without resuming");
  cell.part.area = journal.area;
  if (survey.ply.is_cloud()) {
    const double spacing = spacing_per_radius(cell.scan);
    cell.part.area *= spacing * spacing;
  }
  Rbvh rbvh = build_part(device, std::move(cell.scan), cell.part, config, progress);
  rbvh.source.name = std::filesystem::path(survey.ply.path).filename().string();
  rbvh.source.hash = survey.source_hash;
  if (!survey.ply.header.units.empty()) rbvh.source.units = survey.ply.header.units;
  rbvh.build_options = build_options_json(config);
  const std::string name = part_name(number);
  return write_part((std::filesystem::path(folder.path) / name).string(),
                    (std::filesystem::path(folder.name) / name).string(), rbvh, cell);
}

/// Builds the cells that are not yet; each goes to the journal when it is written.
void build_cells(const Device& device, const ScanSurvey& survey, const BuildConfig& config,
                 const ChunkConfig& chunks, const ChunkFolder& folder, ChunkJournal& journal,
                 const Progress& progress) {
  const SpaceGrid grid = place_grid(survey.box);
  const CellPlan plan{journal.cells, cells_of_boxes(journal.cells), journal.margin};
  for (std::size_t i = journal.parts.size(); i < plan.cells.size(); ++i) {
    const std::uint64_t primitives = journal.counts[i].own + journal.counts[i].near;
    if (chunks.chunks == 0)
      check_budget(chunks.memory, chunk_memory(survey.ply, config, primitives) * 4 / 5, survey.ply.path,
                   "building chunk " + std::to_string(i + 1) + " of " + std::to_string(plan.cells.size()));
    if (!(journal.counts[i].area > 0))
      throw Error(ErrorKind::kInput, survey.ply.path,
                  "the primitives of chunk " + std::to_string(i + 1) + " have no area; ingest it first");
    report(progress, "chunks", static_cast<double>(i) / static_cast<double>(plan.cells.size()));
    journal.parts.push_back(build_cell(device, survey, journal, plan, grid, folder, i, config, {}));
    malloc_trim(0);
    write_journal(folder.path, journal);
    std::filesystem::remove(cell_path(folder.path, i));
  }
}

/// What all parts are together.
PartsTable table_of(const ScanSurvey& survey, const ChunkJournal& journal, const BuildConfig& config) {
  PartsTable table;
  table.source = {.name = std::filesystem::path(survey.ply.path).filename().string(),
                  .hash = survey.source_hash,
                  .vertices = survey.ply.vertices.count,
                  .triangles = survey.ply.faces.count,
                  .area = journal.area,
                  .shift = survey.shift,
                  .units = survey.ply.header.units.empty() ? "unknown" : survey.ply.header.units,
                  .bounds = survey.box};
  table.build_options = build_options_json(config);
  table.parts = journal.parts;
  for (std::size_t i = 0; i < config.levels.size(); ++i) {
    double squares = 0, area = 0;
    for (std::size_t k = 0; k < table.parts.size(); ++k) {
      const auto reached = static_cast<double>(table.parts[k].levels[i].reached);
      squares += journal.counts[k].area * reached * reached;
      area += journal.counts[k].area;
    }
    table.levels.push_back({config.levels[i].name, config.levels[i].rho, config.levels[i].error,
                            area > 0 ? static_cast<float>(std::sqrt(squares / area)) : 0});
  }
  return table;
}

ChunkReport report_of(const ScanSurvey& survey, const PartsTable& table, std::size_t resumed) {
  ChunkReport report{.chunks = static_cast<std::uint32_t>(table.parts.size()),
                     .resumed = static_cast<std::uint32_t>(resumed),
                     .vertices = table.source.vertices,
                     .triangles = table.source.triangles,
                     .scan_bytes = survey.ply.source_bytes,
                     .bytes = 0,
                     .levels = {},
                     .notes = {}};
  for (const PairPart& part : table.parts) report.bytes += part.bytes;
  for (std::size_t i = 0; i < table.levels.size(); ++i) {
    const PartsTable::Level& level = table.levels[i];
    ChunkReport::Level& own =
        report.levels.emplace_back(ChunkReport::Level{level.name, 0, 0, level.error, level.reached});
    for (const PairPart& part : table.parts) {
      own.leaves += part.levels[i].leaves;
      own.bytes += part.levels[i].bytes;
    }
  }
  return report;
}

/// The journal of a killed build, with those of its parts that are whole.
std::optional<ChunkJournal> find_journal(const ChunkFolder& folder, std::uint64_t key) {
  std::optional<ChunkJournal> journal = read_journal(folder.path, key);
  if (!journal) return journal;
  std::size_t whole = 0;
  for (; whole < journal->parts.size(); ++whole) {
    try {
      PairHeader header;
      read_rbvh((std::filesystem::path(folder.path) / part_name(whole)).string(), &header);
      if (header.hierarchy_hash != journal->parts[whole].hierarchy) break;
    } catch (const Error&) {
      break;
    }
  }
  journal->parts.resize(whole);
  for (std::size_t i = whole; i < journal->cells.size(); ++i) {
    std::error_code code;
    const std::uint64_t bytes = (journal->counts[i].own + journal->counts[i].near) * sizeof(CellRecord);
    if (std::filesystem::file_size(cell_path(folder.path, i), code) != bytes || code) return std::nullopt;
  }
  return journal;
}

bool fits_memory(std::uint64_t bytes, std::uint64_t vertices, std::uint64_t primitives,
                 const BuildConfig& config, const MemoryBudget& memory) {
  const std::uint64_t limit = memory_limit(memory);
  const auto whole = static_cast<double>(build_memory(vertices, primitives, config));
  return bytes * 3 <= limit &&
         static_cast<double>(kProcessBytes) + kWhole * whole <= static_cast<double>(limit);
}

}  // namespace

bool fits_memory(const std::vector<std::string>& inputs, const BuildConfig& config,
                 const MemoryBudget& memory) {
  const ScanSize all = estimate_size(inputs);
  return fits_memory(all.bytes, all.vertices, all.primitives, config, memory);
}

ChunkSource open_chunk_source(const std::vector<std::string>& inputs, const std::string& output,
                              const ChunkConfig& chunks, const Progress& progress) {
  if (inputs.size() == 1)
    if (std::optional<BigPly> ply = open_big_ply(inputs[0]); ply && is_gathered(*ply))
      return {std::move(*ply), {}, {}};
  check_chunk_output(output, chunks.overwrite);
  const ScanSize all = estimate_size(inputs);
  std::string words = std::string(version()) + " " + std::to_string(chunks.chunks) + " " +
                      std::to_string(chunks.chunks > 0 ? 0 : memory_limit(chunks.memory));
  std::uint64_t hash = 0;
  for (const std::string& input : inputs) {
    check_is_file(input);
    hash = hash_file(input);
    words += " " + hash_digits(hash);
  }
  const std::uint64_t key = hash_bytes(words);
  ChunkSource source;
  source.folder = {new ChunkFolder(open_chunk_folder(output, key)), [](ChunkFolder* folder) {
                     discard_folder(*folder);
                     delete folder;
                   }};
  if (!chunks.resume) empty_folder(*source.folder);
  check_room(*source.folder, all.vertices * kGatherBytesPerVertex + all.primitives * kGatherBytesPerFace,
             joined_name(inputs));
  GatheredScan gathered = gather_scan(inputs, source.folder->path, chunks, progress);
  source.ply = std::move(gathered.ply);
  source.notes = std::move(gathered.notes);
  source.ply.source_bytes = all.bytes;
  source.ply.source_hash = inputs.size() == 1 ? hash : key;
  return source;
}

void check_chunk_output(const std::string& output, bool overwrite) {
  if (output == "-") throw Error(ErrorKind::kUsage, output, "a pair of parts is many files; name the output");
  check_output(output, overwrite);
}

ChunkReport build_in_chunks(const Device& device, const ScanSurvey& survey, const std::string& output,
                            const BuildConfig& config, const ChunkConfig& chunks, const Progress& progress) {
  const BigPly& ply = survey.ply;
  if (config.focus) throw Error(ErrorKind::kUsage, ply.path, "a build in chunks has no focus");
  if (chunks.chunks > kMostChunks)
    throw Error(ErrorKind::kUsage, ply.path,
                std::to_string(kMostChunks) + " chunks are the most that a scan is built in");
  check_chunk_output(output, chunks.overwrite);
  const std::uint32_t count = choose_chunk_count(ply, config, chunks);
  const std::uint64_t key = chunk_key(survey, config, count);
  ChunkFolder folder = open_chunk_folder(output, key);
  std::optional<ChunkJournal> journal;
  if (chunks.resume) journal = find_journal(folder, key);
  if (!journal) {
    try {
      empty_folder(folder);
      check_room(folder, ply.primitives() * (sizeof(CellRecord) * 5 / 4 + kResultBytesPerPrimitive),
                 ply.path);
      journal = sort_scan(survey, config, chunks, count, folder, key, progress);
    } catch (...) {  // nothing is there yet that is worth going on from
      discard_folder(folder);
      throw;
    }
  }
  const std::size_t resumed = journal->parts.size();
  try {
    build_cells(device, survey, config, chunks, folder, *journal, progress);
  } catch (const Error& error) {  // of a scan that cannot be built at all, there is nothing to go on from
    if (error.kind() == ErrorKind::kInput && journal->parts.empty()) discard_folder(folder);
    throw;
  }
  report(progress, "chunks", 1);
  const PartsTable table = table_of(survey, *journal, config);
  write_parts(output, table, chunks.overwrite);
  finish_folder(folder, output);
  return report_of(survey, table, resumed);
}

ChunkReport build_in_chunks(const Device& device, const std::vector<std::string>& scans,
                            const std::string& output, const BuildConfig& config, const ChunkConfig& chunks,
                            const Progress& progress) {
  ChunkSource source = open_chunk_source(scans, output, chunks, progress);
  const ScanSurvey survey = survey_scan(source.ply, progress);
  ChunkReport report = build_in_chunks(device, survey, output, config, chunks, progress);
  report.notes = source.notes;
  return report;
}

}  // namespace rbvh
