#include "io/texture_files.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "io/foreign_image.h"
#include "io/image_module.h"
#include "io/input_file.h"
#include "io/max_expansion.h"
#include "io/png.h"
#include "io/text_cursor.h"
#include "pipeline/base/error.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

constexpr int kMostSide = 1 << 16;
/// In memory, with its smaller versions and a copy for grey images.
constexpr std::uint64_t kBytesPerTexel = 5;
/// Named in a message.
constexpr std::size_t kMostNamed = 4, kMostOfName = 80;

[[noreturn]] void refuse(const std::string& why) { throw Error(ErrorKind::kInput, "", why); }

bool is_file(const fs::path& path) {
  std::error_code code;
  return fs::is_regular_file(path, code);
}

class ImageLoader {
 public:
  ImageLoader(const std::string& file, const MemoryBudget& memory)
      : file_(file), left_(memory_limit(memory)) {}

  std::shared_ptr<const TextureImage> load(const TextureImage& described) {
    auto image = std::make_shared<TextureImage>(described);
    if (image->file.empty()) {
      const std::optional<std::string> path = find_beside(file_, image->name);
      if (!path) refuse("is not there");
      std::error_code code;
      if (fs::file_size(*path, code) > left_) refuse("is over the memory budget");
      image->file = read_input(*path).view();
    }
    take(image->file.size(), "is over the memory budget");
    decode(*image);
    return image;
  }

 private:
  void take(std::uint64_t bytes, const std::string& otherwise) {
    if (bytes > left_) refuse(otherwise);
    left_ -= bytes;
  }

  void decode(TextureImage& image) {
    const char* format = image_format(image.file);
    if (format == nullptr || format == std::string_view("openexr"))
      refuse("is no PNG, JPEG, TIFF, BMP or WebP image");
    if (is_cut_image(image.file)) refuse("is cut");
    std::vector<std::uint8_t> grey;
    std::size_t channels = 0;
    const auto place = [&](const ImageHeader& header) -> void* {
      channels = header.channels.size();
      if (header.is_deep || header.depth > 1 || header.width < 1 || header.height < 1 || channels < 1 ||
          channels > 64 || header.tile_width > 4096 || header.tile_height > 4096)
        refuse("is not a flat image");
      if (header.width > kMostSide || header.height > kMostSide) refuse("is over 65536 pixels a side");
      image.width = static_cast<std::uint32_t>(header.width);
      image.height = static_cast<std::uint32_t>(header.height);
      const std::uint64_t texels = std::uint64_t{image.width} * image.height;
      if (texels > kMaxExpansion * image.file.size())
        refuse("claims " + std::to_string(texels) + " pixels, more than it has bytes for");
      take(texels * kBytesPerTexel, "is over the memory budget with its " + std::to_string(header.width) +
                                        " x " + std::to_string(header.height) + " pixels");
      image.texels.resize(texels);
      if (channels >= 3) return image.texels.data();
      grey.resize(texels * channels);
      return grey.data();
    };
    const StderrAside aside;
    const std::string fault =
        image_module(file_).decode(format, image.file, place, ImageSpec::Type::kUint8, 3, thread_count());
    if (!fault.empty()) refuse(fault);
    for (std::size_t i = 0; i < image.texels.size() && channels < 3; ++i)
      image.texels[i].fill(grey[i * channels]);
  }

  const std::string& file_;
  std::uint64_t left_;
};

/// The textures whose images could be had, and where each was before.
struct Loaded {
  std::vector<Texture> textures;
  std::vector<std::uint32_t> numbers;  ///< of those before; FaceTexture::kNone: lost
  std::map<std::string, std::string> faults;
};

