// The pair, written and read. The hierarchy is a FlatBuffers buffer (io/rbvh_file.fbs) whose root begins with
// a seal: length, hash and version. Nothing but the seal is read before it has been verified.
#include "io/rbvh_file.h"

#include <flatbuffers/flatbuffers.h>
#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <numeric>

#include "io/atlas_file.h"
#include "io/file_set.h"
#include "io/hash.h"
#include "io/input_file.h"
#include "io/leftovers.h"
#include "io/level_codec.h"
#include "io/output_file.h"
#include "io/parts_file.h"
#include "io/posix_file.h"
#include "io/rbvh_file_v1.h"
#include "io/rbvh_tables.h"
#include "io/shallow_json.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/text.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/lod.h"
#include "rbvh_file_generated.h"

namespace rbvh {
namespace {

static_assert(sizeof(file::LayerTile) == sizeof(LayerTile) &&
              sizeof(file::Measures) == sizeof(LevelMeasures));
constexpr std::size_t kSealHashAt = 8;  // in file::Seal
constexpr int kMaxBuildOptionsDepth = 32;
constexpr const char* kRebuild = "; build the pair again";

// Of all bytes, with the seal's hash taken as zero. `hash_at` is where that lies.
std::uint64_t hash_sealed(std::span<const std::byte> bytes, std::size_t hash_at) {
  constexpr std::uint64_t kZero = 0;
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), XXH3_freeState);
  if (state == nullptr) throw std::bad_alloc();
  XXH3_64bits_reset(state.get());
  XXH3_64bits_update(state.get(), bytes.data(), hash_at);
  XXH3_64bits_update(state.get(), &kZero, sizeof kZero);
  const std::span<const std::byte> rest = bytes.subspan(hash_at + sizeof kZero);
  XXH3_64bits_update(state.get(), rest.data(), rest.size());
  return XXH3_64bits_digest(state.get());
}

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::kInput, path, what);
}

std::span<const std::byte> bytes_of(const InputBytes& input) {
  return std::as_bytes(std::span(input.view()));
}

// --- reading

// Finds the seal without trusting anything, and holds the file against it.
const file::Seal& check_seal(std::span<const std::byte> bytes, const std::string& path) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  if (std::string_view(reinterpret_cast<const char*>(data), bytes.size()).starts_with(kPartsMagic))
    refuse(path, "is a pair of parts, which cannot be taken whole here; name one of its parts");
  if (bytes.size() < 8 || std::memcmp(data + 4, file::PairIdentifier(), 4) != 0)
    refuse(path, "is no .rbvh file: byte 4 does not begin the word RBVH");
  flatbuffers::Verifier verifier(data, bytes.size());
  const auto* root = flatbuffers::GetRoot<flatbuffers::Table>(data);
  if (bytes.size() > std::numeric_limits<std::int32_t>::max() || verifier.VerifyOffset(0) == 0 ||
      !root->VerifyTableStart(verifier) ||
      !root->VerifyFieldRequired<file::Seal>(verifier, file::Pair::VT_SEAL, alignof(file::Seal)))
    refuse(path, "is cut or damaged: its first bytes hold no seal" + std::string(kRebuild));
  const file::Seal& seal = *root->GetStruct<const file::Seal*>(file::Pair::VT_SEAL);
  if (seal.length() > bytes.size())
    refuse(path, "is cut: " + std::to_string(bytes.size()) + " of its " + std::to_string(seal.length()) +
                     " bytes are there" + kRebuild);
  if (seal.length() < bytes.size())
    refuse(path, "is damaged: it has " + std::to_string(bytes.size() - seal.length()) +
                     " bytes too many after byte " + std::to_string(seal.length()) + kRebuild);
  const auto* at = reinterpret_cast<const std::uint8_t*>(&seal) + kSealHashAt;
  if (seal.hash() != hash_sealed(bytes, static_cast<std::size_t>(at - data)))
    refuse(path, "is damaged: its bytes do not have the hash that it carries" + std::string(kRebuild));
  if (seal.major() < 1 || seal.major() > kFormatMajor)
    refuse(path, "is of format version " + std::to_string(seal.major()) + "." + std::to_string(seal.minor()) +
                     ", " + (seal.major() > kFormatMajor ? "newer than" : "not") + " the " +
                     std::to_string(kFormatMajor) + ".x and older that this rbvh reads; use a " +
                     (seal.major() > kFormatMajor ? "newer" : "matching") +
                     " rbvh, or build the pair again with this one");
  return seal;
}

template <class To, class From>
std::vector<To> to_vector(const flatbuffers::Vector<From>* from) {
  return from != nullptr ? std::vector<To>(from->begin(), from->end()) : std::vector<To>();
}

