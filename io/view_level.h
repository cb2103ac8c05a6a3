// A level as a page's script decodes it (web/src/level.ts): chunks of columns, deflated together. Positions,
// triangles and normals of primitives are as the pair's own streams have them.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "io/stream_codec.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

struct ViewLevel {
  nlohmann::ordered_json meta;  ///< LevelMeta of web/src/page.ts
  ByteVector block;             ///< zlib
};

/// Throws Error(kFailure), naming `path`, as encode_streams() does.
ViewLevel pack_view_level(const Level& level, const std::string& path);

}  // namespace rbvh
