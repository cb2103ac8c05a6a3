#include "chunks/scan_pieces.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <span>

#include "chunks/obj_pieces.h"
#include "chunks/ply_pieces.h"
#include "io/input_file.h"
#include "io/las.h"
#include "io/obj.h"
#include "io/ply.h"
#include "io/ply_header.h"
#include "io/property_names.h"
#include "io/scan_io.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr std::size_t kBegin = 4096;
constexpr std::size_t kStlHeader = 84, kStlTriangle = 50, kPieceTriangles = 1 << 16;

bool is_binary_stl(std::string_view begin, std::uint64_t bytes) {
  std::uint32_t count = 0;
  if (begin.size() < kStlHeader) return false;
  std::memcpy(&count, begin.data() + 80, sizeof count);
  return bytes == kStlHeader + std::uint64_t{count} * kStlTriangle;
}

PiecesRead read_stl_in_pieces(const std::string& path, const VisitPiece& visit) {
  InputStream in(path);
  std::string bytes(kStlHeader, '\0');
  in.read(std::as_writable_bytes(std::span(bytes)));
  PiecesRead read{.notes = {}, .corners_apart = true};
  std::uint64_t attributes = 0, flat = 0;
  std::uint32_t vertices = 0;
  for (bool more = true; more;) {
    bytes.resize(kPieceTriangles * kStlTriangle);
    bytes.resize(in.read(std::as_writable_bytes(std::span(bytes))));
    more = bytes.size() == kPieceTriangles * kStlTriangle;
    ScanPiece all;
    RawScan& piece = all.scan;
    for (std::size_t at = 0; at + kStlTriangle <= bytes.size(); at += kStlTriangle) {
      float corners[9];
      std::memcpy(corners, bytes.data() + at + 12, sizeof corners);
      attributes += bytes[at + 48] != 0 || bytes[at + 49] != 0;
      const Vec3f a{corners[0], corners[1], corners[2]}, b{corners[3], corners[4], corners[5]},
          c{corners[6], corners[7], corners[8]};
      if (a == b || b == c || c == a) {
        ++flat;
        continue;
      }
      for (const Vec3f p : {a, b, c}) piece.positions.push_back(static_cast<Vec3d>(p));
      piece.triangles.push_back({vertices, vertices + 1, vertices + 2});
      vertices += 3;
    }
    visit(std::move(all));
  }
  if (flat > 0) read.notes.push_back(std::to_string(flat) + " triangles without area were left out");
  if (attributes > 0)
    read.notes.push_back("the attribute words of " + std::to_string(attributes) + " triangles are not kept");
  return read;
}

/// A format of which no reader works in pieces.
PiecesRead read_whole(const std::string& path, const MemoryBudget& memory, const VisitPiece& visit) {
  check_read_budget(memory, path, 6);
  RawScan scan = read_scan(path, {}, memory);
  PiecesRead read{.notes = std::move(scan.notes), .corners_apart = false};
  if (!scan.textures.empty())
    throw Error(ErrorKind::kInput, path, "has textures, which a build in chunks does not keep");
  for (std::string& fault : scan.texture_faults) read.notes.push_back(std::move(fault));
  if (!scan.viewpoints.empty())
    read.notes.emplace_back("where the scanner stood is not kept where a scan is read in pieces");
  visit({std::move(scan), {}});
  return read;
}

std::string read_begin(const std::string& path) {
  std::string begin(kBegin, '\0');
  InputStream in(path);
  begin.resize(in.read(std::as_writable_bytes(std::span(begin))));
  return begin;
}

/// Of those that are read in pieces.
enum class Kind { kLas, kStl, kPly, kObj, kOther };

Kind kind_of(const std::string& path) {
  std::error_code code;
  if (path == "-" || !std::filesystem::is_regular_file(path, code)) return Kind::kOther;
  const std::string begin = read_begin(path);
  const std::uint64_t bytes = std::filesystem::file_size(path);
  if (is_las(begin)) return is_compressed_las(begin) ? Kind::kOther : Kind::kLas;
  if (is_ply(begin)) return Kind::kPly;
  if (is_binary_stl(begin, bytes) && bytes / kStlTriangle * 3 < UINT32_MAX) return Kind::kStl;
  return lower(path).ends_with(".obj") && is_obj(begin) ? Kind::kObj : Kind::kOther;
}

}  // namespace

bool can_be_in_pieces(const std::string& path) {
  switch (kind_of(path)) {
    case Kind::kPly:
      return is_in_pieces(ply_header(path));
    case Kind::kObj:
      return read_begin(path).find("mtllib") == std::string::npos;
    default:
      return kind_of(path) != Kind::kOther;
  }
}

PiecesRead read_in_pieces(const std::string& path, const MemoryBudget& memory, const VisitPiece& visit) {
  switch (kind_of(path)) {
    case Kind::kLas:
      return {.notes = read_las_in_pieces(path, [&](RawScan&& scan) { visit({std::move(scan), {}}); })};
    case Kind::kStl:
      return read_stl_in_pieces(path, visit);
    case Kind::kObj:
      return read_obj_in_pieces(path, visit);
    case Kind::kPly:
      if (const ply::Header header = ply_header(path); is_in_pieces(header))
        return read_ply_in_pieces(path, header, visit);
      return read_whole(path, memory, visit);
    case Kind::kOther:
      return read_whole(path, memory, visit);
  }
  RBVH_CHECK(false);
}

}  // namespace rbvh
