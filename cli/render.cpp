// rbvh render: previews of pairs, scans, proxies and scenes, ray cast.
#include <filesystem>
#include <memory>
#include <set>

#include "cli/asset_options.h"
#include "cli/camera_options.h"
#include "cli/common.h"
#include "cli/exact_options.h"
#include "cli/layer_options.h"
#include "cli/light_options.h"
#include "cli/stages.h"
#include "io/cameras_file.h"
#include "io/image.h"
#include "io/name_template.h"
#include "io/output_file.h"
#include "io/report_json.h"
#include "pipeline/device/open_meanwhile.h"
#include "pipeline/light/bake_layer.h"
#include "pipeline/measure/difference.h"
#include "pipeline/render/pixels.h"
#include "pipeline/render/shade.h"
#include "rbvh/render.h"

namespace rbvh {
namespace {

struct RenderOptions {
  std::vector<std::string> files, levels;
  CameraOptions camera;
  ExactOptions exact;
  std::vector<ExactTraversal> compared;  // none, or two tracers
  Aov aov = Aov::kShaded;
  std::string color_layer;  // empty: the surface's own colours
  int samples = 0;          // 0: the AOV's default
  ProxyCastOptions proxies;
  bool shifted = false;
  LightOptions light;
};

Aov parse_aov(std::string_view text) {
  if (const auto aov = find_aov(text)) return *aov;
  throw Error(
      ErrorKind::kUsage, "",
      "'" + std::string(text) +
          "' is none of shaded, normal, depth, position, leaf, steps, ao, albedo, shadow, direct, indirect");
}

// Two tracers with a comma between.
std::vector<ExactTraversal> parse_compared(std::string_view text) {
  std::vector<ExactTraversal> tracers;
  for (const std::string& name : parse_list(text)) tracers.push_back(parse_tracer(name));
  if (tracers.size() != 2)
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(text) + "' is not two tracers, such as wide16,bvh-stack");
  return tracers;
}

int parse_samples(std::string_view text) { return parse_positive_up_to(text, 1 << 20); }

// What 8-bit formats would have to show.
Image::Kind kind_of(Aov aov) {
  return aov == Aov::kDepth || aov == Aov::kPosition ? Image::Kind::kData : Image::Kind::kColor;
}

// Options that the pictures asked for have no use for.
void check_use(const RenderOptions& options) {
  if (!options.light.cached.empty() && (options.aov != Aov::kShaded || !options.color_layer.empty()))
    throw Error(ErrorKind::kUsage, "", "--cached is for shaded pictures in their own colours");
  if (options.aov != Aov::kShaded && !is_of_light(options.aov) &&
      (options.samples > 0 || !options.color_layer.empty() || !options.light.words.light.empty()))
    throw Error(ErrorKind::kUsage, "",
                "--samples, --light and --color-layer are for shaded and lit pictures");
  check_proxy_options(options.proxies, options.files);
}

class Renderer {
 public:
  Renderer(Context& context, RenderOptions& options) : context_(context), options_(options) {}

  void run() {
    if (options_.compared.empty()) configs_ = {exact_config(options_.exact)};
    for (const ExactTraversal tracer : options_.compared)
      configs_.push_back(exact_config(options_.exact, tracer));
    names_ = NameTemplate(context_.output);
    words_ = {options_.camera.words};
    if (!options_.camera.cameras_path.empty())
      words_ = read_cameras(options_.camera.cameras_path, options_.camera.words);
    check_paths_differ(context_, options_.files, {context_.output});
    image_format(names_.text(), kind_of(options_.aov));
    const std::vector<std::string>& levels = options_.levels;
    check_names_differ(names_, options_.files, levels.size() > 1 || (!levels.empty() && levels[0] == "all"),
                       words_.size() > 1 || options_.camera.turntable > 1);
    check_use(options_);
    prepare_light(options_.light, is_of_light(options_.aov), context_.memory);
    const Resolution size = options_.camera.resolution;
    const std::uint64_t pixels = std::uint64_t{size.width} * size.height;
    check_budget(context_.memory, pixels * kBytesPerPixel, context_.output, "a picture of that resolution");
    opening_ = open_meanwhile(context_.device);
    for_each_file(context_, options_.files, [this](const std::string& path) { render_file(path); });
    write_report();
  }

 private:
  // Hits, their surface, the picture and its sum over the samples.
  static constexpr std::uint64_t kBytesPerPixel = sizeof(Hit) + 2 * sizeof(Vec3f) + 8 * sizeof(float);

