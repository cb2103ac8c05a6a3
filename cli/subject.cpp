#include "cli/subject.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "cli/exit_code.h"
#include "cli/remedies.h"
#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "io/scan_io.h"
#include "io/scene_file.h"
#include "pipeline/proxy/proxy_surface.h"
#include "pipeline/proxy/tessellate.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scan/ingest.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

// A scan is in memory as the file's bytes, as doubles and as floats.
constexpr std::uint64_t kScanBytesPerFileByte = 3;
// A hierarchy is checked, unpacked and laid out for the device.
constexpr std::uint64_t kPairBytesPerFileByte = 4;
// A map is in memory as it was read and on the device; compressed to half on disk.
constexpr std::uint64_t kProxyBytesPerFileByte = 5;
constexpr std::uint64_t kBytesPerTwinTriangle = 120;  // mesh, hierarchy and what builds it
constexpr std::uint64_t kBytesPerPatch = 400;
constexpr std::uint64_t kMostNumbers = 1u << 24;
constexpr std::size_t kBandBytes = std::size_t{256} << 20;  // of hits on the device at once

std::uint64_t file_bytes(const std::string& path) {
  std::error_code code;
  const std::uintmax_t size = fs::file_size(path, code);
  return code ? 0 : size;
}

std::uint64_t bytes_to_read(const std::string& path) {
  if (is_rbvh(path)) return file_bytes(path) * kPairBytesPerFileByte + file_bytes(atlas_path(path));
  if (is_proxy(path)) return (file_bytes(path) + file_bytes(proxy_map_path(path))) * kProxyBytesPerFileByte;
  return file_bytes(path) * kScanBytesPerFileByte;
}

const Level& level_of(const Subject& subject, const std::string& level) {
  const Level* found = subject.rbvh()->find_level(level);
  RBVH_CHECK(found != nullptr);
  return *found;
}

std::vector<std::string> parse_level_list(std::string_view text) {
  try {
    return parse_list(text);
  } catch (const Error& error) {
    throw Error(ErrorKind::kUsage, "", std::string("--level: ") + error.what());
  }
}

double parse_pixels(std::string_view text) {
  const double pixels = parse_number(text);
  if (!(pixels > 0)) throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not above 0");
  return pixels;
}

std::uint32_t parse_tessellate(std::string_view text) {
  const std::int64_t level = parse_integer(text);
  if (level < 0 || level > PATCH_MOST_LEVEL)
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(text) + "' is not between 0 and " + std::to_string(PATCH_MOST_LEVEL));
  return static_cast<std::uint32_t>(level);
}

/// A proxy or, where it is to be tessellated, a scan.
SceneObject load_proxy_object(Context& context, const std::string& path, std::optional<std::uint32_t> most) {
  check_budget(context, bytes_to_read(path), path, "reading it");
  SceneObject object;
  Proxy proxy = load_proxy(path);
  object.bounds = surface_bounds(proxy);
  if (!most) {
    object.content = std::move(proxy);
    return object;
  }
  std::uint64_t triangles = 0;
  for (const std::uint32_t level : uniform_levels(proxy, *most)) triangles += std::uint64_t{2} << 2 * level;
  check_budget(context, triangles * kBytesPerTwinTriangle, path, "tessellating it");
  object.content = tessellate(proxy, *most);
  return object;
}

SceneObject load_object(Context& context, const SceneFile::Object& file, std::optional<std::uint32_t> most) {
  const bool is_pair = is_rbvh(file.path);
  if (!file.level.empty() && !is_pair)
    throw Error(ErrorKind::kInput, file.path,
                "object \"" + file.name + "\" names a level, and this is no pair");
  SceneObject object;
  if (is_pair) {
    Rbvh rbvh = load_pair(context, file.path);
    const Level* level = rbvh.find_level(file.level);
    if (level == nullptr)
      throw Error(ErrorKind::kInput, file.path,
                  "there is no level '" + file.level + "' for object \"" + file.name + "\"");
    object.bounds = rbvh.source.bounds;
    object.content = std::move(rbvh.levels[static_cast<std::size_t>(level - rbvh.levels.data())]);
  } else if (is_proxy(file.path)) {
    object = load_proxy_object(context, file.path, most);
  } else {
    Scan scan = load_exact_scan(context, file.path);
    object.bounds = bounds(scan);
    object.content = std::move(scan);
  }
  object.name = file.name;
  return object;
}

