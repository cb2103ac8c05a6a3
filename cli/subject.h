// What rays are cast at: a level of an .rbvh pair; a scan of any ingest format, uncleaned, as exact triangles
// or discs; a proxy; or a scene of all of these.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "cli/common.h"
#include "io/rbvh_file.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/render/shade.h"
#include "pipeline/scan/scan.h"
#include "pipeline/scene/scene.h"
#include "pipeline/trace/trace_exact.h"
#include "pipeline/trace/trace_footprint.h"
#include "pipeline/trace/trace_scene.h"
#include "pipeline/trace/trace_tile.h"

namespace rbvh {

struct Subject {
  std::string path;
  std::string name;                         ///< without folders and extension
  std::variant<Rbvh, Scan, Scene> content;  ///< a proxy is a scene of one object
  Bounds3f bounds;
  bool is_cloud = false;

  const Rbvh* rbvh() const { return std::get_if<Rbvh>(&content); }
  const Scan* scan() const { return std::get_if<Scan>(&content); }
  const Scene* scene() const { return std::get_if<Scene>(&content); }
  Vec3d up_axis() const {
    return is_cloud || (scene() && scene()->z_is_up) ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0};
  }
};

/// True for a file that starts as an .rbvh does, or is named as one.
bool is_rbvh(const std::string& path);

/// Reads a pair, its texels once it is known that --memory has room for them.
Rbvh load_pair(const Context& context, const std::string& path, PairHeader* header = nullptr);

/// Reads a pair, a scan ("-": from standard input), a proxy or a scene and all its objects. A cloud gets the
/// normals and radii that it lacks. `tessellate`: proxies become triangles, up to 2^tessellate micro-quads a
/// side of a patch. Throws Error(kInput), also where nothing finite is left or all points are equal.
Subject load_subject(Context& context, const std::string& path, std::optional<std::uint32_t> tessellate = {});

/// Reads a scan as load_subject() does.
Scan load_exact_scan(Context& context, const std::string& path);

/// The names of the levels to show: `wanted` may be empty (the finest) or hold "all". For a scan: "exact";
/// for proxies and scenes: "scene"; what is wanted is ignored there, with a note. Throws Error(kUsage) for a
/// level that is not there. With `has_auto`, "auto" (alone) is one: each ray sees the level that its
/// footprint asks for.
std::vector<std::string> choose_levels(Context& context, const Subject& subject,
                                       const std::vector<std::string>& wanted, bool has_auto = false);

/// Throws Error(kInput) where leaves or primitives are more than a float32 can number, as trace and `leaf`
/// pictures do.
void check_leaf_numbers(const Subject& subject, const std::string& level);

/// Throws Error(kBudget) where what casting at a scene takes beside the files is over --memory: hierarchies
/// of scans, maps of proxies, their patch cache. (check_exact_options() sees to a scan alone.)
void check_cast_budget(const Context& context, const Subject& subject, const SceneConfig& config);

using Caster = std::variant<TileTracer, ExactTracer, FootprintTracer, SceneTracer>;

/// `level` is one of choose_levels(); `config` is how scans and proxies are cast; `spread`: of "auto", see
/// FootprintTracer.
Caster make_caster(const Device& device, const Subject& subject, const std::string& level,
                   const SceneConfig& config = {}, float spread = 0);

/// The pair's surface at the hits of such a caster.
SurfaceSamples sample_pair(const Rbvh& rbvh, const std::string& level, const Caster& caster,
                           std::span<const Hit> hits);

/// Casts a camera's rays in bands that fit the device: width * height hits, row by row; as many steps where
/// asked for.
std::vector<Hit> cast_camera(const Caster& caster, const CameraRays& rays,
                             std::vector<std::uint32_t>* steps = nullptr);

/// Runs `work` for each path. Of one path, its error is thrown; of several, each error is a line, the others
/// are done, and BatchFailure is thrown at the end (where all failed, an Error of the first one's kind).
/// Usage and device errors stop at once.
void for_each_file(Context& context, const std::vector<std::string>& paths,
                   const std::function<void(const std::string&)>& work);

/// How proxies are cast.
struct ProxyCastOptions {
  SceneConfig scene;
  std::optional<std::uint32_t> tessellate;   ///< as triangles, of that level
  std::vector<const CLI::Option*> declared;  ///< all of them
};

/// --patch-cache and, where pictures are made, --detail and --tessellate.
void add_proxy_options(CLI::App& stage, ProxyCastOptions& options, bool pictures);

/// Throws Error(kUsage) where one of them is given and none of the files is a proxy or a scene.
void check_proxy_options(const ProxyCastOptions& options, const std::vector<std::string>& files);

/// Says in the report what casting proxies took. Nothing where there are none.
void report_proxies(Context& context, const Caster& caster);

/// --level: given several times, or with commas, or "all".
CLI::Option* add_level_option(CLI::App& stage, std::vector<std::string>& levels, bool several);

}  // namespace rbvh
