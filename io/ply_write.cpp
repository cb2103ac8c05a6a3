// The writing half of io/ply.h.
#include <charconv>
#include <cstring>
#include <deque>
#include <filesystem>
#include <map>
#include <set>

#include "io/file_set.h"
#include "io/foreign_image.h"
#include "io/hash.h"
#include "io/output_file.h"
#include "io/ply.h"
#include "io/ply_header.h"
#include "io/scan_io.h"
#include "io/texture_files.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace fs = std::filesystem;
namespace {

/// Shortest text that reads back as the same double.
std::string round_trip(double value) {
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof(text), value);
  RBVH_CHECK(error == std::errc());
  return {text, end};
}

/// PLY splits its header at spaces, so names of other formats may need a change; two must not become one.
std::vector<std::string> property_names(const Scan& scan) {
  std::set<std::string> taken = {"x", "y", "z", "nx", "ny", "nz", "radius", "red", "green", "blue"};
  if (scan.is_cloud()) taken.insert("object_id");
  if (!scan.is_cloud()) taken.erase("radius");
  std::vector<std::string> names;
  for (const ScalarProperty& property : scan.properties) {
    std::string name = property.name.empty() ? "property" : property.name;
    for (char& c : name)
      if (c <= ' ' || c > '~') c = '_';
    const std::string stem = name;
    for (int i = 2; !taken.insert(name).second; ++i) name = stem + "_" + std::to_string(i);
    names.push_back(name);
  }
  return names;
}

/// Names the textures' images, with what "comment rbvh texture" of ply_header.h says of each.
std::string texture_comments(const Scan& scan, const std::vector<PlyImage>& images) {
  std::string text;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Texture& texture = scan.textures[i];
    const auto wrap = [](TextureWrap how) { return std::string(ply::kWrapNames[static_cast<int>(how)]); };
    text += "comment TextureFile " + images[i].name + "\ncomment rbvh texture " + wrap(texture.wrap_u) + " " +
            wrap(texture.wrap_v) + " " + std::to_string(images[i].bytes) + " " + hash_digits(images[i].hash) +
            (texture.times_colors ? " times-colors\n" : "\n");
  }
  return text;
}

std::string header(const Scan& scan, const std::vector<PlyImage>& images) {
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment written by rbvh\n";
  if (scan.shift != Vec3d{}) {
    text += "comment original coordinates are these plus the shift\ncomment rbvh shift " +
            round_trip(scan.shift.x) + " " + round_trip(scan.shift.y) + " " + round_trip(scan.shift.z) + "\n";
  }
  if (!scan.units.empty()) text += "comment rbvh units " + scan.units + "\n";
  text += texture_comments(scan, images);
  text += "element vertex " + std::to_string(scan.positions.size()) +
          "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!scan.normals.empty()) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!scan.radii.empty()) text += "property float radius\n";
  if (!scan.colors.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  for (const std::string& name : property_names(scan)) text += "property float " + name + "\n";
  if (scan.is_cloud()) {
    if (!scan.object_ids.empty()) text += "property float object_id\n";
  } else {
    text += "element face " + std::to_string(scan.triangles.size()) +
            "\nproperty list uchar int vertex_indices\nproperty int object_id\n";
    if (!images.empty()) text += "property list uchar float texcoord\nproperty int texnumber\n";
  }
  return text + "end_header\n";
}

/// Collects values and hands them on in pieces of about a megabyte.
class Writer {
 public:
  explicit Writer(const std::function<void(std::span<const std::byte>)>& sink) : sink_(sink) {
    buffer_.reserve(kPiece);
  }
  ~Writer() = default;
  template <class T>
  void put(const T& value) {
    put(&value, sizeof(T));
  }
  void put(const void* data, std::size_t size) {
    if (buffer_.size() + size > kPiece) flush();
    const auto* first = static_cast<const std::byte*>(data);
    buffer_.insert(buffer_.end(), first, first + size);
  }
  void flush() {
    if (!buffer_.empty()) sink_(buffer_);
    buffer_.clear();
  }

 private:
  static constexpr std::size_t kPiece = std::size_t{1} << 20;
  const std::function<void(std::span<const std::byte>)>& sink_;
  std::vector<std::byte> buffer_;
};

}  // namespace

void encode_ply(const Scan& scan, const std::function<void(std::span<const std::byte>)>& sink,
                const std::vector<PlyImage>& images) {
  RBVH_CHECK(scan.positions.size() <= INT32_MAX);
  const std::string text = header(scan, images);
  sink(std::as_bytes(std::span(text)));
  Writer out(sink);
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    out.put(scan.positions[i]);
    if (!scan.normals.empty()) out.put(scan.normals[i]);
    if (!scan.radii.empty()) out.put(scan.radii[i]);
    if (!scan.colors.empty()) out.put(scan.colors[i]);
    for (const ScalarProperty& property : scan.properties) out.put(property.values[i]);
    if (scan.is_cloud() && !scan.object_ids.empty()) out.put(static_cast<float>(scan.object_ids[i]));
  }
  for (std::size_t i = 0; i < scan.triangles.size(); ++i) {
    out.put(std::uint8_t{3});
    out.put(scan.triangles[i]);
    out.put(scan.object_ids.empty() ? std::int32_t{0} : scan.object_ids[i]);
    if (images.empty()) continue;
    const FaceTexture& face = scan.face_textures[i];
    const bool is_textured = face.texture != FaceTexture::kNone;
    out.put(std::uint8_t{6});  // also where it shows none: other programs count on it
    out.put(face.corners);
    out.put(is_textured ? static_cast<std::int32_t>(face.texture) : std::int32_t{-1});
  }
  out.flush();
}

bool holds_textures(const std::string& path) {
  std::error_code code;
  return path != "-" && (fs::is_regular_file(path, code) || !fs::exists(path, code));
}

void write_ply(const std::string& path, const Scan& scan, bool overwrite) {
  const auto write_to = [&](OutputFile& out, const std::vector<PlyImage>& images) {
    encode_ply(
        scan, [&](std::span<const std::byte> piece) { out.write(piece); }, images);
  };
  if (scan.textures.empty() || !holds_textures(path)) {
    OutputFile out(path, overwrite);
    write_to(out, {});
    return out.commit();
  }
  OutputFile out(path, overwrite, OutputFile::Role::kInSet);
  std::map<const TextureImage*, PlyImage> written;
  std::vector<PlyImage> images;  // of each texture
  std::deque<OutputFile> files;
  std::vector<SetPart> parts;
  for (const Texture& texture : scan.textures) {
    const auto [image, is_new] = written.try_emplace(texture.image.get());
    if (is_new) {
      const std::string bytes = image_file(*texture.image);
      const fs::path file = fs::path(path).replace_extension(".texture" + std::to_string(parts.size()) +
                                                             image_extension(bytes));
      image->second = {file.filename().string(), bytes.size(), hash_bytes(bytes)};
      files.emplace_back(file.string(), overwrite, OutputFile::Role::kInSet).write(bytes);
      parts.push_back({&files.back(), image->second.hash});
    }
    images.push_back(image->second);
  }
  write_to(out, images);
  commit_set(out, parts);
}

}  // namespace rbvh
