#include "cli/asset_options.h"

#include <algorithm>

#include "cli/exit_code.h"
#include "cli/remedies.h"
#include "io/parts_file.h"
#include "io/proxy_file.h"
#include "io/report_json.h"
#include "io/scene_file.h"
#include "pipeline/scene/asset_content.h"

namespace rbvh {
namespace {

constexpr std::pair<std::string_view, bool> kCoordinates[] = {{"file", false}, {"shifted", true}};

std::uint32_t parse_tessellate(std::string_view text) {
  return static_cast<std::uint32_t>(parse_integer_between(text, 0, PATCH_MOST_LEVEL));
}

}  // namespace

Asset load(Context& context, const std::string& path, LoadConfig config) {
  config.memory = context.memory;
  Asset asset = load_asset(path, config, context.progress.callback());
  warn_of_textures(context, asset);
  return asset;
}

void warn_of_textures(Context& context, const Asset& asset) {
  for (const std::string& fault : texture_faults(asset)) warn(context, asset.path + ": " + fault);
}

void check_is_pair(const std::string& path) {
  if (is_parts(path))
    throw Error(ErrorKind::kInput, path,
                "is a pair of parts, which this stage cannot take; name one of its parts");
  if (!is_rbvh(path)) throw Error(ErrorKind::kInput, path, "is no .rbvh pair");
}

void note_ignored_levels(Context& context, const Asset& asset, const std::vector<std::string>& wanted) {
  const bool has_levels = asset.rbvh() || (asset.scene() && !asset.scene()->level.empty());
  if (!has_levels && !wanted.empty())
    note(context, "rbvh " + context.stage + ": " + asset.path + " has no levels; --level is ignored");
}

std::vector<std::string> levels_to_cast(Context& context, const Asset& asset,
                                        const std::vector<std::string>& wanted, bool has_auto) {
  note_ignored_levels(context, asset, wanted);
  return choose_levels(asset, wanted, has_auto);
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
  options.declared.push_back(add_parsed(stage, "--detail", options.scene.pixels, parse_above_zero, "PIXELS",
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

void report_proxies(Context& context, const Tracer& of) {
  const auto* scene = dynamic_cast<const SceneTracer*>(&of);
  const PatchTracer* tracer = scene != nullptr ? patch_tracer(*scene) : nullptr;
  if (tracer != nullptr) context.report["proxies"] = patch_tracing_json(*tracer);
}

void add_coordinates_option(CLI::App& stage, bool& shifted) {
  add_parsed(stage, "--coordinates", shifted, parse_choice<kCoordinates>, "WHICH",
             "file (the file's own, default), or shifted (those less the shift that info names)");
}

CLI::Option* add_level_option(CLI::App& stage, std::vector<std::string>& levels, bool several) {
  CLI::Option* option = stage.add_option_function<std::vector<std::string>>(
      "--level",
      [&levels, several](const std::vector<std::string>& words) {
        try {
          for (const std::string& word : words)
            for (const std::string& name : parse_list(word)) levels.push_back(name);
        } catch (const Error& error) {
          throw Error(ErrorKind::kUsage, "", std::string("--level: ") + error.what());
        }
        if (!several && (levels.size() > 1 || levels[0] == "all"))
          throw Error(ErrorKind::kUsage, "", "--level: one level is wanted");
      },
      several ? "levels with commas between, or all (default: the finest; paint, validate and view: all); of "
                "render also "
                "auto: for each ray the coarsest whose texels a pixel covers"
              : "the level to use (default: the finest)");
  return option->type_name(several ? "Q0,Q1" : "Q0")->allow_extra_args(false);
}

}  // namespace rbvh
