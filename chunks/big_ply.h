// A PLY file that is larger than memory: where its vertices and triangles lie, and passes over them in
// pieces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/ply_header.h"
#include "rbvh/geometry.h"
#include "rbvh/scan.h"

namespace rbvh {

/// A scalar in each entry of an element.
struct PlyField {
  ply::Type type = ply::Type::kFloat32;
  std::size_t at = 0;  ///< bytes from the entry's begin
};

/// The entries of an element, all of one size.
struct PlyBlock {
  std::uint64_t count = 0, at = 0;  ///< `at`: byte in the file
  std::size_t bytes = 0;            ///< of an entry
};

/// A binary little-endian PLY: vertices of scalars, then triangles (faces of three corners) or nothing.
struct BigPly {
  std::string path;
  std::shared_ptr<const int> file;  ///< its descriptor
  std::uint64_t bytes = 0;
  std::uint64_t source_bytes = 0;            ///< of the files that it was gathered from, else the same
  std::optional<std::uint64_t> source_hash;  ///< of these
  ply::Header header;
  PlyBlock vertices, faces;  ///< no faces: a cloud
  PlyField position[3];
  bool has_normals = false, has_radii = false;
  bool corners_apart = false;  ///< of a mesh: no triangles share vertices, which lie at one place instead
  PlyField length, corners;    ///< of a face: its number of corners, and the first of these
  std::optional<PlyField> object_id;  ///< of a face

  bool is_cloud() const { return faces.count == 0; }
  std::uint64_t primitives() const { return is_cloud() ? vertices.count : faces.count; }
};

/// Nothing where the file is another format, another kind of PLY, textured, or no regular file. Throws
/// Error(kInput) where it is cut.
std::optional<BigPly> open_big_ply(const std::string& path);

/// Fills `to` from a byte on. Throws Error(kInput), also where the file has become shorter.
void read_at(const BigPly& ply, std::uint64_t byte, std::span<std::byte> to);

double number_at(const std::byte* entry, const PlyField& field);
inline Vec3d position_at(const std::byte* entry, const BigPly& ply) {
  return {number_at(entry, ply.position[0]), number_at(entry, ply.position[1]),
          number_at(entry, ply.position[2])};
}

/// Entries first .. first + count - 1 at once, as their bytes.
using VisitEntries =
    std::function<void(std::uint64_t first, std::size_t count, std::span<const std::byte> entries)>;
void for_each_piece(const BigPly& ply, const PlyBlock& block, const VisitEntries& visit);

/// Throws Error(kInput) for a face that is no triangle, and for a corner that is no vertex.
Triangle triangle_at(const BigPly& ply, std::uint64_t number, const std::byte* entry);

/// Positions of any vertices, less a shift and narrowed to float, in bounded memory: blocks of the file stay
/// by use.
class VertexCache {
 public:
  VertexCache(const BigPly& ply, const Vec3d& shift, std::uint64_t most_bytes);
  Vec3f at(std::uint32_t vertex) {
    const std::uint32_t block = vertex / kBlock;
    const std::uint32_t slot = slots_[block];
    return slot != kNone ? (is_used_[slot] = 1, blocks_[slot][vertex % kBlock])
                         : load(block)[vertex % kBlock];
  }

 private:
  static constexpr std::uint32_t kBlock = 4096, kNone = 0xffffffffu;
  const Vec3f* load(std::uint32_t block);

  const BigPly& ply_;
  Vec3d shift_;
  std::size_t most_;                  ///< blocks at once
  std::vector<std::uint32_t> slots_;  ///< of each block of the file
  std::vector<std::vector<Vec3f>> blocks_;
  std::vector<std::uint32_t> block_of_;
  std::vector<std::uint8_t> is_used_;  ///< since the hand passed it
  std::size_t hand_ = 0;
};

}  // namespace rbvh
