#include "io/ply.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>

#include "io/colors.h"
#include "io/file_set.h"
#include "io/ply_header.h"
#include "io/ply_source.h"
#include "io/property_names.h"
#include "io/text_cursor.h"
#include "io/texture_files.h"
#include "pipeline/scan/cut_polygons.h"

namespace rbvh {
namespace {

using ply::AsciiSource;
using ply::BinarySource;
using ply::Element;
using ply::Format;
using ply::Header;
using ply::Property;
using ply::Type;

std::int32_t to_int32(double value) {
  if (!(value > -2147483648.0)) return value <= -2147483648.0 ? std::numeric_limits<std::int32_t>::min() : 0;
  return value < 2147483647.0 ? static_cast<std::int32_t>(value) : std::numeric_limits<std::int32_t>::max();
}

/// Checks a count against the bytes left, so that no memory is reserved for values that cannot be there.
template <class Source>
void check_fits(Source& in, const Element& element) {
  std::uint64_t entry = 0;
  for (const Property& property : element.properties) entry += in.least_bytes(property);
  if (entry > 0 && element.count > in.available() / entry)
    in.fail_here("the header promises " + std::to_string(element.count) + " of element '" + element.name +
                 "', but there are bytes for " + std::to_string(in.available() / entry) +
                 " at most: the file is cut or its counts are wrong");
}

template <class Source>
void skip_property(Source& in, const Property& property) {
  std::uint64_t count = 1;
  if (property.is_list) {
    const std::int64_t length = in.integer(property.count_type);
    if (length < 0) in.fail("a list of negative length");
    count = static_cast<std::uint64_t>(length);
  }
  in.skip(property.type, count);
}

using Uv = std::array<float, 2>;

/// What vertices' texture coordinates are called, where the file names textures.
constexpr std::pair<std::string_view, std::string_view> kVertexUvs[] = {
    {"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texcoord_u", "texcoord_v"}};

/// Where one scalar vertex property goes: into an array of doubles, floats, bytes or ints with a stride.
struct Target {
  enum Kind { kSkip, kDouble, kFloat, kByte, kInt } kind = kSkip;
  char* to = nullptr;
  std::size_t stride = 0;
};

/// The property with one of these names, or -1.
int find_property(const Element& element, bool is_list, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names)
    for (std::size_t i = 0; i < element.properties.size(); ++i)
      if (element.properties[i].is_list == is_list && lower(element.properties[i].name) == name)
        return static_cast<int>(i);
  return -1;
}

/// The names of scalar properties; empty ones for lists.
std::vector<std::string> scalar_names(const Element& element) {
  std::vector<std::string> names;
  for (const Property& property : element.properties) names.push_back(property.is_list ? "" : property.name);
  return names;
}

/// Makes room for element.count vertices, with x, y and z among their properties, and aims each property at
/// it. Colours that are not bytes go to `wide_colors`.
std::vector<Target> aim_vertices(const Element& element, RawScan& scan, std::vector<Vec3f>& wide_colors,
                                 std::vector<Uv>* uvs) {
  const auto count = static_cast<std::size_t>(element.count);
  const auto& properties = element.properties;
  std::vector<Target> targets(properties.size());
  const auto aim = [&](int property, Target::Kind kind, void* to, std::size_t stride) {
    if (property >= 0) targets[static_cast<std::size_t>(property)] = {kind, static_cast<char*>(to), stride};
  };

  const std::vector<std::string> names = scalar_names(element);
  const auto aim_three = [&](const NameTriple& three, Target::Kind kind, auto& values, std::size_t size) {
    values.resize(count);
    for (std::size_t c = 0; c < 3; ++c)
      targets[three[c]] = {kind, reinterpret_cast<char*>(values.data()) + c * (size / 3), size};
  };

  aim_three(*find_position(names), Target::kDouble, scan.positions, sizeof(Vec3d));
  if (const auto normal = find_normal(names)) aim_three(*normal, Target::kFloat, scan.normals, sizeof(Vec3f));
  if (const int radius = find_property(element, false, {"radius"}); radius >= 0) {
    scan.radii.resize(count);
    aim(radius, Target::kFloat, scan.radii.data(), sizeof(float));
  }
  if (const int id = find_property(element, false, {"object_id"}); id >= 0) {
    scan.object_ids.resize(count);
    aim(id, Target::kInt, scan.object_ids.data(), sizeof(std::int32_t));
  }
  if (const auto rgb = find_color(names)) {
    bool bytes = true;
    for (const std::size_t channel : *rgb) bytes &= properties[channel].type == Type::kUint8;
    if (bytes) {
      aim_three(*rgb, Target::kByte, scan.colors, sizeof(Color8));
    } else {
      aim_three(*rgb, Target::kFloat, wide_colors, sizeof(Vec3f));
    }
  }
  for (const auto& [u_name, v_name] : kVertexUvs) {
    const int u = find_property(element, false, {u_name}), v = find_property(element, false, {v_name});
    if (uvs == nullptr || !uvs->empty() || u < 0 || v < 0) continue;
    uvs->resize(count);
    aim(u, Target::kFloat, uvs->data(), sizeof(Uv));
    aim(v, Target::kFloat, uvs->data()->data() + 1, sizeof(Uv));
  }
  std::size_t scalars = 0;
  for (std::size_t i = 0; i < properties.size(); ++i)
    scalars += targets[i].kind == Target::kSkip && !properties[i].is_list;
  scan.properties.reserve(scalars);
  for (std::size_t i = 0; i < properties.size(); ++i) {
    if (targets[i].kind != Target::kSkip) continue;
    if (properties[i].is_list) {
      scan.notes.push_back("the list property '" + properties[i].name + "' of the vertices is not kept");
      continue;
    }
    scan.properties.push_back({properties[i].name, std::vector<float>(count)});
    aim(static_cast<int>(i), Target::kFloat, scan.properties.back().values.data(), sizeof(float));
  }
  return targets;
}

template <class Source>
void read_vertices(Source& in, const Element& element, RawScan& scan, std::vector<Uv>* uvs) {
  if (!find_position(scalar_names(element))) in.fail_here("the vertices have no x, y and z");
  check_fits(in, element);
  std::vector<Vec3f> wide_colors;
  std::vector<Target> targets = aim_vertices(element, scan, wide_colors, uvs);
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index)
    for (std::size_t i = 0; i < targets.size(); ++i) {
      Target& target = targets[i];
      switch (target.kind) {
        case Target::kSkip:
          skip_property(in, element.properties[i]);
          continue;
        case Target::kDouble:
          *reinterpret_cast<double*>(target.to) = in.number(element.properties[i].type);
          break;
        case Target::kFloat:
          *reinterpret_cast<float*>(target.to) = static_cast<float>(in.number(element.properties[i].type));
          break;
        case Target::kByte:
          *reinterpret_cast<std::uint8_t*>(target.to) = to_color_byte(in.number(element.properties[i].type));
          break;
        case Target::kInt:
          *reinterpret_cast<std::int32_t*>(target.to) = to_int32(in.number(element.properties[i].type));
          break;
      }
      target.to += target.stride;
    }
  if (!wide_colors.empty()) scan.colors = colors_from_floats(wide_colors);
}

