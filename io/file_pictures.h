// Pictures of files: of each, at its levels, from its cameras, each under a name of its own or all in one.
#pragma once

#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "io/name_template.h"
#include "io/picture_sink.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/light/picture.h"
#include "pipeline/trace/make_tracer.h"
#include "rbvh/asset.h"
#include "rbvh/progress.h"
#include "rbvh/render.h"
#include "rbvh/view.h"

namespace rbvh {

/// What is drawn, and where to.
struct PictureJob {
  std::vector<std::string> files;  ///< all that will be drawn
  std::string output;              ///< a NameTemplate
  bool overwrite = false;
  std::vector<std::string> levels;  ///< as choose_levels() takes them, "auto" too
  std::string secondary_level;      ///< of a pair: of shadows and bounces; empty: the picture's
  CameraRequest cameras;            ///< but its view, aspect and shift
  bool shifted = false;             ///< cameras and positions are in inner coordinates
  RenderConfig shown;               ///< its size, AOV and samples
  Look look;
  Lighting lighting;
  std::vector<ExactConfig> exact =
      std::vector<ExactConfig>(1);          ///< of scans; two: where their hits differ, in place of a picture
  SceneConfig scene;                        ///< but its `exact`
  std::optional<std::uint32_t> tessellate;  ///< as LoadConfig's
  std::string device;                       ///< as Device::open() takes it
  MemoryBudget memory;
};

/// What is told while pictures are drawn, in this order; each may be empty. Those of files may throw.
struct PictureObserver {
  Progress progress;
  std::function<void(std::string_view phase, double seconds)> on_phase;  ///< has ended
  std::function<void(const Asset&)> on_loaded;  ///< a file, before its device is opened
  std::function<void(const Asset&, const Device&)> on_started;
  std::function<void(const Asset&, const PlacedCameras&)> on_view;  ///< was chosen
  /// `text_fault`: why it has none of its texts; else empty.
  std::function<void(const Asset&, const Picture&, const std::string& text_fault)> on_picture;
  std::function<void(const std::string& name, std::uint64_t bytes)> on_written;
  std::function<void(const Tracer&)> on_level;  ///< was drawn by it
};

struct PictureCounts {
  RenderTimings timings;
  std::uint64_t bytes = 0;      ///< written
  std::uint64_t differing = 0;  ///< pixels, of two ways to cast scans
};

/// What 8-bit formats would have to show of it.
Image::Kind kind_of(Aov aov);

class FilePictures {
 public:
  /// Refuses all that can be before a file is read, and begins to open the device. Throws Error(kUsage) where
  /// pictures would have one name, Error(kBudget) for their size.
  FilePictures(PictureJob job, PictureObserver observer);

  /// Draws one of the job's files. Throws as load_asset(), choose_levels(), place_cameras(), draw_picture()
  /// and write_image(), before the device is waited for where it can; others may be drawn all the same.
  void draw(const std::string& path);

  /// Writes what goes to one file, a sheet or a movie.
  void finish();

  const PictureCounts& counts() const { return counts_; }

 private:
  struct File;

  void check_cameras(const Asset& asset) const;
  void check_outputs(const File& file);
  std::unique_ptr<Tracer> tracer_of(const Asset& asset, const std::string& level,
                                    const ExactConfig& exact) const;
  void place(File& file, const Tracer& tracer);
  void draw_level(File& file, std::size_t level, const Tracer* secondary);
  Image picture(const File& file, const PictureSubject& subject, const Camera& camera);
  void written(const std::string& name);
  void end_phase(std::string_view phase);

  PictureJob job_;
  PictureObserver observer_;
  NameTemplate names_;
  PictureSink sink_;
  std::set<std::string> names_taken_;
  std::future<Device> opening_;
  std::optional<Device> device_;
  Stopwatch watch_;
  PictureCounts counts_;
};

}  // namespace rbvh
