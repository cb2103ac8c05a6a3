#include "chunks/work_files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>

#include "io/output_file.h"

namespace rbvh {

BigPly open_work_vertices(const std::string& path, std::uint64_t count, const std::string& name) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) fail_output(path, "cannot be opened", errno);
  BigPly ply;
  ply.path = name;
  ply.file = {new int(fd), [](const int* file) {
                ::close(*file);
                delete file;
              }};
  ply.bytes = count * sizeof(WorkVertex);
  ply.vertices = {count, 0, sizeof(WorkVertex)};
  using ply::Type;
  ply.header.format = ply::Format::kLittleEndian;
  ply.header.elements = {{"vertex",
                          count,
                          {{"x", Type::kFloat64},
                           {"y", Type::kFloat64},
                           {"z", Type::kFloat64},
                           {"nx", Type::kFloat32},
                           {"ny", Type::kFloat32},
                           {"nz", Type::kFloat32},
                           {"radius", Type::kFloat32},
                           {"object_id", Type::kFloat32},
                           {"red", Type::kUint8},
                           {"green", Type::kUint8},
                           {"blue", Type::kUint8},
                           {"is_dropped", Type::kUint8}}}};
  for (std::size_t axis = 0; axis < 3; ++axis) ply.position[axis] = {Type::kFloat64, 8 * axis};
  ply.has_normals = ply.has_radii = true;
  return ply;
}

}  // namespace rbvh