Loaded load_all(std::vector<Texture>&& textures, const std::string& file, const MemoryBudget& memory) {
  Loaded loaded;
  ImageLoader loader(file, memory);
  std::map<const TextureImage*, std::shared_ptr<const TextureImage>> images;
  std::vector<std::shared_ptr<const TextureImage>> kept;  // their addresses stay theirs
  for (Texture& texture : textures) {
    kept.push_back(texture.image);
    auto [at, is_new] = images.try_emplace(texture.image.get());
    if (is_new) try {
        at->second = loader.load(*texture.image);
      } catch (const std::exception& error) {
        const auto* own = dynamic_cast<const Error*>(&error);
        loaded.faults[texture.image->name] =
            one_line(own != nullptr ? own->message() : "takes more memory than there is");
      }
    texture.image = at->second;
    loaded.numbers.push_back(texture.image ? static_cast<std::uint32_t>(loaded.textures.size())
                                           : FaceTexture::kNone);
    if (texture.image) loaded.textures.push_back(std::move(texture));
  }
  return loaded;
}

bool is_finite(const FaceTexture& face) {
  return std::all_of(face.corners.begin(), face.corners.end(),
                     [](const auto& uv) { return std::isfinite(uv[0]) && std::isfinite(uv[1]); });
}

}  // namespace

std::optional<std::string> find_beside(const std::string& file, std::string_view name) {
  std::string wanted(name);
  std::replace(wanted.begin(), wanted.end(), '\\', '/');
  if (file == "-" || file == input_name("-") || wanted.empty() || wanted.find('\0') != std::string::npos)
    return {};
  const fs::path folder = fs::path(file).parent_path(), path(wanted);
  const bool leads_away = path.is_absolute() || wanted.find(':') != std::string::npos ||
                          std::find(path.begin(), path.end(), "..") != path.end();
  if (!leads_away && is_file(folder / path)) return (folder / path).string();
  const fs::path last = folder / wanted.substr(wanted.find_last_of("/:") + 1);
  if (last.has_filename() && is_file(last)) return last.string();
  return {};
}

void load_textures(RawScan& scan, const std::string& file, const MemoryBudget& memory) {
  if (scan.face_textures.empty()) {
    scan.textures.clear();
    return;
  }
  RBVH_CHECK(scan.face_textures.size() == scan.triangles.size());
  const std::size_t count = scan.textures.size();
  Loaded loaded = load_all(std::move(scan.textures), file, memory);
  scan.textures = std::move(loaded.textures);
  std::size_t bare = 0, not_finite = 0, textured = 0;
  for (FaceTexture& face : scan.face_textures) {
    if (face.texture == FaceTexture::kNone) continue;
    RBVH_CHECK(face.texture < count);
    face.texture = loaded.numbers[face.texture];
    const bool is_lost = face.texture == FaceTexture::kNone, is_placed = is_finite(face);
    bare += is_lost;
    not_finite += !is_lost && !is_placed;
    if (is_lost || !is_placed) face = {};
    textured += face.texture != FaceTexture::kNone;
  }
  if (textured == 0) scan.face_textures.clear();
  if (textured == 0) scan.textures.clear();

  if (!loaded.faults.empty()) {
    std::string names;
    std::size_t named = 0;
    for (const auto& [name, fault] : loaded.faults) {
      if (named++ < kMostNamed) names += (names.empty() ? "" : "; ") + shown(name, kMostOfName) + " " + fault;
    }
    if (named > kMostNamed) names += "; ...";
    scan.texture_faults.push_back(counted(bare, "face") + (bare == 1 ? " has" : " have") + " lost " +
                                  (bare == 1 ? "its texture: " : "their textures: ") + names);
  }
  if (not_finite > 0)
    scan.texture_faults.push_back(counted(not_finite, "face") +
                                  " with texture coordinates that are no numbers left bare");
}

std::string image_file(const TextureImage& image) {
  if (!image.file.empty()) return image.file;
  const std::vector<std::byte> png =
      encode_png(image.width, image.height, 3, {image.texels.data()->data(), 3 * image.texels.size()}, true);
  return {reinterpret_cast<const char*>(png.data()), png.size()};
}

}  // namespace rbvh