  void render_file(const std::string& path) {
    context_.phase_watch.lap();
    const Asset asset = load(
        context_, path,
        {.tessellate = options_.proxies.tessellate,
         .levels = options_.light.bounce_level.empty() ? options_.levels : std::vector<std::string>{"all"}});
    if (!asset.scan() && !options_.compared.empty())
      throw Error(ErrorKind::kUsage, path,
                  std::string("--compare is for scans; this is a ") + (asset.rbvh() ? "pair" : "scene"));
    for (const ExactConfig& config : configs_) {
      check_exact_options(options_.exact, config, asset);
      check_tracer_budget(context_.memory, asset, scene_config(config));
    }
    const std::vector<std::string> levels = levels_to_cast(context_, asset, options_.levels, true);
    const Resolution size = options_.camera.resolution;
    const std::vector<Camera> cameras = place_cameras(
        moved(words_, given_shift(asset, options_.shifted)), options_.camera.turntable,
        {static_cast<Vec3d>(asset.bounds.lo), static_cast<Vec3d>(asset.bounds.hi)},
        options_.camera.up.value_or(asset.up_axis()), static_cast<double>(size.width) / size.height);
    for (const std::string& level : levels) {
      if (options_.aov == Aov::kLeaf) check_leaf_numbers(asset, level);
      for (std::size_t frame = 0; frame < cameras.size(); ++frame) {
        const std::string name = output_name(asset, level, frame);
        if (!names_taken_.insert(name).second) refuse_same_name(path);
        check_output(name, context_.force);
      }
    }
    time_phase(context_, "load");
    if (!device_) {
      device_ = opening_.get();
      context_.report["device"] = device_json(device_->info());
    }
    if (asset.scan()) {
      report_exact(context_, configs_[0]);
      if (configs_.size() > 1) context_.report["compared_with"] = info(configs_[1].traversal).name;
    }
    const std::string& bounce_level = options_.light.bounce_level;
    std::unique_ptr<Tracer> coarse;
    if (!bounce_level.empty() && asset.rbvh())
      coarse = make_tracer(*device_, asset, choose_levels(asset, {bounce_level}).front(),
                           scene_config(configs_[0]));
    else if (!bounce_level.empty())
      note(context_, "rbvh render: " + path + " has no levels; --bounce-level is ignored");
    std::size_t done = 0;
    for (const std::string& level : levels) {
      context_.phase_watch.lap();
      std::vector<std::unique_ptr<Tracer>> tracers;
      for (const ExactConfig& config : configs_)
        tracers.push_back(make_tracer(*device_, asset, level, scene_config(config)));
      device_->finish();
      time_phase(context_, "upload");
      for (std::size_t frame = 0; frame < cameras.size(); ++frame) {
        context_.progress.update(
            "render", static_cast<double>(done++) / static_cast<double>(levels.size() * cameras.size()));
        const Image image =
            options_.compared.empty()
                ? picture(asset, level, *tracers[0], coarse ? *coarse : *tracers[0], cameras[frame])
                : render_difference(*tracers[0], *tracers[1], cameras[frame], size.width, size.height,
                                    asset.bounds.diagonal(), differing_, &timings_);
        context_.phase_watch.lap();
        const std::string name = output_name(asset, level, frame);
        write_image(name, image, context_.force);
        time_phase(context_, "write");
        note_output(name);
      }
      report_proxies(context_, *tracers[0]);
    }
  }

  static std::vector<CameraWords> moved(std::vector<CameraWords> words, Vec3d shift) {
    for (CameraWords& word : words)
      for (std::optional<Vec3d>* point : {&word.position, &word.focal_point})
        if (*point) **point = **point - shift;
    return words;
  }

  SceneConfig scene_config(const ExactConfig& exact) const {
    SceneConfig config = options_.proxies.scene;
    config.exact = exact;
    return config;
  }

  // `shadowing`: what shadows and bounces are cast at.
  Image picture(const Asset& asset, const std::string& level, const Tracer& tracer, const Tracer& shadowing,
                const Camera& camera) {
    RenderConfig config;
    config.width = options_.camera.resolution.width;
    config.height = options_.camera.resolution.height;
    config.aov = options_.aov;
    config.samples = options_.samples;
    config.up = static_cast<Vec3f>(options_.camera.up.value_or(asset.up_axis()));
    config.as_shown = options_.aov != Aov::kShaded &&
                      image_format(names_.text(), kind_of(options_.aov)) != ImageFormat::kExr;
    if (!options_.color_layer.empty()) config.colors = layer_colors(asset, level, options_.color_layer);
    const LightOptions& light = options_.light;
    Image image = !light.cached.empty()        ? by_layer(asset, level, tracer, camera, config)
                  : !light.words.light.empty() ? by_paths(asset, level, tracer, shadowing, camera, config)
                                               : render(tracer, camera, config, &timings_);
    const bool is_lit = !light.cached.empty() || !light.words.light.empty();
    if (is_lit && options_.aov == Aov::kShaded && !light.linear &&
        image_format(names_.text(), Image::Kind::kColor) != ImageFormat::kExr)
      apply_filmic_curve(image);
    if (shows_nothing(image))
      warn(context_, asset.path + ": nothing is in view; the object's bounds and shift are in rbvh info");
    if (options_.aov == Aov::kPosition && !config.as_shown)
      add_to_pixels(image, static_cast<Vec3f>(given_shift(asset, options_.shifted)));
    return image;
  }

