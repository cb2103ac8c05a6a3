#include "chunks/obj_pieces.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "chunks/line_blocks.h"
#include "io/obj_grammar.h"

namespace rbvh {
namespace {

class ObjPieces {
 public:
  explicit ObjPieces(const std::string& file) : file_(file) {}

  ScanPiece read(std::string_view lines) {
    ScanPiece piece;
    ObjGrammar in(lines, file_);
    while (in.next())
      if (!in.is_comment()) statement(in, piece);
    return piece;
  }

  PiecesRead finish() const {
    PiecesRead read;
    const auto add = [&](std::uint64_t count, const char* what) {
      if (count > 0) read.notes.push_back(std::to_string(count) + what);
    };
    add(short_faces_, " faces with fewer than three corners were left out");
    add(colors_, " vertices' colours are not kept where a scan is read in pieces");
    for (const auto& [key, count] : dropped_)
      read.notes.push_back("'" + key + "' (" + std::to_string(count) + ") is not kept");
    return read;
  }

 private:
  void statement(ObjGrammar& in, ScanPiece& piece) {
    const std::string_view key = in.key();
    if (key == "v") {
      double values[8];
      const int count = in.all_numbers(values, 8);
      if (count < 3) in.fail("a vertex needs three numbers");
      piece.scan.positions.push_back({values[0], values[1], values[2]});
      ++vertices_;
      colors_ += count >= 6;
    } else if (key == "f" || key == "fo") {
      face(in, piece);
    } else if (key == "o" || key == "g") {
      (key == "o" ? object_ : group_) = std::string(in.rest());
      id_.reset();
    } else if (!std::all_of(key.begin(), key.end(), [](char c) { return c > ' ' && c <= '~'; })) {
      in.fail(shown(key) + " is no statement of an OBJ file");
    } else if (key != "s") {
      ++dropped_[std::string(key.substr(0, 16))];
    }
  }

  void face(ObjGrammar& in, ScanPiece& piece) {
    std::vector<std::uint32_t> corners;
    for (ObjCorner corner; in.corner(corner);) {
      const std::int64_t vertex = in.index(corner.vertex, static_cast<std::size_t>(vertices_));
      corners.push_back(static_cast<std::uint32_t>(
          std::min<std::int64_t>(vertex, std::numeric_limits<std::uint32_t>::max())));
    }
    if (corners.size() < 3) {
      ++short_faces_;
      return;
    }
    if (!id_) id_ = ids_.try_emplace({object_, group_}, static_cast<std::int32_t>(ids_.size())).first->second;
    for (std::size_t i = 2; i < corners.size(); ++i) {
      piece.scan.triangles.push_back({corners[0], corners[i - 1], corners[i]});
      piece.scan.object_ids.push_back(*id_);
      piece.fans.push_back(static_cast<std::uint32_t>(corners.size() - i));
    }
  }

  const std::string& file_;
  std::uint64_t vertices_ = 0, short_faces_ = 0, colors_ = 0;
  std::string object_, group_;
  std::optional<std::int32_t> id_;
  std::map<std::pair<std::string, std::string>, std::int32_t> ids_;
  std::map<std::string, std::uint64_t> dropped_;
};

}  // namespace

PiecesRead read_obj_in_pieces(const std::string& path, const VisitPiece& visit) {
  LineBlocks blocks(path);
  ObjPieces pieces(path);
  for (std::string_view lines; blocks.next(lines);)
    visit(from_line(blocks.lines_before(), [&] { return pieces.read(lines); }));
  return pieces.finish();
}

}  // namespace rbvh