Level to_level(const file::Level& from, double area, const std::string& path) {
  Level level;
  take_level(from, level);
  level.error = from.error();
  level.reached = from.reached();
  const file::LeafGrid& grid = *from.grid();
  level.grid = {to_vec3f(*grid.origin()), grid.frame_step(), grid.box_step()};
  level.lattice = {to_vec3f(*from.lattice()->origin()), from.lattice()->step()};
  const file::Streams& s = *from.streams();
  const LevelStreams streams{
      .tree = to_vector<std::uint8_t>(s.tree()),
      .leaves = to_vector<std::uint8_t>(s.leaves()),
      .positions = to_vector<std::uint8_t>(s.positions()),
      .normals = to_vector<std::uint8_t>(s.normals()),
      .colors = to_vector<std::uint8_t>(s.colors()),
      .radii = to_vector<std::uint8_t>(s.radii()),
      .triangles = to_vector<std::uint8_t>(s.triangles()),
  };
  const file::Counts& c = *from.counts();
  decode_streams(streams, {c.leaves(), c.primitive_leaves(), c.vertices(), c.triangles()}, area, path, level);
  level.streams = bytes_by_stream(streams);
  level.stored_bytes = stream_bytes(streams) + layer_tile_bytes(level) + from.atlas_bytes();
  return level;
}

