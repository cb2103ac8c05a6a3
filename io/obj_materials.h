// Material libraries of OBJ files: which material shows which image.
#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>

#include "rbvh/scan.h"

namespace rbvh {

/// The map_Kd of a material.
struct ObjMap {
  std::string image;
  TextureWrap wrap = TextureWrap::kRepeat;
  std::array<double, 2> scale{1, 1},
      offset{0, 0};  ///< of texture coordinates: times the scale, plus the offset
};

/// The materials with an image, by name. Hostile input is expected; what is not understood is passed over.
std::map<std::string, ObjMap> read_obj_materials(std::string_view bytes, const std::string& file);

/// Reads a library that lies beside `file`; false where it is not there. `name`: all of the statement
/// `mtllib`, which may be one name with blanks or several names.
bool load_obj_materials(const std::string& file, std::string_view name, std::map<std::string, ObjMap>& all);

}  // namespace rbvh
