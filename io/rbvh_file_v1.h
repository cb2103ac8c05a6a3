// NAME.rbvh of format 1.0 to 1.2: read, no longer written.
#pragma once

#include <flatbuffers/flatbuffers.h>

#include <cstddef>
#include <span>
#include <string>

#include "io/rbvh_file.h"

namespace rbvh {

/// As decode_hierarchy(), once the seal is checked. What its leaves of exact primitives have of normals and
/// colours lies in the atlas: give_vertices_attributes() fetches it from there.
Rbvh decode_hierarchy_v1(std::span<const std::byte> file, flatbuffers::Verifier& verifier,
                         const std::string& path, PairHeader& header);

/// Gives the vertices of primitives the normals and colours of the texels nearest to them.
void give_vertices_attributes(Rbvh& rbvh);

}  // namespace rbvh