Scene load_scene(Context& context, const std::string& path, std::optional<std::uint32_t> most) {
  const SceneFile file = read_scene(path);
  std::uint64_t bytes = 0;
  for (const SceneFile::Object& object : file.objects) bytes += bytes_to_read(object.path);
  check_budget(context, bytes, path, "reading all its files");
  Scene scene;
  scene.z_is_up = file.z_is_up;
  for (const SceneFile::Object& object : file.objects)
    scene.objects.push_back(load_object(context, object, most));
  for (const SceneFile::Instance& instance : file.instances)
    scene.instances.push_back({static_cast<std::uint32_t>(instance.object), instance.to_world});
  return scene;
}

}  // namespace

bool is_rbvh(const std::string& path) {
  if (path == "-") return false;
  if (fs::path(path).extension() == ".rbvh") return true;
  std::error_code code;
  if (!fs::is_regular_file(path, code)) return false;  // a pipe's first bytes could not be put back
  char start[8] = {};
  std::ifstream(path, std::ios::binary).read(start, sizeof start);
  return std::memcmp(start + 4, "RBVH", 4) == 0;  // where FlatBuffers keep their file identifier
}

Rbvh load_pair(const Context& context, const std::string& path, PairHeader* header) {
  const std::uint64_t read = bytes_to_read(path);
  check_budget(context, read, path, "reading it");
  return read_rbvh(path, header, [&](const Rbvh& rbvh) {
    std::uint64_t texels = 0;  // bytes of them; the heights are on the device, too
    for (const Level& level : rbvh.levels) {
      texels += std::uint64_t{level.atlas_width} * level.atlas_height * sizeof(std::uint16_t);
      for (const Layer& layer : level.layers) {
        const auto [width, height] = atlas_size(level, layer);
        texels += std::uint64_t{width} * height * layer.channels * sizeof(std::uint16_t);
      }
    }
    check_budget(context, read + texels, path, "reading it");
  });
}

Scan load_exact_scan(Context& context, const std::string& path) {
  refuse_proxy(path);
  check_budget(context, file_bytes(path) * kScanBytesPerFileByte, path, "reading it");
  Scan scan = shift_to_float(read_scan(path));
  check_usable(scan, path);
  if (scan.is_cloud()) complete_cloud(scan, {}, context.progress.callback());
  return scan;
}

Subject load_subject(Context& context, const std::string& path, std::optional<std::uint32_t> tessellate) {
  Subject subject;
  subject.path = path;
  subject.name = path == "-" ? "stdin" : fs::path(path).stem().string();
  if (is_rbvh(path)) {
    Rbvh rbvh = load_pair(context, path);
    subject.bounds = rbvh.source.bounds;
    subject.is_cloud = rbvh.source.triangles == 0;
    subject.content = std::move(rbvh);
  } else if (is_scene(path)) {
    Scene scene = load_scene(context, path, tessellate);
    subject.bounds = bounds(scene);
    subject.content = std::move(scene);
  } else if (path != "-" && is_proxy(path)) {
    SceneObject object = load_proxy_object(context, path, tessellate);
    subject.bounds = object.bounds;
    if (object.scan() != nullptr) {
      subject.content = std::move(std::get<Scan>(object.content));
    } else {
      Scene scene;
      scene.objects.push_back(std::move(object));
      scene.instances.push_back({});
      subject.content = std::move(scene);
    }
  } else {
    Scan scan = load_exact_scan(context, path);
    subject.bounds = bounds(scan);
    subject.is_cloud = scan.is_cloud();
    subject.content = std::move(scan);
  }
  return subject;
}

std::vector<std::string> choose_levels(Context& context, const Subject& subject,
                                       const std::vector<std::string>& wanted, bool has_auto) {
  const Rbvh* rbvh = subject.rbvh();
  if (!rbvh) {
    if (!wanted.empty())
      note(context, "rbvh " + context.stage + ": " + subject.path + " has no levels; --level is ignored");
    return {subject.scan() ? "exact" : "scene"};
  }
  std::vector<std::string> present;
  for (const Level& level : rbvh->levels) present.push_back(level.name);
  if (wanted.empty()) return {present.front()};
  if (has_auto && wanted.size() == 1 && wanted[0] == "auto") return wanted;
  std::vector<std::string> chosen;
  const auto choose = [&](const std::string& name) {
    if (std::find(chosen.begin(), chosen.end(), name) == chosen.end()) chosen.push_back(name);
  };
  for (const std::string& name : wanted) {
    if (name == "all") {
      for (const std::string& each : present) choose(each);
    } else if (std::find(present.begin(), present.end(), name) != present.end()) {
      choose(name);
    } else {
      throw Error(ErrorKind::kUsage, subject.path,
                  fmt::format("there is no level '{}'; there are {}", name, fmt::join(present, ", ")));
    }
  }
  return chosen;
}

