// What the stages that cast rays share: their files, --level, and how proxies are cast.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cli/common.h"
#include "io/load_asset.h"
#include "pipeline/trace/make_tracer.h"
#include "rbvh/frame.h"

namespace rbvh {

/// load_asset() under the stage's --memory.
Asset load(Context& context, const std::string& path, LoadConfig config = {});

/// Says which of its textures could not be read.
void warn_of_textures(Context& context, const Asset& asset);

/// Throws Error(kInput) for any other file.
void check_is_pair(const std::string& path);

/// For stages that take all levels unless told otherwise.
inline std::vector<std::string> or_all(const std::vector<std::string>& levels) {
  return levels.empty() ? std::vector<std::string>{"all"} : levels;
}

/// A note where levels are wanted and the asset has none to choose from.
void note_ignored_levels(Context& context, const Asset& asset, const std::vector<std::string>& wanted);

/// choose_levels() after that note.
std::vector<std::string> levels_to_cast(Context& context, const Asset& asset,
                                        const std::vector<std::string>& wanted, bool has_auto = false);

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
void report_proxies(Context& context, const Tracer& tracer);

/// --coordinates: what is given and got are the file's own coordinates, or the inner ones, which are less by
/// the shift.
void add_coordinates_option(CLI::App& stage, bool& shifted);

/// What is to be subtracted from coordinates that are given.
inline Vec3d given_shift(const Asset& asset, bool shifted) { return shifted ? Vec3d{} : shift(asset); }

/// --level: given several times, or with commas, or "all".
CLI::Option* add_level_option(CLI::App& stage, std::vector<std::string>& levels, bool several);

}  // namespace rbvh