  Image by_layer(const Asset& asset, const std::string& level, const Tracer& tracer, const Camera& camera,
                 const RenderConfig& shown) {
    const Level* lit = asset.rbvh() ? asset.rbvh()->find_level(level) : nullptr;
    return render_cached(tracer, baked_layer(asset, lit, options_.light.cached), camera, shown.width,
                         shown.height, shown.samples > 0 ? shown.samples : kShadedSamples, &timings_);
  }

  Image by_paths(const Asset& asset, const std::string& level, const Tracer& tracer, const Tracer& shadowing,
                 const Camera& camera, const RenderConfig& shown) {
    const LightOptions& light = options_.light;
    PathConfig config = light.paths;
    config.width = shown.width;
    config.height = shown.height;
    config.colors = shown.colors;
    if (options_.samples > 0) config.samples = options_.samples;
    if (light.ground) config.ground = ground_below(asset, shown.up);
    config.offset = path_offset(asset, level, light.bounce_level.empty() ? level : light.bounce_level);
    if (options_.aov == Aov::kOcclusion)
      return trace_ambient_occlusion(tracer, shadowing, camera, static_cast<float>(light.distance), config,
                                     context_.progress.callback());
    PathPicture picture =
        trace_paths(tracer, shadowing, camera, make_environment(light.words, camera, shown.up), config,
                    context_.progress.callback());
    timings_.trace += picture.trace_seconds;
    timings_.shade += picture.shade_seconds;
    timings_.rays += picture.rays;
    context_.report["paths"] = {{"samples", picture.samples}, {"noise", picture.noise}};
    return std::move(image_of(picture, options_.aov));
  }

  std::string output_name(const Asset& asset, const std::string& level, std::size_t frame) const {
    return names_.fill(asset.name, level, static_cast<int>(frame));
  }

  void note_output(const std::string& name) {
    std::error_code code;
    const std::uintmax_t bytes = std::filesystem::file_size(name, code);
    bytes_ += code ? 0 : bytes;
    context_.report["outputs"].push_back({{"file", name}, {"bytes", code ? 0 : bytes}});
    detail(context_, "rbvh render: wrote " + name);
  }

  void write_report() {
    auto& report = context_.report;
    report["timings"]["trace"] = timings_.trace;
    report["timings"]["shade"] = timings_.shade;
    report["counts"] = {{"images", report["outputs"].size()},
                        {"rays", timings_.rays},
                        {"mrays_per_second", mrays_per_second(timings_.rays, timings_.trace)}};
    if (!options_.compared.empty()) {
      report["counts"]["differing_pixels"] = differing_;
      note(context_, "rbvh render: " + counted(differing_, "differing pixel"));
    }
    report["bytes"] = bytes_;
  }

  Context& context_;
  RenderOptions& options_;
  NameTemplate names_;
  std::set<std::string> names_taken_;
  std::vector<ExactConfig> configs_;  // one, or the two compared
  std::vector<CameraWords> words_;
  std::future<Device> opening_;
  std::optional<Device> device_;
  RenderTimings timings_;
  std::uint64_t bytes_ = 0, differing_ = 0;  // differing_: pixels of compared pictures
};

}  // namespace

void add_render(CLI::App& app, Context& context) {
  const auto options = std::make_shared<RenderOptions>();
  CLI::App* stage = add_stage(app, context,
                              {"render", "Ray cast previews of pairs, scans, proxies and scenes",
                               "rbvh render dragon.rbvh -o '{name}-{level}.png' --level all"},
                              kWithOutput | kWithDevice | kWithReport,
                              [&context, options] { Renderer(context, *options).run(); });
  stage->add_option("FILE", options->files, ".rbvh pairs, scans, proxies or scenes (.json)")->required();
  add_level_option(*stage, options->levels, true);
  add_parsed(*stage, "--aov", options->aov, parse_aov, "WHAT",
             "shaded (default), normal, depth, position, leaf, steps; of light: ao, albedo, shadow, direct, "
             "indirect; "
             "depth and position go to .exr");
  add_exact_options(*stage, options->exact);
  add_parsed(*stage, "--samples", options->samples, parse_samples, "N",
             "rays a pixel of a shaded picture (default: 4, with --light 64 paths); without --light 1 is the "
             "centre");
  add_parsed(*stage, "--color-layer", options->color_layer, parse_layer_name, "NAME",
             "shades a pair in the colours of a layer of your own: from dark blue (least) to yellow (most)");
  add_parsed(*stage, "--compare", options->compared, parse_compared, "A,B",
             "where two tracers' hits differ, instead of a picture of the scan")
      ->excludes("--aov")
      ->excludes("--tracer")
      ->excludes("--samples")
      ->excludes("--color-layer");
  add_coordinates_option(*stage, options->shifted);
  add_proxy_options(*stage, options->proxies, true);
  add_light_options(*stage, options->light);
  add_camera_options(*stage, options->camera);
}

}  // namespace rbvh
