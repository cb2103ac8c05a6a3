#include "chunks/big_ply.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "io/ply.h"
#include "io/property_names.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr std::size_t kPieceBytes = std::size_t{1} << 22, kMostHeader = std::size_t{1} << 20;

[[noreturn]] void fail_cut(const BigPly& ply, const std::string& element, const PlyBlock& block) {
  const std::uint64_t there = ply.bytes > block.at ? (ply.bytes - block.at) / block.bytes : 0;
  throw Error(ErrorKind::kInput, ply.path, FilePlace{"byte", ply.bytes},
              "the file is cut in " + element + " " + std::to_string(there) + " of " +
                  std::to_string(block.count) + "; copy it again");
}

/// Where its scalar properties lie, in their order; nothing where there is a list.
std::optional<std::vector<PlyField>> scalar_fields(const ply::Element& element, std::size_t& bytes) {
  std::vector<PlyField> fields;
  bytes = 0;
  for (const ply::Property& property : element.properties) {
    if (property.is_list) return std::nullopt;
    fields.push_back({property.type, bytes});
    bytes += ply::size_of(property.type);
  }
  return fields;
}

bool find_vertices(const ply::Element& element, BigPly& ply) {
  const std::optional<std::vector<PlyField>> fields = scalar_fields(element, ply.vertices.bytes);
  if (element.name != "vertex" || element.count == 0 || element.count >= 0xffffffffu || !fields) return false;
  std::vector<std::string> names;
  for (const ply::Property& property : element.properties) names.push_back(property.name);
  const auto position = find_position(names);
  if (!position) return false;
  for (std::size_t axis = 0; axis < 3; ++axis) ply.position[axis] = (*fields)[(*position)[axis]];
  ply.has_normals = find_normal(names).has_value();
  ply.has_radii = std::find(names.begin(), names.end(), "radius") != names.end();
  ply.vertices.count = element.count;
  return true;
}

bool find_faces(const ply::Element& element, BigPly& ply) {
  if (element.name != "face") return element.count == 0;
  bool has_list = false;
  for (const ply::Property& property : element.properties) {
    PlyBlock& block = ply.faces;
    if (!property.is_list) {
      if (property.name == "object_id") ply.object_id = PlyField{property.type, block.bytes};
      block.bytes += ply::size_of(property.type);
      continue;
    }
    if (has_list || !ply::is_integer(property.type)) return false;
    has_list = true;
    ply.length = {property.count_type, block.bytes};
    ply.corners = {property.type, block.bytes + ply::size_of(property.count_type)};
    block.bytes = ply.corners.at + 3 * ply::size_of(property.type);
  }
  ply.faces.count = element.count;
  return has_list || element.count == 0;
}

}  // namespace

std::optional<BigPly> open_big_ply(const std::string& path) {
  struct stat status {};
  if (path == "-" || ::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return std::nullopt;
  BigPly ply;
  ply.path = path;
  ply.file = {new int(fd), [](const int* file) {
                ::close(*file);
                delete file;
              }};
  ply.bytes = ply.source_bytes = static_cast<std::uint64_t>(status.st_size);
  std::string begin(static_cast<std::size_t>(std::min<std::uint64_t>(ply.bytes, kMostHeader)), '\0');
  read_at(ply, 0, std::as_writable_bytes(std::span(begin)));
  if (!is_ply(begin)) return std::nullopt;
  ply.header = ply::parse_header(begin, path);
  const std::vector<ply::Element>& elements = ply.header.elements;
  if (ply.header.format != ply::Format::kLittleEndian || !ply.header.textures.empty() || elements.empty() ||
      elements.size() > 2 || !find_vertices(elements[0], ply) ||
      (elements.size() == 2 && !find_faces(elements[1], ply)))
    return std::nullopt;
  ply.vertices.at = ply.header.size;
  ply.faces.at = ply.vertices.at + ply.vertices.count * ply.vertices.bytes;
  if (ply.bytes < ply.faces.at) fail_cut(ply, "vertex", ply.vertices);
  if (ply.faces.count > 0 && (ply.bytes - ply.faces.at) / ply.faces.bytes < ply.faces.count)
    fail_cut(ply, "face", ply.faces);
  return ply;
}

void read_at(const BigPly& ply, std::uint64_t byte, std::span<std::byte> to) {
  while (!to.empty()) {
    const ssize_t got = ::pread(*ply.file, to.data(), to.size(), static_cast<off_t>(byte));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0)
      throw Error(ErrorKind::kInput, ply.path, FilePlace{"byte", byte},
                  got == 0 ? "the file has become shorter while it was read"
                           : std::string("cannot be read: ") + std::strerror(errno));
    to = to.subspan(static_cast<std::size_t>(got));
    byte += static_cast<std::uint64_t>(got);
  }
}