/// Those of the names, which become parts of messages, that are wanted.
std::vector<std::string> choose_names(const std::vector<std::string>& names, const std::string& path,
                                      const LevelFilter& choose) {
  for (const std::string& name : names)
    if (!is_name(name))
      refuse(path,
             "is malformed: a level has a name that is not letters, digits, _ and -" + std::string(kRebuild));
  return choose && !names.empty() ? choose(names) : names;
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// An object, and shallow enough to be traversed by recursion.
bool are_build_options(const std::string& text) {
  return parse_shallow_json(text, kMaxBuildOptionsDepth).is_object();
}

// FlatBuffers lets many tables share one vector: what they hold in all must still be bounded by the file.
bool fits_file(const file::Pair& pair, std::uint64_t file_bytes) {
  if (pair.levels()->size() > kMaxLevels) return false;
  std::uint64_t bytes = 0;
  for (const file::Level* level : *pair.levels()) {
    if (level->layers()->size() > kMaxLayers) return false;
    const file::Streams& s = *level->streams();
    for (const auto* stream :
         {s.tree(), s.leaves(), s.positions(), s.normals(), s.colors(), s.radii(), s.triangles()})
      if (stream != nullptr) bytes += stream->size();
    for (const file::Layer* layer : *level->layers())
      if (layer->tiles() != nullptr) bytes += std::uint64_t{layer->tiles()->size()} * sizeof(LayerTile);
  }
  return bytes <= file_bytes;
}

// --- writing

file::Bounds from_bounds(const Bounds3f& b) {
  const float lo[3] = {b.lo.x, b.lo.y, b.lo.z}, hi[3] = {b.hi.x, b.hi.y, b.hi.z};
  return {flatbuffers::span<const float, 3>(lo), flatbuffers::span<const float, 3>(hi)};
}

flatbuffers::Offset<file::Streams> add_streams(flatbuffers::FlatBufferBuilder& builder,
                                               const LevelStreams& streams) {
  const auto add = [&](const std::vector<std::uint8_t>& bytes) { return builder.CreateVector(bytes); };
  const auto add_some = [&](const std::vector<std::uint8_t>& bytes) {
    return bytes.empty() ? flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>>() : add(bytes);
  };
  const auto tree = add(streams.tree), leaves = add(streams.leaves), positions = add_some(streams.positions),
             normals = add_some(streams.normals), colors = add_some(streams.colors),
             radii = add_some(streams.radii), triangles = add_some(streams.triangles);
  return file::CreateStreams(builder, tree, leaves, positions, normals, colors, radii, triangles);
}

flatbuffers::Offset<file::Level> add_level(flatbuffers::FlatBufferBuilder& builder, const Level& level,
                                           const LevelStreams& streams, std::uint64_t atlas_bytes) {
  const auto stream_table = add_streams(builder, streams);
  std::vector<flatbuffers::Offset<file::Layer>> layers;
  for (const Layer& layer : level.layers) {
    const auto layer_name = builder.CreateString(layer.name);
    flatbuffers::Offset<flatbuffers::Vector<const file::LayerTile*>> tiles;
    if (!layer.tiles.empty())
      tiles = builder.CreateVectorOfStructs(reinterpret_cast<const file::LayerTile*>(layer.tiles.data()),
                                            layer.tiles.size());
    layers.push_back(file::CreateLayer(builder, layer_name, layer.channels, layer.lo, layer.hi, layer.width,
                                       layer.height, tiles));
  }
  const auto layer_vector = builder.CreateVector(layers);
  const auto name = builder.CreateString(level.name);
  const auto derived_from = level.derived_from.empty() ? 0 : builder.CreateString(level.derived_from);
  const file::Bounds bounds = from_bounds(level.bounds);
  const LevelCounts counts = level_counts(level);
  const file::Counts counts_there(counts.leaves, counts.primitive_leaves, counts.vertices, counts.triangles);
  const auto origin = [](const Vec3f& v) { return flatbuffers::span<const float, 3>(&v.x, 3); };
  const file::LeafGrid grid(origin(level.grid.origin), level.grid.frame_step, level.grid.box_step);
  const file::Lattice lattice(origin(level.lattice.origin), level.lattice.step);
  const LevelFidelity& f = level.fidelity;
  const file::Fidelity fidelity(f.mask_mismatch_percent, f.median_dt, f.p99_dt, f.holes, f.leaks, f.walls);
  const auto measures = std::bit_cast<file::Measures>(f.more);
  return file::CreateLevel(builder, name, level.rho, level.alpha, level.phi_degrees, level.error, &bounds,
                           &counts_there, &grid, &lattice, stream_table, level.atlas_width,
                           level.atlas_height, layer_vector, level.texels_used, atlas_bytes,
                           f.measured ? &fidelity : nullptr, f.more.views > 0 ? &measures : nullptr,
                           derived_from, level.reached);
}

flatbuffers::DetachedBuffer encode_hierarchy(const Rbvh& rbvh, std::uint64_t atlas_length,
                                             std::uint64_t atlas_hash, std::span<const LevelStreams> streams,
                                             std::span<const std::uint64_t> level_atlas_bytes) {
  flatbuffers::FlatBufferBuilder builder(1 << 20);
  std::vector<flatbuffers::Offset<file::Level>> levels;
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i)
    levels.push_back(add_level(builder, rbvh.levels[i], streams[i], level_atlas_bytes[i]));
  const auto level_vector = builder.CreateVector(levels);
  const RbvhSource& s = rbvh.source;
  const auto source_name = builder.CreateString(s.name), units = builder.CreateString(s.units);
  const file::Double3 shift(s.shift.x, s.shift.y, s.shift.z);
  const file::Bounds bounds = from_bounds(s.bounds);
  const auto source = file::CreateSource(builder, source_name, s.hash, s.vertices, s.triangles, s.area,
                                         &shift, units, &bounds);
  const auto atlas = file::CreateAtlas(builder, atlas_length, atlas_hash);
  const auto options = builder.CreateString(rbvh.build_options);
  const file::Seal unsealed(0, 0, kFormatMajor, kFormatMinor, 0);
  file::FinishPairBuffer(builder, file::CreatePair(builder, &unsealed, atlas, source, options, level_vector));

  flatbuffers::DetachedBuffer buffer = builder.Release();
  const std::uint8_t* place = reinterpret_cast<const std::uint8_t*>(file::GetPair(buffer.data())->seal());
  const std::size_t at = static_cast<std::size_t>(place - buffer.data());
  const file::Seal with_length(buffer.size(), 0, kFormatMajor, kFormatMinor, 0);
  std::memcpy(buffer.data() + at, &with_length, sizeof with_length);
  const file::Seal sealed(
      buffer.size(), hash_sealed(std::as_bytes(std::span(buffer.data(), buffer.size())), at + kSealHashAt),
      kFormatMajor, kFormatMinor, 0);
  std::memcpy(buffer.data() + at, &sealed, sizeof sealed);
  return buffer;
}

InputBytes read_back(const OutputFile& file) {
  try {
    return read_input(file.temporary_path());
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput) throw;
    throw Error(ErrorKind::kFailure, file.path(), std::string("cannot be read back: ") + error.what());
  }
}

// The TIFF library does not report every failed write (a full disk, a size limit): the file is read back and
// compared.
void check_written(std::span<const std::byte> atlas, const std::string& path, const Rbvh& rbvh) {
  Rbvh again = rbvh;
  for (Level& level : again.levels)
    for (Layer& layer : level.layers) layer.texels.clear();
  try {
    decode_atlas(atlas, path, StoredHeights::kDifferences, again);
  } catch (const Error&) {
    throw Error(ErrorKind::kFailure, path, "cannot be written whole; is the disk full?");
  }
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i)
    for (std::size_t k = 0; k < rbvh.levels[i].layers.size(); ++k)
      if (rbvh.levels[i].layers[k].texels != again.levels[i].layers[k].texels)
        throw Error(ErrorKind::kFailure, path, "cannot be written whole; is the disk full?");
}

