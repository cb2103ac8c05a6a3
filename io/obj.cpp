#include "io/obj.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "io/colors.h"
#include "io/obj_grammar.h"
#include "io/obj_materials.h"
#include "pipeline/scan/cut_polygons.h"

namespace rbvh {
namespace {

constexpr std::int64_t kNone = ObjGrammar::kNone;

class ObjReader {
 public:
  ObjReader(std::string_view bytes, const std::string& file) : in_(bytes, file) {}

  RawScan read() {
    while (in_.next())
      if (!in_.is_comment()) statement(in_.key());
    return finish();
  }

 private:
  void statement(std::string_view key) {
    if (key == "v") {
      vertex();
    } else if (key == "vn") {
      double n[3] = {};
      if (!in_.are_numbers(n, 3)) {
        if (in_.is_cut()) in_.fail("the file is cut in its last normal");
        ++bad_normals_;
        n[0] = n[1] = n[2] = 0;
      }
      file_normals_.push_back({static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
    } else if (key == "f" || key == "fo") {
      face();
    } else if (key == "o" || key == "g") {
      (key == "o" ? object_ : group_) = std::string(in_.rest());
      current_id_ = kNone;
    } else if (key == "vt") {
      double uv[3] = {};
      const float nan = std::numeric_limits<float>::quiet_NaN();
      const bool is_number = in_.leading_numbers(uv, 3) > 0;
      file_uvs_.push_back({is_number ? static_cast<float>(uv[0]) : nan, static_cast<float>(uv[1])});
    } else if (key == "usemtl") {
      const auto number = static_cast<std::uint32_t>(materials_.size());
      material_ = materials_.try_emplace(std::string(trimmed(in_.rest())), number).first->second;
    } else if (key == "mtllib") {
      libraries_.insert(std::string(trimmed(in_.rest())));
    } else if (key == "l" || key == "p") {
      ++dropped_[std::string(key)];
    } else if (key == "vp" || key == "curv" || key == "curv2" || key == "surf" || key == "cstype") {
      ++dropped_["free-form geometry"];
    } else if (key.size() > 16 || !std::all_of(key.begin(), key.end(), [](char c) {
                 return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == '.';
               })) {
      in_.fail(shown(key) + " is no statement of an OBJ file");
    }
  }

  /// x y z [w] [r g b], or x y z r g b a
  void vertex() {
    double values[8];
    const int count = in_.all_numbers(values, 8);
    if (count < 3) in_.fail("a vertex needs three numbers");
    positions_.push_back({values[0], values[1], values[2]});
    if (count != 6 && count != 7) return;
    colors_.resize(positions_.size() - 1, Vec3f{1, 1, 1});
    const auto color = [&](int at) {
      return Vec3f{static_cast<float>(values[at]), static_cast<float>(values[at + 1]),
                   static_cast<float>(values[at + 2])};
    };
    colors_.push_back(color(3));
    if (count == 6) return;
    last_colors_.resize(positions_.size() - 1, Vec3f{1, 1, 1});
    last_colors_.push_back(color(4));
    all_weights_one_ &= values[3] == 1;
    if (!first_last_) first_last_ = values[6];
    same_last_ &= values[6] == *first_last_;
  }

  /// Of seven numbers the fourth is a weight where it is always 1, unless the last is always the same, too:
  /// then that is an opaque alpha, which programs do write.
  void choose_colors() {
    if (last_colors_.empty() || !all_weights_one_ || same_last_) return;
    last_colors_.resize(positions_.size(), Vec3f{1, 1, 1});
    colors_ = std::move(last_colors_);
  }

  /// Indices are checked against the number of elements when all are known: the largest is kept, and its
  /// line.
  struct Largest {
    std::int64_t index = kNone;
    const char* line = nullptr;
    void add(std::int64_t i, const char* at) {
      if (i <= index) return;
      index = i;
      line = at;
    }
  };

  void face() {
    corners_.clear();
    for (ObjCorner corner; in_.corner(corner);) {
      corners_.push_back({in_.index(corner.vertex, positions_.size()),
                          in_.index(corner.normal, file_normals_.size()), uv_index(corner.texture)});
      largest_vertex_.add(corners_.back().vertex, in_.place().at);
      largest_normal_.add(corners_.back().normal, in_.place().at);
    }
    if (corners_.size() < 3) {
      if (in_.is_cut()) in_.fail("the file is cut in its last face");
      ++short_faces_;
      return;
    }
    if (current_id_ == kNone)
      current_id_ = ids_.try_emplace({object_, group_}, static_cast<std::int32_t>(ids_.size())).first->second;
    for (std::size_t i = 2; i < corners_.size(); ++i) {
      triangles_.push_back(
          {narrow(corners_[0].vertex), narrow(corners_[i - 1].vertex), narrow(corners_[i].vertex)});
      object_ids_.push_back(static_cast<std::int32_t>(current_id_));
      if (material_ == kNoMaterial) continue;
      face_uvs_.resize(triangles_.size() - 1);
      face_uvs_.push_back({material_, {corners_[0].uv, corners_[i - 1].uv, corners_[i].uv}});
    }
    fans_.add(triangles_.size(), corners_.size() - 2);
    for (const Corner& corner : corners_)
      if (corner.normal != kNone) corner_normals_.push_back({narrow(corner.vertex), narrow(corner.normal)});
  }

  /// Of a corner's texture coordinate; UINT32_MAX where there is none. A wrong one costs the face its
  /// texture.
  std::uint32_t uv_index(std::int64_t value) const {
    const auto count = static_cast<std::int64_t>(file_uvs_.size());
    if (value > 0 && value < UINT32_MAX) return static_cast<std::uint32_t>(value - 1);
    return value < 0 && value >= -count ? static_cast<std::uint32_t>(count + value) : UINT32_MAX;
  }

  /// Too large is caught by finish().
  static std::uint32_t narrow(std::int64_t index) {
    return static_cast<std::uint32_t>(std::min<std::int64_t>(index, UINT32_MAX));
  }

  void check_largest(const Largest& largest, std::size_t count, const char* what) {
    if (largest.index < static_cast<std::int64_t>(std::min<std::size_t>(count, UINT32_MAX))) return;
    TextCursor place = in_.place();
    place.at = largest.line;
    place.fail(ObjGrammar::out_of_range(largest.index + 1, count, what));
  }

  void assign_normals(RawScan& scan) {
    const std::size_t count = positions_.size();
    if (triangles_.empty()) {
      if (file_normals_.size() == count) {
        scan.normals = std::move(file_normals_);
      } else if (!file_normals_.empty()) {
        scan.notes.push_back("the normals are not kept: their number is not that of the vertices");
      }
      return;
    }
    if (corner_normals_.empty()) return;
    scan.normals.resize(count);
    std::vector<std::uint32_t> normal_of(count, UINT32_MAX);
    std::vector<bool> several(count);
    for (const auto& [vertex, normal] : corner_normals_) {
      if (normal_of[vertex] == normal) continue;
      const Vec3f n = file_normals_[normal];
      if (normal_of[vertex] != UINT32_MAX && file_normals_[normal_of[vertex]] != n) several[vertex] = true;
      if (normal_of[vertex] == UINT32_MAX || several[vertex]) scan.normals[vertex] = scan.normals[vertex] + n;
      normal_of[vertex] = normal;
    }
    std::size_t averaged = 0;
    for (std::size_t i = 0; i < count; ++i)
      if (several[i]) {
        scan.normals[i] = normalized(scan.normals[i]);
        ++averaged;
      }
    if (averaged > 0)
      scan.notes.push_back(std::to_string(averaged) + " vertices have several normals, which were averaged");
  }

  /// Of each material: its texture, and how its map changes coordinates; kNone where it shows no image.
  struct Shown {
    std::uint32_t texture = FaceTexture::kNone;
    ObjMap map;
  };
  std::vector<Shown> find_textures(RawScan& scan) {
    std::map<std::string, ObjMap> maps;
    for (const std::string& library : libraries_)
      if (!load_obj_materials(in_.file(), library, maps))
        scan.notes.push_back("its materials are not there: " + shown(library, 80));
    std::vector<Shown> all(materials_.size());
    std::map<std::string, std::shared_ptr<const TextureImage>> images;
    for (const auto& [name, number] : materials_) {
      const auto map = maps.find(name);
      if (map == maps.end()) continue;
      auto& image = images[map->second.image];
      if (!image) {
        TextureImage named;
        named.name = map->second.image;
        image = std::make_shared<const TextureImage>(std::move(named));
      }
      all[number] = {static_cast<std::uint32_t>(scan.textures.size()), map->second};
      scan.textures.push_back({.image = image, .wrap_u = map->second.wrap, .wrap_v = map->second.wrap});
    }
    return all;
  }

  void assign_textures(RawScan& scan) {
    const std::vector<Shown> materials = find_textures(scan);
    if (scan.textures.empty()) {
      if (!file_uvs_.empty()) dropped_["vt"] = file_uvs_.size();
      if (!materials_.empty()) dropped_["usemtl"] = materials_.size();
      return;
    }
    face_uvs_.resize(triangles_.size());
    scan.face_textures.resize(triangles_.size());
    std::size_t without = 0;
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      const FaceUvs& face = face_uvs_[i];
      if (face.material == kNoMaterial || materials[face.material].texture == FaceTexture::kNone) continue;
      const auto& [texture, map] = materials[face.material];
      FaceTexture placed{.texture = texture};
      for (std::size_t c = 0; c < 3 && placed.texture != FaceTexture::kNone; ++c) {
        if (face.uvs[c] >= file_uvs_.size())
          placed = {};
        else
          for (std::size_t axis = 0; axis < 2; ++axis)
            placed.corners[c][axis] = static_cast<float>(
                static_cast<double>(file_uvs_[face.uvs[c]][axis]) * map.scale[axis] + map.offset[axis]);
      }
      without += placed.texture == FaceTexture::kNone;
      scan.face_textures[i] = placed;
    }
    if (without > 0)
      scan.notes.push_back(std::to_string(without) +
                           " faces of materials with an image have no texture coordinates");
  }

  RawScan finish() {
    check_largest(largest_vertex_, positions_.size(), "vertices");
    check_largest(largest_normal_, file_normals_.size(), "normals");
    RawScan scan;
    assign_textures(scan);
    add_notes(fans_.cut_again(positions_, triangles_, scan.face_textures), scan.notes);
    assign_normals(scan);
    choose_colors();
    if (!colors_.empty()) {
      colors_.resize(positions_.size(), Vec3f{1, 1, 1});
      scan.colors = colors_from_floats(colors_);
    }
    scan.positions = std::move(positions_);
    scan.triangles = std::move(triangles_);
    if (ids_.size() > 1) scan.object_ids = std::move(object_ids_);
    if (bad_normals_ > 0)
      scan.notes.push_back(std::to_string(bad_normals_) + " normals are no three numbers and were left out");
    if (short_faces_ > 0)
      scan.notes.push_back(std::to_string(short_faces_) +
                           " faces with fewer than three corners were left out");
    for (const auto& [key, count] : dropped_)
      scan.notes.push_back("'" + key + "' (" + std::to_string(count) + ") is not kept");
    return scan;
  }

  /// Indices from 0; the normal's may be kNone.
  struct Corner {
    std::int64_t vertex, normal;
    std::uint32_t uv;
  };
  static constexpr std::uint32_t kNoMaterial = UINT32_MAX;
  struct FaceUvs {
    std::uint32_t material = kNoMaterial;
    std::array<std::uint32_t, 3> uvs{};
  };

  ObjGrammar in_;
  std::vector<Vec3d> positions_;
  std::vector<Vec3f> colors_, last_colors_, file_normals_;
  bool all_weights_one_ = true, same_last_ = true;
  std::optional<double> first_last_;
  std::vector<std::array<float, 2>> file_uvs_;
  std::vector<Triangle> triangles_;
  std::vector<FaceUvs> face_uvs_;  ///< of the triangles so far, or fewer
  std::map<std::string, std::uint32_t> materials_;
  std::uint32_t material_ = kNoMaterial;
  std::set<std::string> libraries_;
  Fans fans_;
  std::vector<std::int32_t> object_ids_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> corner_normals_;  ///< vertex, normal
  std::vector<Corner> corners_;
  std::string object_, group_;
  std::map<std::pair<std::string, std::string>, std::int32_t> ids_;
  std::int64_t current_id_ = kNone;
  Largest largest_vertex_, largest_normal_;
  std::size_t short_faces_ = 0, bad_normals_ = 0;
  std::map<std::string, std::size_t> dropped_;
};

}  // namespace

bool is_obj(std::string_view bytes) {
  static const std::string kNoFile;
  TextCursor in(bytes.substr(0, 65536), kNoFile);
  std::string_view line;
  while (in.next_line(line)) {
    const std::string_view key = TextCursor(line, kNoFile).word();
    if (key.empty() || key[0] == '#') continue;
    for (const char* known : {"v", "vn", "vt", "f", "o", "g", "s", "mtllib", "usemtl"})
      if (key == known) return true;
    return false;
  }
  return false;
}

RawScan read_obj(std::string_view bytes, const std::string& file) { return ObjReader(bytes, file).read(); }

}  // namespace rbvh
