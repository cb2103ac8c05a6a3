#include "io/file_pictures.h"

#include <algorithm>
#include <filesystem>
#include <type_traits>
#include <utility>

#include "io/draw_text.h"
#include "io/load_asset.h"
#include "io/output_file.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/device/open_meanwhile.h"
#include "pipeline/measure/difference.h"
#include "pipeline/render/pixels.h"
#include "pipeline/trace/trace_fronts.h"
#include "rbvh/frame.h"

namespace rbvh {
namespace {

// Hits, the rays that leave them, their surface, the picture's parts.
constexpr std::uint64_t kBytesPerPixel = 2 * sizeof(Hit) + 2 * sizeof(Ray) + 24 * sizeof(float);

template <class... Arguments>
void tell(const std::function<void(Arguments...)>& listener, std::type_identity_t<Arguments>... arguments) {
  if (listener) listener(arguments...);
}

SceneConfig with_exact(SceneConfig config, const ExactConfig& exact) {
  config.exact = exact;
  return config;
}

}  // namespace

/// The one under way.
struct FilePictures::File {
  Asset asset;
  std::vector<std::string> levels;
  std::size_t frames;      ///< of each level
  Vec3d shift;             ///< of what is given
  PlacedCameras placed{};  ///< once for all levels
};

Image::Kind kind_of(Aov aov) {
  return aov == Aov::kDepth || aov == Aov::kPosition ? Image::Kind::kData : Image::Kind::kColor;
}

FilePictures::FilePictures(PictureJob job, PictureObserver observer)
    : job_(std::move(job)),
      observer_(std::move(observer)),
      names_(job_.output),
      sink_(names_.text(), kind_of(job_.shown.aov), job_.overwrite, job_.look.sheet) {
  const std::vector<std::string>& levels = job_.levels;
  if (!sink_.is_one())
    check_names_differ(names_, job_.files, levels.size() > 1 || (!levels.empty() && levels[0] == "all"),
                       job_.cameras.words.size() > 1 || job_.cameras.turns > 1);
  const std::uint64_t bytes = job_.lighting.words.light.empty() ? kBytesPerPixel : kPathBytesPerPixel;
  check_budget(job_.memory, std::uint64_t{job_.shown.width} * job_.shown.height * bytes, job_.output,
               "a picture of that resolution");
  opening_ = open_meanwhile(job_.device);
}

void FilePictures::draw(const std::string& path) {
  watch_.lap();
  const std::vector<std::string> all{"all"};
  const Asset asset = load_asset(path,
                                 {.memory = job_.memory,
                                  .tessellate = job_.tessellate,
                                  .levels = job_.secondary_level.empty() ? job_.levels : all},
                                 observer_.progress);
  tell(observer_.on_loaded, asset);
  for (const ExactConfig& exact : job_.exact)
    check_tracer_budget(job_.memory, asset, with_exact(job_.scene, exact));
  File file{.asset = asset,
            .levels = choose_levels(asset, job_.levels, true),
            .frames = job_.cameras.words.size() * static_cast<std::size_t>(std::max(1, job_.cameras.turns)),
            .shift = job_.shifted ? Vec3d{} : shift(asset)};
  check_outputs(file);
  for (const CameraWords& words : job_.cameras.words)  // that no camera fits
    place_camera(less_shift(words, file.shift), to_double(asset.bounds),
                 job_.cameras.up.value_or(asset.up_axis()), 1);
  end_phase("load");
  if (!device_) device_ = opening_.get();
  tell(observer_.on_started, asset, *device_);
  std::unique_ptr<Tracer> secondary;  // none: what the picture is cast at
  if (asset.rbvh() && !job_.secondary_level.empty())
    secondary = tracer_of(asset, choose_levels(asset, {job_.secondary_level}).front(), job_.exact[0]);
  for (std::size_t level = 0; level < file.levels.size(); ++level) draw_level(file, level, secondary.get());
}

void FilePictures::finish() {
  if (sink_.finish(job_.output)) written(job_.output);
}

/// Whether all pictures of a file can be written, each under a name of its own.
void FilePictures::check_outputs(const File& file) {
  for (const std::string& level : file.levels) {
    if (job_.shown.aov == Aov::kLeaf) check_leaf_numbers(file.asset, level);
    for (std::size_t frame = 0; frame < file.frames; ++frame) {
      const std::string name = names_.fill(file.asset.name, level, static_cast<int>(frame));
      if (!names_taken_.insert(name).second && !sink_.is_one()) refuse_same_name(file.asset.path);
      check_output(name, job_.overwrite);
    }
  }
}

std::unique_ptr<Tracer> FilePictures::tracer_of(const Asset& asset, const std::string& level,
                                                const ExactConfig& exact) const {
  auto tracer = make_tracer(*device_, asset, level, with_exact(job_.scene, exact));
  return job_.look.hide_back ? make_front_tracer(std::move(tracer)) : std::move(tracer);
}

void FilePictures::place(File& file, const Tracer& tracer) {
  // The views that are tried reach all parts of a pair of parts, which may not be there together.
  const std::optional<Asset> coarsest = load_coarsest(file.asset, job_.memory);
  std::unique_ptr<Tracer> of_coarsest;
  if (coarsest) of_coarsest = tracer_of(*coarsest, "", job_.exact[0]);
  CameraRequest request = job_.cameras;
  request.view = job_.look.view;
  request.aspect = static_cast<double>(job_.shown.width) / job_.shown.height;
  request.shift = file.shift;
  file.placed = place_cameras(coarsest ? *of_coarsest : tracer, file.asset, request);
  if (!file.placed.text.empty()) tell(observer_.on_view, file.asset, file.placed);
}

void FilePictures::draw_level(File& file, std::size_t number, const Tracer* secondary) {
  const std::string& level = file.levels[number];
  watch_.lap();
  std::vector<std::unique_ptr<Tracer>> tracers;
  for (const ExactConfig& exact : job_.exact) tracers.push_back(tracer_of(file.asset, level, exact));
  device_->finish();
  end_phase("upload");
  if (file.placed.cameras.empty()) {
    place(file, *tracers[0]);
    end_phase("view");
  }
  const PictureSubject subject{file.asset, level, job_.secondary_level.empty() ? level : job_.secondary_level,
                               *tracers[0], secondary != nullptr ? *secondary : *tracers[0]};
  const auto pictures = static_cast<double>(file.levels.size() * file.frames);
  for (std::size_t frame = 0; frame < file.placed.cameras.size(); ++frame) {
    report(observer_.progress, "render", static_cast<double>(number * file.frames + frame) / pictures);
    const Camera& camera = file.placed.cameras[frame];
    Image image = tracers.size() > 1 ? render_difference(*tracers[0], *tracers[1], camera, job_.shown.width,
                                                         job_.shown.height, file.asset.bounds.diagonal(),
                                                         counts_.differing, &counts_.timings)
                                     : picture(file, subject, camera);
    watch_.lap();
    const std::string name = names_.fill(file.asset.name, level, static_cast<int>(frame));
    sink_.add(name, std::move(image));
    end_phase("write");
    if (!sink_.is_one()) written(name);
  }
  tell(observer_.on_level, *tracers[0]);
}

Image FilePictures::picture(const File& file, const PictureSubject& subject, const Camera& camera) {
  RenderConfig shown = job_.shown;
  shown.up = static_cast<Vec3f>(file.placed.up);
  shown.as_shown = !sink_.is_exr();
  Picture drawn =
      draw_picture(subject, camera, shown, job_.lighting, job_.look, counts_.timings, observer_.progress);
  if (shown.aov == Aov::kPosition) add_to_pixels(drawn.image, static_cast<Vec3f>(file.shift));
  const std::string fault = draw_texts(drawn.texts, job_.look.font, drawn.image);
  tell(observer_.on_picture, file.asset, drawn, fault);
  return std::move(drawn.image);
}

void FilePictures::written(const std::string& name) {
  std::error_code code;
  const std::uintmax_t size = std::filesystem::file_size(name, code);
  const std::uint64_t bytes = code ? 0 : size;
  counts_.bytes += bytes;
  tell(observer_.on_written, name, bytes);
}

void FilePictures::end_phase(std::string_view phase) {
  const double seconds = watch_.lap();
  tell(observer_.on_phase, phase, seconds);
}

}  // namespace rbvh