void check_leaf_numbers(const Subject& subject, const std::string& level) {
  std::uint64_t leaves = 0;
  if (const Scan* scan = subject.scan())
    leaves = scan->is_cloud() ? scan->positions.size() : scan->triangles.size();
  else if (const Scene* scene = subject.scene())
    leaves = first_leaves(*scene).back();
  else if (level == "auto")
    for (const Level& each : subject.rbvh()->levels) leaves += each.leaves.size();
  else
    leaves = level_of(subject, level).leaves.size();
  if (leaves > kMostNumbers)
    throw Error(ErrorKind::kInput, subject.path,
                std::to_string(leaves) +
                    " leaves or primitives are more than the 16777216 that a float32 can number");
}

void check_cast_budget(const Context& context, const Subject& subject, const SceneConfig& config) {
  const Scene* scene = subject.scene();
  if (scene == nullptr) return;
  std::uint64_t bytes = scene->instances.size() * (sizeof(SceneInstance) + sizeof(WideNode));
  bool has_proxy = false;
  for (const SceneObject& object : scene->objects) {
    if (object.scan() != nullptr) {
      bytes += leaf_count(object) * static_cast<std::uint64_t>(info(config.exact.builder).bytes);
    } else if (const Level* level = object.level()) {
      if (!level->layers.empty()) bytes += level->layers[0].texels.size() * sizeof(std::uint16_t);
    } else {
      const Proxy& proxy = *object.proxy();
      has_proxy = true;
      bytes += 2 * proxy.map.size() * sizeof(Vec3f) + proxy.quads.size() * kBytesPerPatch;  // here, and there
    }
  }
  if (has_proxy) bytes += config.proxy.cache_bytes;
  check_budget(context, bytes, subject.path, "casting rays at it");
}

Caster make_caster(const Device& device, const Subject& subject, const std::string& level,
                   const SceneConfig& config, float spread) {
  if (subject.rbvh() && level == "auto") return make_footprint_tracer(device, *subject.rbvh(), spread);
  if (subject.rbvh()) return make_tile_tracer(device, level_of(subject, level));
  if (const Scene* scene = subject.scene()) return make_scene_tracer(device, *scene, config);
  return make_exact_tracer(device, *subject.scan(), config.exact);
}

SurfaceSamples sample_pair(const Rbvh& rbvh, const std::string& level, const Caster& caster,
                           std::span<const Hit> hits) {
  const auto* footprint = std::get_if<FootprintTracer>(&caster);
  if (footprint == nullptr) return sample_surface(*rbvh.find_level(level), hits);
  // Level by level, with the others' hits taken for misses.
  SurfaceSamples all;
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
    std::vector<Hit> own(hits.begin(), hits.end());
    for (Hit& hit : own) {
      const bool is_own = hit.leaf != RBVH_NO_LEAF && level_of_leaf(*footprint, hit.leaf) == i;
      if (is_own)
        hit.leaf -= footprint->first_leaf[i];
      else
        hit.t = std::numeric_limits<float>::infinity();
    }
    const SurfaceSamples some = sample_surface(rbvh.levels[i], own);
    all.normals.resize(hits.size());
    if (!some.colors.empty()) all.colors.resize(hits.size());
    for (std::size_t k = 0; k < own.size(); ++k) {
      if (!std::isfinite(own[k].t)) continue;
      all.normals[k] = some.normals[k];
      if (!some.colors.empty()) all.colors[k] = some.colors[k];
    }
  }
  return all;
}

