// Reading and writing scans: one file pair per format (ply, obj, stl, off, pcd, ptx, las, gltf, xyz), chosen
// by content, then by extension.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "io/xyz.h"
#include "pipeline/base/memory_budget.h"
#include "rbvh/io.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Reads any ingest format ("-": standard input), dropping nothing: polygons become triangles, edges
/// may be non-manifold, values may be NaN. Hostile input is expected. Throws Error(kInput) with the byte,
/// line or element for a file that is missing, cut, malformed, has indices out of range, or has no vertex at
/// all.
///
/// `columns` are those of text clouds; where they are given, Error(kUsage) for any other format.
/// Textures come with their images, as far as `memory` allows; see RawScan::texture_faults.
RawScan read_scan(const std::string& path, const TextColumns& columns = {}, const MemoryBudget& memory = {});

/// Throws Error(kUsage) for a name that is of another kind of file than write_scan() writes.
void check_scan_output(const std::string& path);

/// As a GLB where the name says so, else as a PLY. Returns what that does not keep, in words.
std::vector<std::string> write_scan(const std::string& path, const Scan& scan, bool overwrite);

/// Whether write_ply() to that path keeps textures: it is a file, beside which their images can lie.
bool holds_textures(const std::string& path);

/// Whether a file's name is that of a scan.
bool has_scan_extension(const std::string& path);

/// The same from bytes in memory; `path` gives the extension, the name in messages, and the folder of files
/// that belong to it. Textures are as their file names them: load_textures() (texture_files.h) is next.
RawScan parse_scan(std::string_view bytes, const std::string& path, const TextColumns& columns = {});

/// Appends `scan` to `all`; the triangles (points of a cloud) get the object ids after those of `all`.
/// Different shifts are made one; where only one of them has normals, colours or a property, the other gets
/// zeros, white or NaN. The whole has no viewpoint. Throws Error(kInput) when one is a mesh and the other a
/// cloud.
void merge_scan(RawScan& all, RawScan&& scan);

/// Reads and merges inputs, each within the memory that ingest() would take. `on_note` is given what an input
/// has that a scan cannot hold. Throws as read_scan() and merge_scan(), Error(kBudget).
RawScan read_scans(const std::vector<std::string>& paths, const MemoryBudget& memory,
                   const std::function<void(const std::string& path, const std::string& note)>& on_note = {},
                   const Progress& progress = {}, const TextColumns& columns = {});

}  // namespace rbvh