/// The vertex list of a face or strip element, or -1.
int find_index_list(const Element& element) {
  int found = -1;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    if (!property.is_list || !is_integer(property.type)) continue;
    if (lower(property.name) == "vertex_indices" || lower(property.name) == "vertex_index")
      return static_cast<int>(i);
    if (found < 0) found = static_cast<int>(i);
  }
  return found;
}

void note_dropped(const Element& element, std::initializer_list<int> kept, RawScan& scan) {
  for (int i = 0; i < static_cast<int>(element.properties.size()); ++i)
    if (std::find(kept.begin(), kept.end(), i) == kept.end())
      scan.notes.push_back("the property '" + element.properties[static_cast<std::size_t>(i)].name +
                           "' of element '" + element.name + "' is not kept");
}

/// Where faces lie in textures, as they are read.
struct FacePlaces {
  std::size_t textures = 0;       ///< that the file names
  std::vector<Uv> of_vertices{};  ///< used where faces have none of their own
  std::size_t wrong = 0;          ///< faces
  bool by_vertices = false;       ///< of_vertices are wanted, when all are known

  /// Of the triangles from `first` on, a polygon's fan. `coordinates`: two for each of its corners.
  void add(RawScan& scan, std::size_t first, std::int32_t texture, const std::vector<float>* coordinates) {
    const std::size_t count = scan.triangles.size() - first;
    scan.face_textures.resize(scan.triangles.size());
    if (count == 0 || texture < 0) return;  // -1: none
    const bool has_places = coordinates == nullptr || coordinates->size() == 2 * (count + 2);
    if (!has_places || static_cast<std::size_t>(texture) >= textures) {
      wrong += coordinates == nullptr || !coordinates->empty();
      return;
    }
    by_vertices |= coordinates == nullptr;
    const auto corner = [&](std::size_t i) { return Uv{(*coordinates)[2 * i], (*coordinates)[2 * i + 1]}; };
    for (std::size_t i = 0; i < count; ++i) {
      FaceTexture& face = scan.face_textures[first + i];
      face.texture = static_cast<std::uint32_t>(texture);
      if (coordinates != nullptr) face.corners = {corner(0), corner(i + 1), corner(i + 2)};
    }
  }