// What is wrong with an atlas that find_part() does not find.
[[noreturn]] void refuse_atlas(const std::string& path, const PairHeader& header) {
  const std::string atlas = atlas_path(path);
  std::error_code error;
  if (!std::filesystem::exists(atlas, error))
    refuse(path, "comes without its atlas " + atlas + ": a pair is two files; bring both");
  if (const std::uint64_t size = std::filesystem::file_size(atlas, error);
      !error && size < header.atlas_bytes)
    refuse(atlas, "belongs to another pair than " + path + ", or is cut: it has " + std::to_string(size) +
                      " bytes and should have " + std::to_string(header.atlas_bytes));
  refuse(atlas, "belongs to another pair than " + path +
                    ", or is damaged: it does not have the length and the hash named there");
}

struct PairOutputs {
  std::string target;  ///< where the hierarchy's path leads as a link
  OutputFile hierarchy, atlas;

  PairOutputs(const std::string& path, bool overwrite)
      : target(follow_link(path)),
        hierarchy(target, overwrite, OutputFile::Role::kInSet),
        atlas(atlas_path(target), overwrite, OutputFile::Role::kInSet) {
    for (const OutputFile* file : {&hierarchy, &atlas})
      if (file->is_special())
        throw Error(ErrorKind::kFailure, file->path(),
                    "is no regular file, and a pair is two files in a folder; name one there");
  }
};

}  // namespace

std::string atlas_path(const std::string& rbvh_path) {
  return std::filesystem::path(rbvh_path).replace_extension(".atlas.tif").string();
}

Rbvh decode_hierarchy(std::span<const std::byte> bytes, const std::string& path, PairHeader& header,
                      const LevelFilter& choose) {
  const file::Seal& seal = check_seal(bytes, path);
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  flatbuffers::Verifier verifier(data, bytes.size(), /*max_depth=*/8,
                                 /*max_tables=*/1 + 2 + kMaxLevels * (2 + kMaxLayers));
  Rbvh rbvh;
  std::vector<std::string> names;
  if (seal.major() == 1) {
    rbvh = decode_hierarchy_v1(bytes, verifier, path, header);
    for (const Level& level : rbvh.levels) names.push_back(level.name);
    const std::vector<std::string> wanted = choose_names(names, path, choose);
    std::erase_if(rbvh.levels, [&](const Level& level) { return !contains(wanted, level.name); });
  } else {
    if (!file::VerifyPairBuffer(verifier))
      refuse(path, "is malformed: its tables do not hang together" + std::string(kRebuild));
    const file::Pair& pair = *file::GetPair(data);
    if (!fits_file(pair, bytes.size()))
      refuse(path, "is malformed: it claims more levels, layers, nodes or leaves than it has room for" +
                       std::string(kRebuild));
    take_pair(pair, rbvh, header);
    if (!(rbvh.source.area >= 0) || !std::isfinite(rbvh.source.area))
      refuse(path, "is malformed: the source has an area that is not finite" + std::string(kRebuild));
    for (const file::Level* level : *pair.levels()) names.push_back(level->name()->str());
    const std::vector<std::string> wanted = choose_names(names, path, choose);
    for (const file::Level* level : *pair.levels())
      if (contains(wanted, level->name()->str()))
        rbvh.levels.push_back(to_level(*level, rbvh.source.area, path));
  }
  if (!are_build_options(rbvh.build_options))
    refuse(path, "is malformed: its build options are no JSON object" + std::string(kRebuild));
  if (const auto fault = find_fault(rbvh)) refuse(path, "is malformed: " + *fault + kRebuild);
  header.levels = names.size();
  header.major = seal.major();
  header.minor = seal.minor();
  header.hierarchy_bytes = seal.length();
  header.hierarchy_hash = seal.hash();
  return rbvh;
}

