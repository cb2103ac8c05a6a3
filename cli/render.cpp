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
#include "pipeline/device/open_meanwhile.h"
#include "pipeline/light/light_words.h"
#include "pipeline/light/picture.h"
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

int parse_samples(std::string_view text) { return parse_integer_between(text, 1, 1 << 20); }

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
    prepare();
    opening_ = open_meanwhile(context_.device);
    for_each_file(context_, options_.files, [this](const std::string& path) { render_file(path); });
    write_report();
  }

 private:
  // Hits, their surface, the picture and its sum over the samples.
  static constexpr std::uint64_t kBytesPerPixel = sizeof(Hit) + 2 * sizeof(Vec3f) + 8 * sizeof(float);

  // All that can be read and refused before the first file is.
  void prepare() {
    const std::optional<ExactBuilder> builder = options_.exact.builder;
    for (const ExactTraversal tracer : options_.compared) configs_.push_back(exact_config(tracer, builder));
    if (configs_.empty()) configs_ = {exact_config(options_.exact.tracer, builder)};
    names_ = NameTemplate(context_.output);
    words_ = {options_.camera.words};
    if (!options_.camera.cameras_path.empty())
      words_ = read_cameras(options_.camera.cameras_path, options_.camera.words);
    check_paths_differ(context_, options_.files, {context_.output});
    is_exr_ = image_format(names_.text(), kind_of(options_.aov)) == ImageFormat::kExr;
    const std::vector<std::string>& levels = options_.levels;
    check_names_differ(names_, options_.files, levels.size() > 1 || (!levels.empty() && levels[0] == "all"),
                       words_.size() > 1 || options_.camera.turntable > 1);
    check_use(options_);
    prepare_light(options_.light, is_of_light(options_.aov), context_.memory);
    const Resolution size = options_.camera.resolution;
    check_budget(context_.memory, std::uint64_t{size.width} * size.height * kBytesPerPixel, context_.output,
                 "a picture of that resolution");
  }

  void render_file(const std::string& path) {
    context_.phase_watch.lap();
    const Asset asset = load_file(path);
    const std::vector<std::string> levels = levels_to_cast(context_, asset, options_.levels, true);
    const std::vector<Camera> cameras = cameras_around(asset);
    check_outputs(asset, levels, cameras.size());
    time_phase(context_, "load");
    if (!device_) {
      device_ = opening_.get();
      report_device(context_, *device_);
    }
    if (asset.scan()) report_exact(context_, configs_[0]);
    if (configs_.size() > 1) context_.report["compared_with"] = info(configs_[1].traversal).name;
    const std::unique_ptr<Tracer> secondary = secondary_tracer(asset);
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const auto progress = [&](std::size_t frame) {
        context_.progress.update("render", static_cast<double>(i * cameras.size() + frame) /
                                               static_cast<double>(levels.size() * cameras.size()));
      };
      render_level(asset, levels[i], secondary.get(), cameras, progress);
    }
  }

  Asset load_file(const std::string& path) {
    const bool has_bounce_level = !options_.light.bounce_level.empty();
    Asset asset = load(context_, path,
                       {.tessellate = options_.proxies.tessellate,
                        .levels = has_bounce_level ? std::vector<std::string>{"all"} : options_.levels});
    if (!asset.scan() && !options_.compared.empty())
      throw Error(ErrorKind::kUsage, path,
                  std::string("--compare is for scans; this is a ") + (asset.rbvh() ? "pair" : "scene"));
    for (const ExactConfig& config : configs_) {
      check_exact_options(options_.exact, config, asset);
      check_tracer_budget(context_.memory, asset, scene_config(config));
    }
    return asset;
  }

  std::vector<Camera> cameras_around(const Asset& asset) const {
    const Vec3d shift = given_shift(asset, options_.shifted);
    std::vector<CameraWords> words = words_;
    for (CameraWords& word : words)
      for (std::optional<Vec3d>* point : {&word.position, &word.focal_point})
        if (*point) **point = **point - shift;
    const Resolution size = options_.camera.resolution;
    return place_cameras(words, options_.camera.turntable,
                         {static_cast<Vec3d>(asset.bounds.lo), static_cast<Vec3d>(asset.bounds.hi)},
                         up_axis(asset), static_cast<double>(size.width) / size.height);
  }

  // Whether all pictures of a file can be written, each under a name of its own.
  void check_outputs(const Asset& asset, const std::vector<std::string>& levels, std::size_t frames) {
    for (const std::string& level : levels) {
      if (options_.aov == Aov::kLeaf) check_leaf_numbers(asset, level);
      for (std::size_t frame = 0; frame < frames; ++frame) {
        const std::string name = output_name(asset, level, frame);
        if (!names_taken_.insert(name).second) refuse_same_name(asset.path);
        check_output(name, context_.force);
      }
    }
  }

  // What shadows and bounces are cast at; none: what the picture is cast at.
  std::unique_ptr<Tracer> secondary_tracer(const Asset& asset) {
    const std::string& level = options_.light.bounce_level;
    if (level.empty()) return {};
    if (asset.rbvh()) return tracer_of(asset, choose_levels(asset, {level}).front(), configs_[0]);
    note(context_, "rbvh render: " + asset.path + " has no levels; --bounce-level is ignored");
    return {};
  }

  void render_level(const Asset& asset, const std::string& level, const Tracer* secondary,
                    const std::vector<Camera>& cameras, const std::function<void(std::size_t)>& progress) {
    context_.phase_watch.lap();
    std::vector<std::unique_ptr<Tracer>> tracers;
    for (const ExactConfig& config : configs_) tracers.push_back(tracer_of(asset, level, config));
    device_->finish();
    time_phase(context_, "upload");
    const std::string& bounce_level = options_.light.bounce_level;
    const PictureSubject subject{asset, level, bounce_level.empty() ? level : bounce_level, *tracers[0],
                                 secondary != nullptr ? *secondary : *tracers[0]};
    for (std::size_t frame = 0; frame < cameras.size(); ++frame) {
      progress(frame);
      const Image image = tracers.size() > 1 ? difference(asset, *tracers[0], *tracers[1], cameras[frame])
                                             : picture(subject, cameras[frame]);
      context_.phase_watch.lap();
      const std::string name = output_name(asset, level, frame);
      write_image(name, image, context_.force);
      time_phase(context_, "write");
      report_output(name);
    }
    report_proxies(context_, *tracers[0]);
  }

  Image difference(const Asset& asset, const Tracer& first, const Tracer& second, const Camera& camera) {
    const Resolution size = options_.camera.resolution;
    return render_difference(first, second, camera, size.width, size.height, asset.bounds.diagonal(),
                             differing_, &timings_);
  }

  Image picture(const PictureSubject& subject, const Camera& camera) {
    const Asset& asset = subject.asset;
    RenderConfig shown;
    shown.width = options_.camera.resolution.width;
    shown.height = options_.camera.resolution.height;
    shown.aov = options_.aov;
    shown.samples = options_.samples;
    shown.up = static_cast<Vec3f>(up_axis(asset));
    shown.as_shown = !is_exr_;
    if (!options_.color_layer.empty())
      shown.colors = layer_colors(asset, subject.level, options_.color_layer);
    Picture drawn =
        draw_picture(subject, camera, shown, options_.light, timings_, context_.progress.callback());
    if (drawn.path_samples > 0)
      context_.report["paths"] = {{"samples", drawn.path_samples}, {"noise", drawn.noise}};
    if (shows_nothing(drawn.image))
      warn(context_, asset.path + ": nothing is in view; the object's bounds and shift are in rbvh info");
    if (options_.aov == Aov::kPosition)
      add_to_pixels(drawn.image, static_cast<Vec3f>(given_shift(asset, options_.shifted)));
    return std::move(drawn.image);
  }

  Vec3d up_axis(const Asset& asset) const { return options_.camera.up.value_or(asset.up_axis()); }

  SceneConfig scene_config(const ExactConfig& exact) const {
    SceneConfig config = options_.proxies.scene;
    config.exact = exact;
    return config;
  }

  std::unique_ptr<Tracer> tracer_of(const Asset& asset, const std::string& level,
                                    const ExactConfig& exact) const {
    return make_tracer(*device_, asset, level, scene_config(exact));
  }

  std::string output_name(const Asset& asset, const std::string& level, std::size_t frame) const {
    return names_.fill(asset.name, level, static_cast<int>(frame));
  }

  void report_output(const std::string& name) {
    std::error_code code;
    const std::uintmax_t size = std::filesystem::file_size(name, code);
    const std::uintmax_t bytes = code ? 0 : size;
    bytes_ += bytes;
    context_.report["outputs"].push_back({{"file", name}, {"bytes", bytes}});
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
  bool is_exr_ = false;
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
  add_parsed(*stage, "--color-layer", options->color_layer, parse_name, "NAME",
             "shades a pair in the colours of a layer of your own: from dark blue (least) to yellow (most)");
  add_parsed(*stage, "--compare", options->compared, parse_two_traversals, "A,B",
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