  /// When all of the file is read.
  void finish(RawScan& scan) const {
    if (wrong > 0)
      scan.notes.push_back(std::to_string(wrong) + " faces have no place in a texture that the file names");
    if (!by_vertices) return;
    if (of_vertices.empty()) {
      scan.face_textures.clear();
      scan.notes.push_back("it names textures, but has no texture coordinates");
      return;
    }
    for (std::size_t i = 0; i < scan.face_textures.size(); ++i)
      for (std::size_t c = 0; c < 3; ++c)
        scan.face_textures[i].corners[c] = of_vertices[scan.triangles[i][c]];
  }
};

/// Textures as the header names them. An image that rbvh wrote with the scan is told by its hash, since a
/// writer may be replacing it.
void name_textures(const Header& header, const std::string& file, RawScan& scan) {
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  for (const ply::TextureComment& comment : header.textures) {
    TextureImage image;
    image.name = comment.name;
    const bool is_own = comment.hash != 0 && comment.name.find_first_of("/\\") == std::string::npos;
    if (is_own) {
      const std::string path = (folder / comment.name).string();
      if (const auto part = find_part(std::span(&path, 1), comment.bytes, comment.hash))
        image.file = part->bytes.view();
      else if (find_beside(file, comment.name))
        scan.notes.push_back("the texture " + shown(comment.name, 80) +
                             " is not the one that was written with it");
    }
    scan.textures.push_back({.image = std::make_shared<const TextureImage>(std::move(image)),
                             .wrap_u = comment.wrap_u,
                             .wrap_v = comment.wrap_v,
                             .times_colors = comment.times_colors});
  }
}

/// Faces (as fans) and, with `strips`, triangle strips separated by -1.
template <class Source>
void read_faces(Source& in, const Element& element, std::uint64_t vertex_count, bool strips, RawScan& scan,
                Fans& fans, FacePlaces& places) {
  const int list = find_index_list(element);
  if (list < 0) {
    if (element.count > 0) in.fail_here("the faces have no list of vertex indices");
    return;
  }
  const int id_property = find_property(element, false, {"object_id"});
  const bool textured = places.textures > 0 && !strips;
  const int uv_list = textured ? find_property(element, true, {"texcoord"}) : -1;
  const int texture_property = textured ? find_property(element, false, {"texnumber"}) : -1;
  check_fits(in, element);
  note_dropped(element, {list, id_property, uv_list, texture_property}, scan);
  scan.triangles.reserve(scan.triangles.size() + static_cast<std::size_t>(element.count));

  const auto read_index = [&](Type type) {
    const std::int64_t index = in.integer(type);
    if (index < (strips ? -1 : 0) || index >= static_cast<std::int64_t>(vertex_count))
      in.fail("the vertex index " + std::to_string(index) + " is out of range (there are " +
              std::to_string(vertex_count) + " vertices)");
    return static_cast<std::uint32_t>(index);
  };
  std::uint64_t too_short = 0;
  const auto read_list = [&](const Property& property) {
    const std::int64_t length = in.integer(property.count_type);
    if (length < 0) in.fail("a list of negative length");
    too_short += length < 3;
    // The last three indices of a strip, or the first, the last and the newest of a fan.
    std::uint32_t a = 0, b = 0;
    std::int64_t run = 0;
    for (std::int64_t i = 0; i < length; ++i) {
      const std::uint32_t c = read_index(property.type);
      if (strips && c == UINT32_MAX) {
        run = 0;
        continue;
      }
      if (run >= 2) scan.triangles.push_back(strips && run % 2 == 1 ? Triangle{b, a, c} : Triangle{a, b, c});
      if (run == 0 || (strips && run >= 2)) a = run == 0 ? c : b;
      if (run > 0) b = c;
      ++run;
    }
  };
  std::vector<float> coordinates;
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index) {
    const std::size_t before = scan.triangles.size();
    std::int32_t id = 0, texture = 0;
    coordinates.clear();
    for (int i = 0; i < static_cast<int>(element.properties.size()); ++i) {
      const Property& property = element.properties[static_cast<std::size_t>(i)];
      if (i == list) {
        read_list(property);
        if (!strips) fans.add(scan.triangles.size(), scan.triangles.size() - before);
      } else if (i == id_property) {
        id = to_int32(in.number(property.type));
      } else if (i == texture_property) {
        texture = to_int32(in.number(property.type));
      } else if (i == uv_list) {
        const std::int64_t length = in.integer(property.count_type);
        if (length < 0) in.fail("a list of negative length");
        for (std::int64_t k = 0; k < length; ++k)
          coordinates.push_back(static_cast<float>(in.number(property.type)));
      } else {
        skip_property(in, property);
      }
    }
    if (textured) places.add(scan, before, texture, uv_list >= 0 ? &coordinates : nullptr);
    if (id_property >= 0) {
      scan.object_ids.resize(before);
      scan.object_ids.resize(scan.triangles.size(), id);
    }
  }
  if (too_short > 0)
    scan.notes.push_back(std::to_string(too_short) + " faces with fewer than three corners were left out");
}

