// OBJ scans: vertices (with colours), normals, polygons as triangles, groups and objects (grammar:
// io/obj_grammar.h).
#pragma once

#include <string>
#include <string_view>

#include "pipeline/scan/scan.h"

namespace rbvh {

/// Its first statement is one of OBJ's.
bool is_obj(std::string_view bytes);

/// Each distinct pair of object and group that has faces is an object id, in order of first use. A vertex
/// with several normals gets their mean, which is noted. Without faces it is a cloud. Throws Error(kInput)
/// with the line.
RawScan read_obj(std::string_view bytes, const std::string& file);

}  // namespace rbvh