std::vector<Hit> cast_camera(const Caster& caster, const CameraRays& rays,
                             std::vector<std::uint32_t>* steps) {
  const std::size_t width = rays.width, height = rays.height;
  const std::size_t band = std::clamp<std::size_t>(kBandBytes / (width * sizeof(Hit)), 1, height);
  const Device& device =
      std::visit([](const auto& tracer) -> const Device& { return tracer.device; }, caster);
  const Buffer<Hit> hit_buffer(device, width * band);
  const Buffer<std::uint32_t> step_buffer =
      steps ? Buffer<std::uint32_t>(device, width * band) : Buffer<std::uint32_t>();
  std::vector<Hit> hits(width * height);
  if (steps) steps->resize(width * height);
  for (std::size_t row = 0; row < height; row += band) {
    const std::size_t rows = std::min(band, height - row), count = rows * width;
    CameraRays part = rays;
    part.offset_y += static_cast<float>(row);
    part.height = static_cast<std::uint32_t>(rows);
    std::visit(
        [&](const auto& tracer) { trace_camera(tracer, part, hit_buffer, steps ? &step_buffer : nullptr); },
        caster);
    hit_buffer.read(std::span(hits).subspan(row * width, count));
    if (steps) step_buffer.read(std::span(*steps).subspan(row * width, count));
  }
  return hits;
}

void for_each_file(Context& context, const std::vector<std::string>& paths,
                   const std::function<void(const std::string&)>& work) {
  std::size_t failed = 0;
  ErrorKind first{};
  for (const std::string& path : paths) {
    try {
      work(path);
    } catch (const Error& error) {
      if (paths.size() == 1 || error.kind() == ErrorKind::kUsage || error.kind() == ErrorKind::kDevice) throw;
      print_error(context, error_line(error));
      if (failed++ == 0) first = error.kind();
    }
  }
  if (failed == 0) return;
  const std::string said =
      std::to_string(failed) + " of " + std::to_string(paths.size()) + " files failed, as said above";
  if (failed == paths.size()) throw Error(first, "", said);
  throw BatchFailure(said);
}

void add_proxy_options(CLI::App& stage, ProxyCastOptions& options, bool pictures) {
  options.declared.push_back(
      add_parsed(stage, "--patch-cache", options.scene.proxy.cache_bytes, parse_bytes, "SIZE",
                 "most that proxies' patch hierarchies may take on the device at once (default: 256M)"));
  if (!pictures) return;
  options.declared.push_back(add_parsed(stage, "--detail", options.scene.pixels, parse_pixels, "PIXELS",
                                        "pixels that a proxy's micro-quads may measure (default: 1)"));
  options.declared.push_back(
      add_parsed(stage, "--tessellate", options.tessellate, parse_tessellate, "N",
                 "proxies as triangles instead, of at most 2^N micro-quads a side of a patch"));
}

void check_proxy_options(const ProxyCastOptions& options, const std::vector<std::string>& files) {
  if (std::any_of(files.begin(), files.end(),
                  [](const std::string& file) { return is_scene(file) || is_proxy(file); }))
    return;
  refuse_options(options.declared, files.front(), "is for proxies and scenes, and this is neither");
}

void report_proxies(Context& context, const Caster& caster) {
  const SceneTracer* scene = std::get_if<SceneTracer>(&caster);
  const PatchTracer* tracer = scene != nullptr ? patch_tracer(*scene) : nullptr;
  if (tracer == nullptr) return;
  const ProxyStats& s = stats(*tracer);
  const ProxyBytes b = bytes(*tracer);
  context.report["proxies"] = {{"pairs", s.pairs},
                               {"patches_built", s.built},
                               {"micro_quads_built", s.built_leaves},
                               {"patches_evicted", s.evicted},
                               {"base_bytes", b.base},
                               {"map_bytes", b.maps},
                               {"cache_bytes", b.cache},
                               {"cached_bytes", b.cached}};
}

CLI::Option* add_level_option(CLI::App& stage, std::vector<std::string>& levels, bool several) {
  CLI::Option* option = stage.add_option_function<std::vector<std::string>>(
      "--level",
      [&levels, several](const std::vector<std::string>& words) {
        for (const std::string& word : words)
          for (const std::string& name : parse_level_list(word)) levels.push_back(name);
        if (!several && (levels.size() > 1 || levels[0] == "all"))
          throw Error(ErrorKind::kUsage, "", "--level: one level is wanted");
      },
      several ? "levels with commas between, or all (default: the finest; paint and validate: all); of "
                "render also "
                "auto: for each ray the coarsest whose texels a pixel covers"
              : "the level to use (default: the finest)");
  return option->type_name(several ? "Q0,Q1" : "Q0")->allow_extra_args(false);
}

}  // namespace rbvh