double number_at(const std::byte* entry, const PlyField& field) {
  const std::byte* from = entry + field.at;
  const auto take = [from]<class T>(T value) {
    std::memcpy(&value, from, sizeof value);
    return static_cast<double>(value);
  };
  switch (field.type) {
    case ply::Type::kInt8:
      return take(std::int8_t{});
    case ply::Type::kUint8:
      return take(std::uint8_t{});
    case ply::Type::kInt16:
      return take(std::int16_t{});
    case ply::Type::kUint16:
      return take(std::uint16_t{});
    case ply::Type::kInt32:
      return take(std::int32_t{});
    case ply::Type::kUint32:
      return take(std::uint32_t{});
    case ply::Type::kFloat32:
      return take(float{});
    case ply::Type::kFloat64:
      return take(double{});
  }
  return 0;
}

void for_each_piece(const BigPly& ply, const PlyBlock& block, const VisitEntries& visit) {
  if (block.count == 0) return;
  const std::size_t most = std::max<std::size_t>(1, kPieceBytes / block.bytes);
  std::vector<std::byte> piece(most * block.bytes);
  for (std::uint64_t first = 0; first < block.count; first += most) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(most, block.count - first));
    const std::span<std::byte> entries = std::span(piece).first(count * block.bytes);
    read_at(ply, block.at + first * block.bytes, entries);
    visit(first, count, entries);
  }
}

Triangle triangle_at(const BigPly& ply, std::uint64_t number, const std::byte* entry) {
  const FilePlace place{"face", number};
  if (number_at(entry, ply.length) != 3)
    throw Error(ErrorKind::kInput, ply.path, place,
                "is no triangle, and a scan that is built in chunks has no others; ingest it first");
  Triangle triangle;
  for (std::size_t c = 0; c < 3; ++c) {
    const double index =
        number_at(entry, {ply.corners.type, ply.corners.at + c * ply::size_of(ply.corners.type)});
    if (!(index >= 0 && index < static_cast<double>(ply.vertices.count)))
      throw Error(ErrorKind::kInput, ply.path, place,
                  "the vertex index " + std::to_string(static_cast<std::int64_t>(index)) +
                      " is out of range (there are " + std::to_string(ply.vertices.count) + " vertices)");
    triangle[c] = static_cast<std::uint32_t>(index);
  }
  return triangle;
}

VertexCache::VertexCache(const BigPly& ply, const Vec3d& shift, std::uint64_t most_bytes)
    : ply_(ply),
      shift_(shift),
      most_(static_cast<std::size_t>(std::max<std::uint64_t>(16, most_bytes / (kBlock * sizeof(Vec3f))))),
      slots_(static_cast<std::size_t>((ply.vertices.count + kBlock - 1) / kBlock), kNone) {}

const Vec3f* VertexCache::load(std::uint32_t block) {
  std::size_t slot = blocks_.size();
  if (slot < most_) {
    blocks_.emplace_back(kBlock);
    block_of_.push_back(block);
    is_used_.push_back(0);
  } else {  // the first that was not used since the hand passed it
    while (std::exchange(is_used_[hand_], std::uint8_t{0}) != 0) hand_ = (hand_ + 1) % most_;
    slot = std::exchange(hand_, (hand_ + 1) % most_);
    slots_[block_of_[slot]] = kNone;
    block_of_[slot] = block;
  }
  const std::uint64_t first = std::uint64_t{block} * kBlock;
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, ply_.vertices.count - first));
  std::vector<std::byte> entries(count * ply_.vertices.bytes);
  read_at(ply_, ply_.vertices.at + first * ply_.vertices.bytes, entries);
  for (std::size_t i = 0; i < count; ++i)
    blocks_[slot][i] =
        static_cast<Vec3f>(position_at(entries.data() + i * ply_.vertices.bytes, ply_) - shift_);
  is_used_[slot] = 1;
  slots_[block] = static_cast<std::uint32_t>(slot);
  return blocks_[slot].data();
}

}  // namespace rbvh
