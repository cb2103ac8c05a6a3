#include "chunks/ply_pieces.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "chunks/line_blocks.h"
#include "io/ply.h"
#include "io/ply_header.h"
#include "io/ply_source.h"
#include "io/property_names.h"

namespace rbvh {
namespace {

constexpr std::size_t kMostHeader = std::size_t{1} << 20, kBlock = std::size_t{1} << 22;
/// No entry of a face takes more bytes, and no vertex.
constexpr std::size_t kMostEntry = std::size_t{1} << 20;

/// Of a file of some of the vertices.
std::string header_of(const ply::Header& header, std::uint64_t count) {
  constexpr const char* formats[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  std::string text = "ply\nformat " + std::string(formats[static_cast<int>(header.format)]) +
                     " 1.0\nelement vertex " + std::to_string(count) + "\n";
  for (const ply::Property& property : header.elements[0].properties)
    text += std::string("property ") + ply::name_of(property.type) + " " + property.name + "\n";
  return text + "end_header\n";
}

/// `too_short`: counts faces with fewer than three corners.
template <class Source>
void read_face(Source& in, const ply::Header& header, ScanPiece& all, std::uint64_t& too_short) {
  RawScan& piece = all.scan;
  const auto vertices = static_cast<std::int64_t>(header.elements[0].count);
  const std::size_t before = piece.triangles.size();
  std::int32_t id = 0;
  bool has_id = false;
  for (const ply::Property& property : header.elements[1].properties) {
    if (!property.is_list) {
      has_id |= property.name == "object_id";
      if (property.name == "object_id")
        id = static_cast<std::int32_t>(std::clamp(in.number(property.type), -2147483648.0, 2147483647.0));
      else
        in.skip(property.type, 1);
      continue;
    }
    const std::int64_t length = in.integer(property.count_type);
    if (length < 0) in.fail("a list of negative length");
    too_short += length < 3;
    std::uint32_t first = 0, last = 0;
    for (std::int64_t i = 0; i < length; ++i) {
      const std::int64_t index = in.integer(property.type);
      if (index < 0 || index >= vertices)
        in.fail("the vertex index " + std::to_string(index) + " is out of range (there are " +
                std::to_string(vertices) + " vertices)");
      const auto corner = static_cast<std::uint32_t>(index);
      if (i == 0) first = corner;
      if (i >= 2) {
        piece.triangles.push_back({first, last, corner});
        all.fans.push_back(static_cast<std::uint32_t>(std::min<std::int64_t>(length - i, UINT32_MAX)));
      }
      last = corner;
    }
  }
  if (has_id) {
    piece.object_ids.resize(before);
    piece.object_ids.resize(piece.triangles.size(), id);
  }
}

/// Sets what holds for the file in a piece of it.
ScanPiece with_header(ScanPiece&& piece, const ply::Header& header) {
  piece.scan.shift = header.shift;
  piece.scan.units = header.units;
  return std::move(piece);
}

/// The lines of a text file, as many of them as an element has entries, empty ones left out.
class EntryLines {
 public:
  explicit EntryLines(const std::string& path) : blocks_(path) {}

  void skip_bytes(std::size_t bytes) {
    std::string_view lines;
    blocks_.next(lines);
    skipped_ = static_cast<std::uint64_t>(
        std::count(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(bytes), '\n'));
    left_ = lines.substr(bytes);
  }
  /// Up to `most` lines; how many there were. `first_line`: how many are before them in the file.
  std::uint64_t take(std::uint64_t most, std::string_view& lines, std::uint64_t& first_line) {
    if (left_.empty() && blocks_.next(left_)) skipped_ = 0;
    first_line = blocks_.lines_before() + skipped_;
    std::uint64_t count = 0, all = 0;
    std::size_t at = 0;
    while (at < left_.size() && count < most) {
      const std::size_t end = std::min(left_.find('\n', at), left_.size() - 1) + 1;
      count += !trimmed(left_.substr(at, end - at)).empty();
      at = end;
      ++all;
    }
    lines = left_.substr(0, at);
    left_ = left_.substr(at);
    skipped_ += all;
    return count;
  }
  bool is_at_end() { return trimmed(left_).empty() && !blocks_.next(left_); }

 private:
  LineBlocks blocks_;
  std::string_view left_;
  std::uint64_t skipped_ = 0;  ///< lines of the block
};

[[noreturn]] void fail_cut(const std::string& path, const ply::Element& element, std::uint64_t entry) {
  throw Error(ErrorKind::kInput, path,
              "the file is cut in " + element.name + " " + std::to_string(entry) + " of " +
                  std::to_string(element.count) + "; copy it again");
}

void read_text(const std::string& path, const ply::Header& header, const VisitPiece& visit,
               std::uint64_t& too_short) {
  EntryLines entries(path);
  entries.skip_bytes(header.size);
  std::string_view lines;
  std::uint64_t first_line = 0;
  for (const ply::Element& element : header.elements)
    for (std::uint64_t done = 0; done < element.count;) {
      const std::uint64_t count = entries.take(element.count - done, lines, first_line);
      if (count == 0) {
        if (entries.is_at_end()) fail_cut(path, element, done);
        continue;
      }
      if (&element == &header.elements[0]) {
        const std::string begin = header_of(header, count);
        const auto own = static_cast<std::uint64_t>(std::count(begin.begin(), begin.end(), '\n'));
        visit(with_header(
            {from_line(first_line - own, [&] { return read_ply(begin + std::string(lines), path); }), {}},
            header));
      } else {
        ScanPiece piece;
        from_line(first_line, [&] {
          ply::AsciiSource in(lines, 0, path);
          for (std::uint64_t i = 0; i < count; ++i) {
            in.place = {&element, done + i};
            read_face(in, header, piece, too_short);
          }
          in.check_end({}, piece.scan.notes);
        });
        visit(with_header(std::move(piece), header));
      }
      done += count;
    }
}

/// A window on the bytes of a file, which moves on.
struct Window {
  InputStream in;
  std::string bytes;
  bool is_at_end = false;

  explicit Window(const std::string& path) : in(path) {}
  /// Leaves the first ones behind, and reads on.
  void move(std::size_t used) {
    bytes.erase(0, used);
    const std::size_t had = bytes.size();
    bytes.resize(had + kBlock);
    const std::size_t got = in.read(std::as_writable_bytes(std::span(bytes).subspan(had)));
    bytes.resize(had + got);
    is_at_end = got < kBlock;
  }
};

template <class Source>
void read_bytes(const std::string& path, const ply::Header& header, const VisitPiece& visit,
                std::uint64_t& too_short) {
  Window window(path);
  window.move(0);
  std::size_t used = header.size, entry = 0;
  for (const ply::Property& property : header.elements[0].properties) entry += ply::size_of(property.type);
  const ply::Element& vertices = header.elements[0];
  for (std::uint64_t done = 0; done < vertices.count;) {
    window.move(std::exchange(used, 0));
    const std::uint64_t count =
        std::min<std::uint64_t>(vertices.count - done, window.bytes.size() / std::max<std::size_t>(1, entry));
    if (count == 0) fail_cut(path, vertices, done);
    used = static_cast<std::size_t>(count) * entry;
    visit(with_header({read_ply(header_of(header, count) + window.bytes.substr(0, used), path), {}}, header));
    done += count;
  }
  if (header.elements.size() < 2) return;
  const ply::Element& faces = header.elements[1];
  for (std::uint64_t done = 0; done < faces.count;) {
    window.move(std::exchange(used, 0));
    Source in(window.bytes, 0, path);
    ScanPiece piece;
    for (; done < faces.count && (window.is_at_end || in.available() >= kMostEntry); ++done) {
      in.place = {&faces, done};
      read_face(in, header, piece, too_short);
    }
    used = window.bytes.size() - static_cast<std::size_t>(in.available());
    visit(with_header(std::move(piece), header));
  }
}

}  // namespace

ply::Header ply_header(const std::string& path) {
  InputStream in(path);
  std::string begin(kMostHeader, '\0');
  begin.resize(in.read(std::as_writable_bytes(std::span(begin))));
  return ply::parse_header(begin, path);
}

bool is_in_pieces(const ply::Header& header) {
  if (!header.textures.empty()) return false;
  const std::vector<ply::Element>& elements = header.elements;
  if (elements.empty() || elements.size() > 2 || lower(elements[0].name) != "vertex" ||
      elements[0].count == 0 || elements[0].count >= UINT32_MAX)
    return false;
  std::vector<std::string> names;
  for (const ply::Property& property : elements[0].properties) {
    if (property.is_list || property.name == "f_dc_0") return false;  // of Gaussian splats
    names.push_back(property.name);
  }
  if (!find_position(names)) return false;
  if (const auto color = find_color(names))  // what numbers mean that are no bytes, the largest of them tells
    for (const std::size_t channel : *color)
      if (elements[0].properties[channel].type != ply::Type::kUint8) return false;
  if (elements.size() == 1) return true;
  const std::vector<ply::Property>& of_faces = elements[1].properties;
  return lower(elements[1].name) == "face" &&
         std::count_if(of_faces.begin(), of_faces.end(), [](const ply::Property& p) { return p.is_list; }) ==
             1 &&
         std::all_of(of_faces.begin(), of_faces.end(), [](const ply::Property& p) {
           return !p.is_list || (is_integer(p.type) && is_integer(p.count_type));
         });
}

PiecesRead read_ply_in_pieces(const std::string& path, const ply::Header& header, const VisitPiece& visit) {
  std::uint64_t too_short = 0;
  switch (header.format) {
    case ply::Format::kAscii:
      read_text(path, header, visit, too_short);
      break;
    case ply::Format::kLittleEndian:
      read_bytes<ply::BinarySource<false>>(path, header, visit, too_short);
      break;
    case ply::Format::kBigEndian:
      read_bytes<ply::BinarySource<true>>(path, header, visit, too_short);
      break;
  }
  PiecesRead read;
  if (too_short > 0)
    read.notes.push_back(std::to_string(too_short) + " faces with fewer than three corners were left out");
  return read;
}

}  // namespace rbvh
