// Files in and out. What is written is written whole or not at all: to a temporary name in the same folder,
// then renamed.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "rbvh/asset.h"
#include "rbvh/image.h"
#include "rbvh/scan.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// Reads a scan of any format (PLY, OBJ, STL, OFF, PCD, PTX, LAS, XYZ; "-": standard input), as it is:
/// nothing is cleaned, and a cloud gets the normals and radii that it lacks. Coordinates too large for float
/// are shifted; see Scan::shift. The file may be hostile. Throws Error(kInput), Error(kBudget).
Scan load_scan(const std::string& path, const MemoryBudget& memory = {}, const Progress& progress = {});

/// Binary little-endian PLY ("-": standard output). Images of textures go beside it, as NAME.texture0.png;
/// all files are replaced together. Where nothing can lie beside it (standard output, a pipe), textures are
/// left out. Throws Error(kFailure), also where a file is there and `overwrite` is not set.
void write_ply(const std::string& path, const Scan& scan, bool overwrite);

/// Binary glTF 2.0, for viewers: a mesh's triangles, or a cloud's points with their radii as `_RADIUS`; with
/// normals and colours (COLOR_0, linear). A scan whose `up` is +Z is turned by its node; any other is taken
/// for +Y up. The shift is `rbvh_shift` in asset.extras. Throws Error(kFailure), also for more than 4 GB.
void write_glb(const std::string& path, const Scan& scan, const Vec3d& up, bool overwrite);

/// A pair: NAME.rbvh, and NAME.atlas.tif beside it. Throws Error(kUsage) for another asset, Error(kFailure).
void save_pair(const std::string& path, const Asset& pair, bool overwrite);

/// By the name's extension. PNG: 8 bits a channel, straight alpha. JPEG: quality 92, no alpha: a light
/// background shows through. EXR: 32-bit float channels under the picture's own names, ZIP. "-": standard
/// output, EXR for data, else PNG. Throws Error(kFailure) where it cannot be written, Error(kUsage) for any
/// other extension and for data (Image::Kind::kData) in a format of 8 bits.
void write_image(const std::string& path, const Image& image, bool overwrite);

/// Gets a line on what went wrong when an output was there already, whole: its folder could not be synced to
/// disk, or the atlas of a pair lies beside its place. By default the line goes to stderr; an empty function
/// silences it.
void set_output_warning(std::function<void(std::string_view line)> sink);

/// What a file holds, as `rbvh info --json` prints it. Throws as load_asset().
std::string describe_json(const std::string& path, const LoadConfig& config = {});

}  // namespace rbvh
#pragma GCC visibility pop
