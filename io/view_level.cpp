#include "io/view_level.h"

#include <libdeflate.h>

#include <bit>
#include <limits>
#include <memory>
#include <new>
#include <utility>

#include "io/level_codec.h"
#include "pipeline/base/error.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/scan/vertex_normals.h"

namespace rbvh {
namespace {

constexpr int kDeflateLevel = 12;

ByteVector deflate(const ByteVector& raw) {
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
      libdeflate_alloc_compressor(kDeflateLevel), libdeflate_free_compressor);
  if (compressor == nullptr) throw std::bad_alloc();
  ByteVector packed(libdeflate_zlib_compress_bound(compressor.get(), raw.size()));
  packed.resize(
      libdeflate_zlib_compress(compressor.get(), raw.data(), raw.size(), packed.data(), packed.size()));
  return packed;
}

ByteVector inflate_stream(const ByteVector& packed) {
  ByteVector raw;
  RBVH_CHECK(packed.empty() || decompress(packed, std::numeric_limits<std::size_t>::max(), raw));
  return raw;
}

void add_floats(Columns& columns, const std::vector<float>& values) {
  std::vector<std::uint32_t> bits;
  bits.reserve(values.size());
  for (const float value : values) bits.push_back(std::bit_cast<std::uint32_t>(value));
  columns.add(bits);
}

void add_vectors(Columns& columns, const std::vector<Vec3f>& vectors) {
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    values.reserve(vectors.size());
    for (const Vec3f& v : vectors) values.push_back(v[axis]);
    add_floats(columns, values);
  }
}

class LevelPacker {
 public:
  LevelPacker(const Level& level, const std::string& path)
      : level_(level), firsts_(first_primitives(level)), streams_(encode_streams(level, path)) {}

  ViewLevel pack() {
    add_leaves();
    add_texels();
    if (!level_.primitives.positions.empty()) add_primitives();
    add_layers();
    ViewLevel packed;
    fill_meta(packed.meta);
    packed.block = deflate(raw_);
    return packed;
  }

 private:
  void add(const std::string& name, const ByteVector& bytes) {
    if (bytes.empty()) return;
    chunks_[name] = bytes.size();
    raw_.insert(raw_.end(), bytes.begin(), bytes.end());
  }

  bool is_tile(std::size_t leaf) const { return firsts_[leaf] == RBVH_NO_LEAF; }

  void add_leaves() {
    Columns held, tiles;
    std::vector<std::uint8_t> counts(level_.leaves.size());
    std::vector<std::uint16_t> sizes[2];
    std::vector<float> frames[12], boxes[6];
    std::vector<const RbvhNode*> nodes(level_.leaves.size());
    for (const RbvhNode& node : level_.nodes)
      if (node.count == 1) nodes[node.first] = &node;
    for (std::size_t i = 0; i < level_.leaves.size(); ++i) {
      const RbvhLeaf& leaf = level_.leaves[i];
      if (!is_tile(i)) {
        counts[i] = static_cast<std::uint8_t>(leaf.primitives);
        continue;
      }
      ++tiles_;
      texels_ += std::size_t{leaf.width} * leaf.height;
      sizes[0].push_back(leaf.width);
      sizes[1].push_back(leaf.height);
      for (std::size_t k = 0; k < 12; ++k) frames[k].push_back(leaf.to_tile[k]);
      for (std::size_t k = 0; k < 3; ++k) {
        boxes[k].push_back(nodes[i]->lo[k]);
        boxes[k + 3].push_back(nodes[i]->hi[k]);
      }
    }
    held.add(counts);
    for (const auto& column : sizes) tiles.add(column);
    for (const auto& column : frames) add_floats(tiles, column);
    for (const auto& column : boxes) add_floats(tiles, column);
    add("held", held.raw);
    add("tiles", tiles.raw);
  }

  /// A layer's codes leaf by leaf, each less what left, above and the corner between them say.
  std::vector<std::uint16_t> predicted(const Layer& layer, bool of_primitives, bool predict) const {
    const std::size_t row = atlas_size(level_, layer)[0] * std::size_t{layer.channels};
    std::vector<std::uint16_t> codes;
    for (std::size_t i = 0; i < level_.leaves.size(); ++i) {
      if (!of_primitives && !is_tile(i)) continue;
      const LayerTile tile = layer_tile(level_, layer, i);
      const std::size_t width = tile.width * std::size_t{layer.channels};
      for (std::size_t y = 0; y < tile.height; ++y) {
        const std::uint16_t* at =
            layer.texels.data() + (tile.y + y) * row + tile.x * std::size_t{layer.channels};
        for (std::size_t x = 0; x < width; ++x) {
          const bool has_left = x >= layer.channels;
          std::uint32_t code = at[x];
          if (predict && has_left) code -= at[x - layer.channels];
          if (predict && y > 0) code -= *(at + x - row);
          if (predict && has_left && y > 0) code += *(at + x - row - layer.channels);
          codes.push_back(static_cast<std::uint16_t>(code));
        }
      }
    }
    return codes;
  }

