// The images of a scan's textures: found beside its file or inside of it, and decoded.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "rbvh/memory_budget.h"
#include "rbvh/scan.h"

namespace rbvh {

/// The regular file that `file` names: in its own folder or below. A name that leads elsewhere, as that of
/// another machine does, or to nothing is looked for in that folder by its last part. Standard input has
/// none.
std::optional<std::string> find_beside(const std::string& file, std::string_view name);

/// Of a scan as a reader left it: images without bytes are read from beside `file`, and all are decoded.
/// Those that are not there, broken, or over the budget are taken off their faces, as are places in textures
/// that are not finite; RawScan::texture_faults says so. Hostile input is expected.
void load_textures(RawScan& scan, const std::string& file, const MemoryBudget& memory);

/// The image's own file; of one that has none, a PNG of its texels.
std::string image_file(const TextureImage& image);

}  // namespace rbvh