/// PCL writes where the sensor stood as an element 'camera' with one entry.
template <class Source>
void read_camera(Source& in, const Element& element, RawScan& scan) {
  check_fits(in, element);
  int found = 0;
  Vec3d position;
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index)
    for (const Property& property : element.properties) {
      const std::string_view name = property.name;
      const int axis = name == "view_px" ? 0 : name == "view_py" ? 1 : name == "view_pz" ? 2 : -1;
      if (axis < 0 || property.is_list || in.place.index > 0) {
        skip_property(in, property);
      } else {
        position[axis] = in.number(property.type);
        ++found;
      }
    }
  if (found == 3 && is_finite(position))
    scan.viewpoints = {{.position = position, .is_default = position == Vec3d{}}};
}

template <class Source>
void skip_element(Source& in, const Element& element, RawScan& scan) {
  if (element.count == 0) return;
  scan.notes.push_back("the element '" + element.name + "' (" + std::to_string(element.count) +
                       ") is not kept");
  check_fits(in, element);
  if (element.properties.empty()) return;
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index)
    for (const Property& property : element.properties) skip_property(in, property);
}

template <class Source>
RawScan read_body(Source in, const Header& header, const std::string& file) {
  RawScan scan;
  scan.shift = header.shift;
  scan.units = header.units;
  std::uint64_t vertex_count = 0;
  bool has_vertices = false;
  for (const Element& element : header.elements) {
    if (lower(element.name) != "vertex") continue;
    if (has_vertices) throw Error(ErrorKind::kInput, file, "has two elements 'vertex'");
    has_vertices = true;
    vertex_count = element.count;
  }
  if (vertex_count == 0) throw Error(ErrorKind::kInput, file, "has no vertices");
  if (vertex_count >= UINT32_MAX)
    throw Error(ErrorKind::kInput, file,
                "claims " + std::to_string(vertex_count) + " vertices; 4294967294 is the limit");

  std::vector<std::int32_t> vertex_ids;
  FacePlaces places{.textures = header.textures.size()};
  Fans fans;
  for (const Element& element : header.elements) {
    in.place = {&element, 0};
    const std::string name = lower(element.name);
    if (name == "vertex") {
      std::vector<std::int32_t> face_ids = std::move(scan.object_ids);
      scan.object_ids.clear();
      read_vertices(in, element, scan, places.textures > 0 ? &places.of_vertices : nullptr);
      vertex_ids = std::exchange(scan.object_ids, std::move(face_ids));
    } else if (name == "face" || name == "tristrips") {
      read_faces(in, element, vertex_count, name == "tristrips", scan, fans, places);
    } else if (name == "camera") {
      read_camera(in, element, scan);
    } else {
      skip_element(in, element, scan);
    }
  }
  in.check_end(header.elements, scan.notes);
  places.finish(scan);
  if (!scan.face_textures.empty()) {
    scan.face_textures.resize(scan.triangles.size());
    name_textures(header, file, scan);
  }
  add_notes(fans.cut_again(scan.positions, scan.triangles, scan.face_textures), scan.notes);

  // Object ids and radii belong to the vertices of a cloud alone; on a mesh they are two properties among
  // others.
  if (scan.triangles.empty()) {
    scan.object_ids = std::move(vertex_ids);
    return scan;
  }
  if (!scan.object_ids.empty()) scan.object_ids.resize(scan.triangles.size());
  if (!vertex_ids.empty()) scan.properties.push_back({"object_id", {vertex_ids.begin(), vertex_ids.end()}});
  if (!scan.radii.empty()) scan.properties.push_back({"radius", std::exchange(scan.radii, {})});
  return scan;
}

}  // namespace

bool is_ply(std::string_view bytes) {
  return bytes.size() > 3 && bytes.substr(0, 3) == "ply" && is_space(bytes[3]);
}

RawScan read_ply(std::string_view bytes, const std::string& file) {
  const Header header = ply::parse_header(bytes, file);
  switch (header.format) {
    case Format::kAscii:
      return read_body(AsciiSource(without_end_mark(bytes), header.size, file), header, file);
    case Format::kLittleEndian:
      return read_body(BinarySource<false>(bytes, header.size, file), header, file);
    case Format::kBigEndian:
      return read_body(BinarySource<true>(bytes, header.size, file), header, file);
  }
  RBVH_CHECK(false);
}

}  // namespace rbvh
