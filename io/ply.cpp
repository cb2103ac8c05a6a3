#include "io/ply.h"

#include <cstring>
#include <utility>

#include "io/colors.h"
#include "io/ply_header.h"
#include "io/ply_source.h"
#include "io/property_names.h"
#include "io/text_cursor.h"
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

/// Where one scalar vertex property goes: into an array of doubles, floats, bytes or ints with a stride.
struct Target {
  enum Kind { kSkip, kDouble, kFloat, kByte, kInt } kind = kSkip;
  char* to = nullptr;
  std::size_t stride = 0;
};

/// The scalar property with one of these names, or -1.
int find_scalar(const Element& element, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names)
    for (std::size_t i = 0; i < element.properties.size(); ++i)
      if (!element.properties[i].is_list && lower(element.properties[i].name) == name)
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
std::vector<Target> aim_vertices(const Element& element, RawScan& scan, std::vector<Vec3f>& wide_colors) {
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
  if (const int radius = find_scalar(element, {"radius"}); radius >= 0) {
    scan.radii.resize(count);
    aim(radius, Target::kFloat, scan.radii.data(), sizeof(float));
  }
  if (const int id = find_scalar(element, {"object_id"}); id >= 0) {
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
void read_vertices(Source& in, const Element& element, RawScan& scan) {
  if (!find_position(scalar_names(element))) in.fail_here("the vertices have no x, y and z");
  check_fits(in, element);
  std::vector<Vec3f> wide_colors;
  std::vector<Target> targets = aim_vertices(element, scan, wide_colors);
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

void note_dropped(const Element& element, int kept, int also_kept, RawScan& scan) {
  for (int i = 0; i < static_cast<int>(element.properties.size()); ++i)
    if (i != kept && i != also_kept)
      scan.notes.push_back("the property '" + element.properties[static_cast<std::size_t>(i)].name +
                           "' of element '" + element.name + "' is not kept");
}

/// Faces (as fans) and, with `strips`, triangle strips separated by -1.
template <class Source>
void read_faces(Source& in, const Element& element, std::uint64_t vertex_count, bool strips, RawScan& scan,
                Fans& fans) {
  const int list = find_index_list(element);
  if (list < 0) {
    if (element.count > 0) in.fail_here("the faces have no list of vertex indices");
    return;
  }
  int id_property = -1;
  for (std::size_t i = 0; i < element.properties.size(); ++i)
    if (lower(element.properties[i].name) == "object_id" && !element.properties[i].is_list)
      id_property = static_cast<int>(i);
  check_fits(in, element);
  note_dropped(element, list, id_property, scan);
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
  for (in.place.index = 0; in.place.index < element.count; ++in.place.index) {
    const std::size_t before = scan.triangles.size();
    std::int32_t id = 0;
    for (int i = 0; i < static_cast<int>(element.properties.size()); ++i) {
      const Property& property = element.properties[static_cast<std::size_t>(i)];
      if (i == list) {
        read_list(property);
        if (!strips) fans.add(scan.triangles.size(), scan.triangles.size() - before);
      } else if (i == id_property) {
        id = to_int32(in.number(property.type));
      } else {
        skip_property(in, property);
      }
    }
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
  Fans fans;
  for (const Element& element : header.elements) {
    in.place = {&element, 0};
    const std::string name = lower(element.name);
    if (name == "vertex") {
      std::vector<std::int32_t> face_ids = std::move(scan.object_ids);
      scan.object_ids.clear();
      read_vertices(in, element, scan);
      vertex_ids = std::exchange(scan.object_ids, std::move(face_ids));
    } else if (name == "face" || name == "tristrips") {
      read_faces(in, element, vertex_count, name == "tristrips", scan, fans);
    } else if (name == "camera") {
      read_camera(in, element, scan);
    } else {
      skip_element(in, element, scan);
    }
  }
  in.check_end(header.elements, scan.notes);
  fans.cut_again(scan.positions, scan.triangles, scan.notes);

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
