#include "io/scan_io.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <limits>
#include <utility>

#include "io/convert_cloud.h"
#include "io/gltf.h"
#include "io/input_file.h"
#include "io/las.h"
#include "io/obj.h"
#include "io/off.h"
#include "io/pcd.h"
#include "io/ply.h"
#include "io/property_names.h"
#include "io/proxy_file.h"
#include "io/ptx.h"
#include "io/stl.h"
#include "io/text_cursor.h"
#include "io/texture_files.h"
#include "pipeline/base/error.h"
#include "pipeline/base/text.h"
#include "pipeline/scan/ingest.h"
#include "pipeline/scan/precision.h"
#include "pipeline/scan/splats.h"

namespace rbvh {
namespace {

using Reader = RawScan (*)(std::string_view bytes, const std::string& file);

/// Formats told by some of their first bytes that are not read, with what to do about it.
struct Foreign {
  std::string_view magic;
  const char* advice;
  std::size_t at = 0;
};
constexpr Foreign kForeign[] = {
    {"RBVH", "is an .rbvh pair, and a scan is wanted here; name the scan that it was built of", 4},
    {"\x1f\x8b", "is compressed by gzip; unpack it first"},
    {"BZh", "is compressed by bzip2; unpack it first"},
    {"\xfd"
     "7zXZ",
     "is compressed by xz; unpack it first"},
    {"\x28\xb5\x2f\xfd", "is compressed by zstd; unpack it first"},
    {"PK\x03\x04", "is a zip archive (or 3MF); unpack or convert it first"},
    {"Kaydara FBX", "is an FBX file, which is not supported; convert it to PLY"},
};

/// What rbvh-convert writes has greys for the intensity of points without colours.
RawScan read_e57(std::string_view bytes, const std::string& name) {
  const std::string lines = convert_cloud(bytes, "e57", name);
  if (lines.empty()) throw Error(ErrorKind::kInput, name, "has no points");
  RawScan scan = read_xyz(lines, name);
  if (!scan.colors.empty())
    scan.notes.emplace_back("intensity, where points have no colour, is read as grey");
  return scan;
}

RawScan read_laz(std::string_view bytes, const std::string& name) {
  return read_las(convert_cloud(bytes, "laz", name), name);
}

Reader reader_by_content(std::string_view bytes) {
  if (is_ply(bytes)) return read_ply;
  if (is_pcd(bytes)) return read_pcd;
  if (is_stl(bytes)) return read_stl;
  if (is_off(bytes)) return read_off;
  if (is_ptx(bytes)) return read_ptx;
  if (is_las(bytes)) return is_compressed_las(bytes) ? read_laz : read_las;
  if (bytes.starts_with("ASTM-E57")) return read_e57;
  if (is_gltf(bytes)) return read_gltf;
  return nullptr;
}

std::string lower_extension(const std::string& path) {
  return lower(std::filesystem::path(path).extension().string());
}

Reader reader_by_extension(const std::string& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return read_ply;
  if (extension == ".obj") return read_obj;
  if (extension == ".stl") return read_stl;
  if (extension == ".off") return read_off;
  if (extension == ".pcd") return read_pcd;
  if (extension == ".ptx") return read_ptx;
  if (extension == ".glb" || extension == ".gltf") return read_gltf;
  if (extension == ".las" || extension == ".laz") return read_las;
  if (extension == ".e57") return read_e57;
  for (const char* text : {".xyz", ".txt", ".csv", ".asc", ".pts", ".xyzn", ".xyzrgb", ".tsv", ".neu"})
    if (extension == text) return read_xyz;
  return nullptr;
}

/// Binds viewpoints that hold for the whole of a scan to the object ids the scan has now, moved by `base`.
void bind_viewpoints(RawScan& scan, std::int64_t lowest, std::int64_t largest, std::int64_t base,
                     Vec3d move) {
  for (Viewpoint& viewpoint : scan.viewpoints) {
    const Viewpoint whole;
    if (viewpoint.first_object == whole.first_object)
      viewpoint.first_object = static_cast<std::int32_t>(lowest);
    if (viewpoint.last_object == whole.last_object)
      viewpoint.last_object = static_cast<std::int32_t>(largest);
    viewpoint.first_object = static_cast<std::int32_t>(viewpoint.first_object + base);
    viewpoint.last_object = static_cast<std::int32_t>(viewpoint.last_object + base);
    viewpoint.position = viewpoint.position + move;
  }
}

std::int64_t lowest_id(const RawScan& scan) {
  return scan.object_ids.empty() ? 0 : *std::min_element(scan.object_ids.begin(), scan.object_ids.end());
}
std::int64_t largest_id(const RawScan& scan) {
  return scan.object_ids.empty() ? 0 : *std::max_element(scan.object_ids.begin(), scan.object_ids.end());
}

template <class T>
void append(std::vector<T>& all, std::vector<T>&& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// Appends an attribute that one side may lack: what is missing is filled in.
template <class T>
void append_filled(std::vector<T>& all, std::size_t count, std::vector<T>&& more, std::size_t more_count,
                   T fill) {
  if (all.empty() && more.empty()) return;
  all.resize(count, fill);
  more.resize(more_count, fill);
  append(all, std::move(more));
}

}  // namespace

bool has_scan_extension(const std::string& path) { return reader_by_extension(path) != nullptr; }

RawScan parse_scan(std::string_view bytes, const std::string& path, const TextColumns& columns) {
  const std::string name = input_name(path);
  for (const Foreign& foreign : kForeign)
    if (bytes.size() >= foreign.at && bytes.substr(foreign.at).starts_with(foreign.magic))
      throw Error(ErrorKind::kInput, name, foreign.advice);
  Reader reader = reader_by_content(bytes);
  if (!reader) {
    bytes = without_byte_order_mark(bytes, name);
    reader = reader_by_content(bytes);
  }
  if (!reader) reader = reader_by_extension(path);
  if (!reader && is_obj(bytes)) reader = read_obj;
  if (!reader && is_xyz(bytes)) reader = read_xyz;
  if (!reader)
    throw Error(ErrorKind::kInput, name,
                "is of no known format (neither its first bytes nor its extension say PLY, OBJ, STL, OFF, "
                "PCD, PTX, LAS, E57, glTF or XYZ)");
  if (!columns.empty() && reader != read_xyz)
    throw Error(ErrorKind::kUsage, name, "is no text cloud; columns can be named of those only");
  RawScan scan = reader == read_xyz ? read_xyz_columns(bytes, name, columns) : reader(bytes, name);
  if (scan.positions.empty()) throw Error(ErrorKind::kInput, name, "has no vertices");
  if (is_splats(scan)) splats_to_discs(scan, name);
  for (std::string& note : precision_notes(scan)) scan.notes.push_back(std::move(note));
  return scan;
}

RawScan read_scan(const std::string& path, const TextColumns& columns, const MemoryBudget& memory) {
  RawScan scan = parse_scan(read_input(path).view(), path, columns);
  load_textures(scan, path, memory);
  return scan;
}

void check_scan_output(const std::string& path) {
  const std::string extension = lower_extension(path);
  if (extension != ".ply" && extension != ".glb" && (has_scan_extension(path) || extension == ".rbvh"))
    throw Error(ErrorKind::kUsage, path, "scans are written as PLY or GLB; name the output .ply or .glb");
}

std::vector<std::string> write_scan(const std::string& path, const Scan& scan, bool overwrite) {
  std::vector<std::string> lost;
  if (lower_extension(path) != ".glb") {
    if (!scan.textures.empty() && !holds_textures(path))
      lost.push_back("its " + counted(scan.textures.size(), "texture") +
                     " cannot lie beside it and were left out");
    write_ply(path, scan, overwrite);
    return lost;
  }
  if (!scan.properties.empty())
    lost.push_back("a GLB does not keep " + counted(scan.properties.size(), "scalar") + " of the vertices");
  if (std::adjacent_find(scan.object_ids.begin(), scan.object_ids.end(), std::not_equal_to<>()) !=
      scan.object_ids.end())
    lost.emplace_back("a GLB does not keep which object a part belongs to");
  write_glb(path, scan, scan.is_cloud() ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0}, overwrite);
  return lost;
}

void merge_scan(RawScan& all, RawScan&& scan) {
  if (all.positions.empty()) {
    all = std::move(scan);
    return;
  }
  if (all.triangles.empty() != scan.triangles.empty())
    throw Error(ErrorKind::kInput, "", "a mesh and a cloud cannot be merged; ingest them one by one");
  if (all.units != scan.units) {
    const auto shown = [](const std::string& units) { return units.empty() ? "none" : units; };
    throw Error(ErrorKind::kInput, "",
                "the inputs state different units (" + shown(all.units) + ", " + shown(scan.units) +
                    "); ingest them one by one, and state those that are missing");
  }
  const std::size_t count = all.positions.size(), more = scan.positions.size();
  if (count + more >= std::numeric_limits<std::uint32_t>::max())
    throw Error(ErrorKind::kInput, "",
                "the inputs have more than 4294967294 vertices in all; merge fewer of them");

  const Vec3d move = scan.shift - all.shift;
  if (move != Vec3d{})
    for (Vec3d& p : scan.positions) p = p + move;
  append(all.positions, std::move(scan.positions));
  append_filled(all.normals, count, std::move(scan.normals), more, Vec3f{});
  append_filled(all.radii, count, std::move(scan.radii), more, 0.0f);
  append_filled(all.colors, count, std::move(scan.colors), more, Color8{255, 255, 255});
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  for (ScalarProperty& property : all.properties) {
    const auto same = std::find_if(scan.properties.begin(), scan.properties.end(),
                                   [&](const ScalarProperty& other) { return other.name == property.name; });
    if (same == scan.properties.end()) {
      property.values.resize(count + more, kUnknown);
    } else {
      append(property.values, std::move(same->values));
      scan.properties.erase(same);
    }
  }
  for (ScalarProperty& property : scan.properties) {
    std::vector<float> values(count, kUnknown);
    append(values, std::move(property.values));
    all.properties.push_back({std::move(property.name), std::move(values)});
  }

  const std::size_t elements = all.triangles.empty() ? count : all.triangles.size();
  const std::size_t more_elements = scan.triangles.empty() ? more : scan.triangles.size();
  const std::int64_t lowest = lowest_id(scan), largest = largest_id(scan);
  const std::int64_t base = largest_id(all) + 1 - std::min<std::int64_t>(lowest, 0);
  if (base + largest > std::numeric_limits<std::int32_t>::max())
    throw Error(ErrorKind::kInput, "", "the object ids of the inputs are too large to be merged");
  bind_viewpoints(all, lowest_id(all), largest_id(all), 0, {});
  bind_viewpoints(scan, lowest, largest, base, move);
  append(all.viewpoints, std::move(scan.viewpoints));
  all.object_ids.resize(elements, 0);
  scan.object_ids.resize(more_elements, 0);
  for (std::int32_t& id : scan.object_ids) id = static_cast<std::int32_t>(id + base);
  append(all.object_ids, std::move(scan.object_ids));

  for (FaceTexture& face : scan.face_textures)
    if (face.texture != FaceTexture::kNone) face.texture += static_cast<std::uint32_t>(all.textures.size());
  append(all.textures, std::move(scan.textures));
  append_filled(all.face_textures, all.triangles.size(), std::move(scan.face_textures), scan.triangles.size(),
                FaceTexture{});
  for (Triangle& triangle : scan.triangles)
    for (std::uint32_t& corner : triangle) corner += static_cast<std::uint32_t>(count);
  append(all.triangles, std::move(scan.triangles));
  append(all.texture_faults, std::move(scan.texture_faults));
  append(all.notes, std::move(scan.notes));
}

RawScan read_scans(const std::vector<std::string>& paths, const MemoryBudget& memory,
                   const std::function<void(const std::string& path, const std::string& note)>& on_note,
                   const Progress& progress, const TextColumns& columns) {
  RawScan all;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    report(progress, "read", static_cast<double>(i) / static_cast<double>(paths.size()));
    check_read_budget(memory, paths[i], 1);
    refuse_proxy(paths[i]);
    RawScan scan = read_scan(paths[i], columns, memory);
    for (const auto* notes : {&scan.notes, &scan.texture_faults})
      for (const std::string& note : *notes)
        if (on_note) on_note(paths[i], note);
    try {
      merge_scan(all, std::move(scan));
    } catch (const Error& error) {
      throw Error(error.kind(), paths[i], error.what(), error.remedy());
    }
    check_budget(memory, ingest_memory(all), paths[i], "cleaning it");
  }
  return all;
}

}  // namespace rbvh