Rbvh read_rbvh(const std::string& path, PairHeader* header, const std::function<void(const Rbvh&)>& check,
               const LevelFilter& choose) {
  if (path == "-") refuse("standard input", "is one stream, and a pair is two files; name the .rbvh");
  PairHeader own;
  PairHeader& head = header != nullptr ? *header : own;
  const std::string atlas_paths[] = {atlas_path(path), atlas_path(follow_link(path))};
  const std::string all_paths[] = {path, atlas_paths[0], atlas_paths[1]};
  for (int reads = 1;; ++reads) {
    const std::vector<std::int64_t> states = file_states(all_paths);
    Rbvh rbvh;
    {
      const InputBytes hierarchy = read_input(path);
      rbvh = decode_hierarchy(bytes_of(hierarchy), path, head, choose);
    }
    if (check) check(rbvh);
    if (const auto atlas = find_part(atlas_paths, head.atlas_bytes, head.atlas_hash)) {
      head.atlas_file = atlas->path;
      decode_atlas(bytes_of(atlas->bytes), atlas->path,
                   head.major == 1 ? StoredHeights::kPlain : StoredHeights::kDifferences, rbvh,
                   rbvh.levels.size() < head.levels);
      if (head.major == 1) give_vertices_attributes(rbvh);
      return rbvh;
    }
    if (reads == kMostReads || file_states(all_paths) == states) refuse_atlas(path, head);
  }
}

RbvhBytes write_rbvh(const std::string& path, const Rbvh& rbvh, bool overwrite, std::uint64_t most_bytes) {
  std::optional<std::string> fault = find_fault(rbvh);
  if (!fault) fault = find_texel_fault(rbvh);
  if (!fault && !are_build_options(rbvh.build_options)) fault = "the build options are no JSON object";
  if (fault) throw Error(ErrorKind::kFailure, path, "would be malformed: " + *fault + "; please report this");

  std::vector<LevelStreams> streams(rbvh.levels.size());
  parallel_for(streams.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) streams[i] = encode_streams(rbvh.levels[i], path);
  });
  PairOutputs out(path, overwrite);
  RbvhBytes bytes;
  bytes.levels = write_atlas(out.atlas.temporary_path(), out.atlas.path(), rbvh);
  flatbuffers::DetachedBuffer buffer;
  std::uint64_t atlas_hash;
  {
    const InputBytes written = read_back(out.atlas);
    check_written(bytes_of(written), out.atlas.path(), rbvh);
    bytes.atlas = written.size;
    atlas_hash = hash_bytes(written.view());
    buffer = encode_hierarchy(rbvh, written.size, atlas_hash, streams, bytes.levels);
  }
  bytes.hierarchy = buffer.size();
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i)
    bytes.levels[i] += stream_bytes(streams[i]) + layer_tile_bytes(rbvh.levels[i]);
  if (bytes.hierarchy + bytes.atlas > most_bytes) return bytes;
  out.hierarchy.write(std::as_bytes(std::span(buffer.data(), buffer.size())));
  const SetPart parts[] = {{&out.atlas, atlas_hash}};
  const std::vector<std::string> replaced = files_of_parts(path);
  commit_set(out.hierarchy, parts);
  remove_leftovers(replaced);
  return bytes;
}

RbvhBytes write_rbvh_within(const std::string& path, Rbvh& rbvh, bool overwrite, std::uint64_t most_bytes,
                            const std::string& file, const std::function<void(Rbvh&)>& add_coarser) {
  RbvhBytes all = write_rbvh(path, rbvh, overwrite, 0);  // measures, writes nothing
  const auto smallest = [&] {
    // With what a pair has beside its levels.
    const std::uint64_t own = std::accumulate(all.levels.begin(), all.levels.end(), std::uint64_t{0});
    return *std::min_element(all.levels.begin(), all.levels.end()) + all.hierarchy + all.atlas - own;
  };
  if (add_coarser && smallest() > most_bytes) {
    add_coarser(rbvh);
    all = write_rbvh(path, rbvh, overwrite, 0);
  }
  // What is not any level's own (names, headers) is known only of a whole pair: where it does not fit, the
  // next set that takes less is tried.
  const std::vector<Level> levels = std::move(rbvh.levels);
  for (std::uint64_t room = most_bytes;;) {
    std::uint64_t taken = 0;
    rbvh.levels.clear();
    for (const std::size_t i : choose_levels_by_bytes(all.levels, room)) {
      rbvh.levels.push_back(levels[i]);
      taken += all.levels[i];
    }
    if (rbvh.levels.empty())
      throw Error(ErrorKind::kBudget, file,
                  "no level fits into " + format_bytes(most_bytes) + "; the smallest takes " +
                      format_bytes(smallest()));
    RbvhBytes bytes = write_rbvh(path, rbvh, overwrite, most_bytes);
    if (bytes.hierarchy + bytes.atlas <= most_bytes) return bytes;
    room = taken - 1;
  }
}

void check_rbvh_output(const std::string& path, bool overwrite) {
  if (path == "-")
    throw Error(ErrorKind::kUsage, "", "a pair is two files and cannot go to standard output; name a file");
  const PairOutputs probe(path, overwrite);
}

}  // namespace rbvh
