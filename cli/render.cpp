// rbvh render: previews of pairs, scans, proxies and scenes, ray cast.
#include <filesystem>
#include <memory>
#include <set>

#include "cli/asset_options.h"
#include "cli/camera_options.h"
#include "cli/common.h"
#include "cli/exact_options.h"
#include "cli/light_options.h"
#include "cli/look_options.h"
#include "cli/stages.h"
#include "io/cameras_file.h"
#include "io/draw_text.h"
#include "io/load_asset.h"
#include "io/name_template.h"
#include "io/output_file.h"
#include "io/picture_sink.h"
#include "pipeline/device/open_meanwhile.h"
#include "pipeline/light/light_words.h"
#include "pipeline/light/picture.h"
#include "pipeline/measure/difference.h"
#include "pipeline/render/pixels.h"
#include "pipeline/trace/trace_fronts.h"
#include "rbvh/render.h"

namespace rbvh {
namespace {

struct RenderOptions {
  std::vector<std::string> files, levels;
  CameraOptions camera;
  ExactOptions exact;
  std::vector<ExactTraversal> compared;  // none, or two tracers
  Aov aov = Aov::kShaded;
  int samples = 0;  // 0: the AOV's default
  Look look;
  ProxyCastOptions proxies;
  bool shifted = false;
  LightOptions light;
  const CLI::App* stage = nullptr;
};

int parse_samples(std::string_view text) { return parse_integer_between(text, 1, 1 << 20); }

// What 8-bit formats would have to show.
Image::Kind kind_of(Aov aov) {
  return aov == Aov::kDepth || aov == Aov::kPosition ? Image::Kind::kData : Image::Kind::kColor;
}

// Options that the pictures asked for have no use for.
void check_use(const RenderOptions& options) {
  if (!options.light.cached.empty() && (options.aov != Aov::kShaded || !options.look.colored.name.empty()))
    throw Error(ErrorKind::kUsage, "", "--cached is for shaded pictures in their own colours");
  if (options.aov != Aov::kShaded && !is_of_light(options.aov) &&
      (options.samples > 0 || !options.look.colored.name.empty() || !options.light.words.light.empty()))
    throw Error(ErrorKind::kUsage, "",
                "--samples, --light and --color-layer are for shaded and lit pictures");
  if (options.look.edges && kind_of(options.aov) == Image::Kind::kData)
    throw Error(ErrorKind::kUsage, "", "--edges are drawn in colours; depth and position are data");
  check_proxy_options(options.proxies, options.files);
}

class Renderer {
 public:
  Renderer(Context& context, RenderOptions options) : context_(context), options_(std::move(options)) {}

  void run() {
    prepare();
    opening_ = open_meanwhile(context_.device);
    for_each_file(context_, options_.files, [this](const std::string& path) { render_file(path); });
    if (sink_.finish(context_.output)) report_output(context_.output);
    write_report();
  }

 private:
  // Hits, the rays that leave them, their surface, the picture's parts.
  static constexpr std::uint64_t kBytesPerPixel = 2 * sizeof(Hit) + 2 * sizeof(Ray) + 24 * sizeof(float);

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
    sink_ = PictureSink(names_.text(), kind_of(options_.aov), context_.force, options_.look.sheet);
    const std::vector<std::string>& levels = options_.levels;
    if (!sink_.is_one())
      check_names_differ(names_, options_.files, levels.size() > 1 || (!levels.empty() && levels[0] == "all"),
                         words_.size() > 1 || options_.camera.turntable > 1);
    check_use(options_);
    if (options_.aov == Aov::kOcclusion) refuse_for_occlusion(*options_.stage);
    prepare_light(context_, options_.light, is_of_light(options_.aov));
    const Resolution size = options_.camera.resolution;
    const std::uint64_t bytes = options_.light.words.light.empty() ? kBytesPerPixel : kPathBytesPerPixel;
    check_budget(context_.memory, std::uint64_t{size.width} * size.height * bytes, context_.output,
                 "a picture of that resolution");
  }