  void add_texels() {
    for (const auto& [name, chunk] : {std::pair{"height", "heights"}, std::pair{"normal", "normals"},
                                      std::pair{"color", "texelColors"}}) {
      const Layer* layer = find_layer(level_, name);
      if (layer == nullptr || tiles_ == 0) continue;
      Columns columns;
      columns.add(predicted(*layer, false, layer_kind(name) == LayerKind::kHeight));
      add(chunk, columns.raw);
    }
  }

  void add_primitives() {
    const Scan& scan = level_.primitives;
    const bool on_lattice = level_.lattice.step > 0;
    add("triangles", inflate_stream(streams_.triangles));
    Columns positions, normals, radii, colors;
    if (on_lattice) {
      positions.raw = inflate_stream(streams_.positions);
      normals.raw = inflate_stream(streams_.normals);
    } else {
      add_vectors(positions, scan.positions);
      add_vectors(normals, scan.normals.empty() ? vertex_normals(scan) : scan.normals);
    }
    add_floats(radii, scan.radii);
    for (std::size_t channel = 0; channel < 3 && !scan.colors.empty(); ++channel) {
      std::vector<std::uint8_t> differences;
      std::uint8_t before = 0;
      for (const Color8& color : scan.colors) {
        differences.push_back(static_cast<std::uint8_t>(color[channel] - before));
        before = color[channel];
      }
      colors.add(differences);
    }
    add("positions", positions.raw);
    add("vertexNormals", normals.raw);
    add("radii", radii.raw);
    add("vertexColors", colors.raw);
  }

  /// The user's. Of leaves without tiles their frames as well, over which these layers lie.
  void add_layers() {
    layers_ = nlohmann::ordered_json::array();
    for (const Layer& layer : level_.layers) {
      if (layer_kind(layer.name) != LayerKind::kUser) continue;
      Columns columns;
      std::vector<std::uint16_t> sizes[2];
      for (std::size_t i = 0; i < level_.leaves.size(); ++i) {
        const LayerTile tile = layer_tile(level_, layer, i);
        sizes[0].push_back(tile.width);
        sizes[1].push_back(tile.height);
      }
      for (const auto& column : sizes) columns.add(column);
      columns.add(predicted(layer, true, true));
      add("layer" + std::to_string(layers_.size()), columns.raw);
      layers_.push_back(
          {{"name", layer.name}, {"channels", layer.channels}, {"lo", layer.lo}, {"hi", layer.hi}});
    }
    if (layers_.empty()) return;
    Columns frames;
    std::vector<std::uint16_t> sizes[2];
    std::vector<float> rows[8];
    for (std::size_t i = 0; i < level_.leaves.size(); ++i) {
      if (is_tile(i)) continue;
      sizes[0].push_back(level_.leaves[i].width);
      sizes[1].push_back(level_.leaves[i].height);
      for (std::size_t k = 0; k < 8; ++k) rows[k].push_back(level_.leaves[i].to_tile[k]);
    }
    for (const auto& column : sizes) frames.add(column);
    for (const auto& column : rows) add_floats(frames, column);
    add("frames", frames.raw);
  }

  void fill_meta(nlohmann::ordered_json& meta) const {
    const Vec3f &lo = level_.bounds.lo, &hi = level_.bounds.hi, &origin = level_.lattice.origin;
    meta["name"] = level_.name;
    meta["error"] = level_.error;
    meta["reached"] = level_.reached;
    meta["leaves"] = level_.leaves.size();
    meta["tiles"] = tiles_;
    meta["texels"] = texels_;
    meta["vertices"] = level_.primitives.positions.size();
    meta["triangles"] = holds_discs(level_) ? 0 : level_.primitives.triangles.size();
    meta["discs"] = holds_discs(level_);
    meta["colors"] = find_layer(level_, "color") != nullptr;
    meta["normals"] = tiles_ > 0 && find_layer(level_, "normal") != nullptr;
    meta["lattice"] = {{"origin", {origin.x, origin.y, origin.z}}, {"step", level_.lattice.step}};
    meta["bounds"] = {{"lo", {lo.x, lo.y, lo.z}}, {"hi", {hi.x, hi.y, hi.z}}};
    meta["layers"] = layers_;
    meta["bytes"] = raw_.size();
    meta["crc"] = libdeflate_crc32(0, raw_.data(), raw_.size());
    meta["chunks"] = chunks_;
  }

  const Level& level_;
  std::vector<std::uint32_t> firsts_;
  LevelStreams streams_;
  std::size_t tiles_ = 0, texels_ = 0;
  ByteVector raw_;
  nlohmann::ordered_json chunks_ = nlohmann::ordered_json::object(), layers_;
};

}  // namespace

ViewLevel pack_view_level(const Level& level, const std::string& path) {
  return LevelPacker(level, path).pack();
}

}  // namespace rbvh
