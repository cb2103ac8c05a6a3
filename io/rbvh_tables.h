// From the tables of NAME.rbvh to plain structs: what all major versions of the schema have.
#pragma once

#include <bit>
#include <cstring>

#include <flatbuffers/flatbuffers.h>

#include "io/rbvh_file.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

template <class Array>
Vec3f to_vec3f(const Array& from) {
  return {from.Get(0), from.Get(1), from.Get(2)};
}

template <class FileBounds>
Bounds3f to_bounds(const FileBounds& b) {
  return {to_vec3f(*b.lo()), to_vec3f(*b.hi())};
}

template <class To, class From>
std::vector<To> to_structs(const flatbuffers::Vector<const From*>* from) {
  static_assert(sizeof(To) == sizeof(From));
  std::vector<To> to(from != nullptr ? from->size() : 0);
  if (!to.empty()) std::memcpy(to.data(), from->Data(), to.size() * sizeof(To));
  return to;
}

/// All but the levels.
template <class FilePair>
void take_pair(const FilePair& pair, Rbvh& rbvh, PairHeader& header) {
  const auto& source = *pair.source();
  rbvh.source = {source.name()->str(),  source.hash(),
                 source.vertices(),     source.triangles(),
                 source.area(),         {source.shift()->x(), source.shift()->y(), source.shift()->z()},
                 source.units()->str(), to_bounds(*source.bounds())};
  rbvh.build_options = pair.build_options()->str();
  header.atlas_bytes = pair.atlas()->length();
  header.atlas_hash = pair.atlas()->hash();
}

/// All but the hierarchy, the leaves and what they hold.
template <class FileLevel>
void take_level(const FileLevel& from, Level& level) {
  level.name = from.name()->str();
  level.rho = from.rho();
  level.alpha = from.alpha();
  level.phi_degrees = from.phi_degrees();
  level.bounds = to_bounds(*from.bounds());
  level.atlas_width = from.atlas_width();
  level.atlas_height = from.atlas_height();
  for (const auto* layer : *from.layers())
    level.layers.push_back({layer->name()->str(),
                            layer->channels(),
                            {},
                            layer->lo(),
                            layer->hi(),
                            layer->width(),
                            layer->height(),
                            to_structs<LayerTile>(layer->tiles())});
  level.texels_used = from.texels_used();
  if (const auto* f = from.fidelity())
    level.fidelity = {
        f->mask_mismatch_percent(), f->median_dt(), f->p99_dt(), f->holes(), f->leaks(), f->walls(), true};
  if (const auto* more = from.measures()) level.fidelity.more = std::bit_cast<LevelMeasures>(*more);
  if (from.derived_from() != nullptr) level.derived_from = from.derived_from()->str();
}

/// Of the places that a level's layers have in the file.
inline std::uint64_t layer_tile_bytes(const Level& level) {
  std::uint64_t bytes = 0;
  for (const Layer& layer : level.layers) bytes += layer.tiles.size() * sizeof(LayerTile);
  return bytes;
}

}  // namespace rbvh