  void render_file(const std::string& path) {
    context_.phase_watch.lap();
    const Asset asset = load_file(path);
    const std::vector<std::string> levels = levels_to_cast(context_, asset, options_.levels, true);
    const std::size_t frames =
        words_.size() * static_cast<std::size_t>(std::max(1, options_.camera.turntable));
    check_outputs(asset, levels, frames);
    check_words(asset);
    placed_ = {};
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
        context_.progress.update(
            "render", static_cast<double>(i * frames + frame) / static_cast<double>(levels.size() * frames));
      };
      render_level(asset, levels[i], secondary.get(), progress);
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

  // Words that no camera fits, before a device is opened.
  void check_words(const Asset& asset) const {
    for (const CameraWords& words : words_)
      place_camera(less_shift(words, given_shift(asset, options_.shifted)), to_double(asset.bounds),
                   options_.camera.up.value_or(asset.up_axis()), 1);
  }

  // Once for all levels of a file. Says from where it is seen where nobody said so.
  void place(const Asset& asset, const Tracer& tracer) {
    const Resolution size = options_.camera.resolution;
    // The views that are tried reach all parts of a pair of parts, which may not be there together.
    const std::optional<Asset> coarsest = load_coarsest(asset, context_.memory);
    std::unique_ptr<Tracer> of_coarsest;
    if (coarsest) of_coarsest = tracer_of(*coarsest, "", configs_[0]);
    placed_ = place_cameras(coarsest ? *of_coarsest : tracer, asset,
                            {.words = words_,
                             .turns = options_.camera.turntable,
                             .view = options_.look.view,
                             .up = options_.camera.up,
                             .aspect = static_cast<double>(size.width) / size.height,
                             .shift = given_shift(asset, options_.shifted)});
    if (placed_.text.empty()) return;
    context_.report["views"].push_back({{"file", asset.path}, {"view", placed_.text}});
    if (options_.look.view == View::kChosen)
      note(context_, "rbvh render: " + asset.path + ": " + placed_.text);
  }

  // Whether all pictures of a file can be written, each under a name of its own.
  void check_outputs(const Asset& asset, const std::vector<std::string>& levels, std::size_t frames) {
    for (const std::string& level : levels) {
      if (options_.aov == Aov::kLeaf) check_leaf_numbers(asset, level);
      for (std::size_t frame = 0; frame < frames; ++frame) {
        const std::string name = output_name(asset, level, frame);
        if (!names_taken_.insert(name).second && !sink_.is_one()) refuse_same_name(asset.path);
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
                    const std::function<void(std::size_t)>& progress) {
    context_.phase_watch.lap();
    std::vector<std::unique_ptr<Tracer>> tracers;
    for (const ExactConfig& config : configs_) tracers.push_back(tracer_of(asset, level, config));
    device_->finish();
    time_phase(context_, "upload");
    if (placed_.cameras.empty()) {
      place(asset, *tracers[0]);
      time_phase(context_, "view");
    }
    const std::vector<Camera>& cameras = placed_.cameras;
    const Resolution size = options_.camera.resolution;
    const std::string& bounce_level = options_.light.bounce_level;
    const PictureSubject subject{asset, level, bounce_level.empty() ? level : bounce_level, *tracers[0],
                                 secondary != nullptr ? *secondary : *tracers[0]};
    for (std::size_t frame = 0; frame < cameras.size(); ++frame) {
      progress(frame);
      Image image = tracers.size() > 1
                        ? render_difference(*tracers[0], *tracers[1], cameras[frame], size.width, size.height,
                                            asset.bounds.diagonal(), differing_, &timings_)
                        : picture(subject, cameras[frame]);
      context_.phase_watch.lap();
      const std::string name = output_name(asset, level, frame);
      sink_.add(name, std::move(image));
      time_phase(context_, "write");
      if (!sink_.is_one()) report_output(name);
    }
    report_proxies(context_, *tracers[0]);
  }

  Image picture(const PictureSubject& subject, const Camera& camera) {
    const Asset& asset = subject.asset;
    RenderConfig shown;
    shown.width = options_.camera.resolution.width;
    shown.height = options_.camera.resolution.height;
    shown.aov = options_.aov;
    shown.samples = options_.samples;
    shown.up = static_cast<Vec3f>(placed_.up);
    shown.as_shown = !sink_.is_exr();
    Picture drawn = draw_picture(subject, camera, shown, options_.light, options_.look, timings_,
                                 context_.progress.callback());
    if (drawn.path_samples > 0)
      context_.report["paths"] = {{"samples", drawn.path_samples}, {"noise", drawn.noise}};
    if (drawn.is_empty)
      warn(context_, asset.path + ": nothing is in view; the object's bounds and shift are in rbvh info");
    if (options_.aov == Aov::kPosition)
      add_to_pixels(drawn.image, static_cast<Vec3f>(given_shift(asset, options_.shifted)));
    const std::string fault = draw_texts(drawn.texts, options_.look.font, drawn.image);
    if (!fault.empty()) warn(context_, "pictures have no text: " + fault + "; name one with --font-file");
    return std::move(drawn.image);
  }

  SceneConfig scene_config(const ExactConfig& exact) const {
    SceneConfig config = options_.proxies.scene;
    config.exact = exact;
    return config;
  }

  std::unique_ptr<Tracer> tracer_of(const Asset& asset, const std::string& level,
                                    const ExactConfig& exact) const {
    auto tracer = make_tracer(*device_, asset, level, scene_config(exact));
    return options_.look.hide_back ? make_front_tracer(std::move(tracer)) : std::move(tracer);
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
  RenderOptions options_;
  NameTemplate names_;
  std::set<std::string> names_taken_;
  PictureSink sink_;
  PlacedCameras placed_;              // around the file under way
  std::vector<ExactConfig> configs_;  // one, or the two compared
  std::vector<CameraWords> words_;
  std::future<Device> opening_;
  std::optional<Device> device_;
  RenderTimings timings_;
  std::uint64_t bytes_ = 0, differing_ = 0;  // differing_: pixels of compared pictures
};

void run_render(Context& context, const RenderOptions& options) { Renderer(context, options).run(); }

}  // namespace

void add_render(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(app, context,
                                          {"render", "Ray cast previews of pairs, scans, proxies and scenes",
                                           "rbvh render dragon.rbvh -o '{name}-{level}.png' --level all"},
                                          kWithOutput | kWithDevice | kWithReport, run_render);
  options->stage = stage;
  stage->add_option("FILE", options->files, ".rbvh pairs, scans, proxies or scenes (.json)")->required();
  add_level_option(*stage, options->levels, true);
  add_parsed(*stage, "--aov", options->aov, parse_aov, "WHAT",
             "shaded (default), normal, depth, position, leaf, steps; of light: ao, albedo, shadow, direct, "
             "indirect; "
             "depth and position go to .exr");
  add_exact_options(*stage, options->exact);
  add_parsed(
      *stage, "--samples", options->samples, parse_samples, "N",
      "rays a pixel of a shaded picture (default: 16 of small ones, else 4; with --light 64 paths); with "
      "--quick 1 is the centre");
  add_camera_options(*stage, options->camera);
  add_look_options(*stage, options->look);
  add_parsed(*stage, "--compare", options->compared, parse_two_traversals, "A,B",
             "where two tracers' hits differ, instead of a picture of the scan")
      ->excludes("--aov")
      ->excludes("--tracer")
      ->excludes("--samples")
      ->excludes("--color-layer");
  add_coordinates_option(*stage, options->shifted);
  add_proxy_options(*stage, options->proxies, true);
  add_light_options(*stage, options->light);
}

}  // namespace rbvh
