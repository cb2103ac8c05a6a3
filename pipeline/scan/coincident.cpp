#include "pipeline/scan/coincident.h"

#include <algorithm>
#include <array>
#include <deque>
#include <numeric>
#include <span>
#include <utility>

#include "pipeline/base/sets.h"

namespace rbvh {
namespace {

/// Of one object; the smaller end first.
struct Edge {
  std::uint32_t from, to;
  std::int32_t object;
  auto operator<=>(const Edge&) const = default;  // NOLINT(modernize-use-nullptr)
};

struct Side {
  std::uint32_t edge;  ///< among the pairs' edges
  int turn;            ///< 1: from the smaller end to the larger one
};

/// Two faces that coincide. Their sides are those of the first; the second goes around the other way.
struct Pair {
  std::uint32_t first, second;
  std::array<Side, 3> sides{};
  bool is_settled = false;
};

/// Among those with one smallest corner.
struct Face {
  std::uint64_t corners;  ///< the others, sorted
  std::int32_t object;
  std::uint32_t number;
  auto operator<=>(const Face&) const = default;  // NOLINT(modernize-use-nullptr)
};

Triangle sorted(Triangle t) {
  std::sort(t.begin(), t.end());
  return t;
}

/// Whether the corners go around as their sorted order does.
bool is_even(const Triangle& t) { return ((t[0] > t[1]) != (t[1] > t[2])) == (t[0] > t[2]); }

class Coincident {
 public:
  Coincident(const std::vector<Triangle>& triangles, const std::vector<Vec3f>& positions,
             const std::vector<std::int32_t>& object_ids)
      : triangles_(triangles), positions_(positions), object_ids_(object_ids) {}

  std::vector<FaceFate> settle(float largest_flap, CoincidentCounts& counts) {
    find_pairs();
    if (pairs_.empty()) return {};
    find_edges();
    fates_.assign(triangles_.size(), FaceFate::kStays);
    close_from_edges(counts);
    close_by_patches(counts);
    settle_rest(largest_flap, counts);
    return std::move(fates_);
  }

 private:
  std::int32_t object(std::uint32_t i) const { return object_ids_.empty() ? 0 : object_ids_[i]; }

  void find_pairs() {
    // Those with one smallest corner come together, of which most corners have a few.
    std::vector<std::uint32_t> first(positions_.size() + 1, 0);
    for (const Triangle& t : triangles_) ++first[*std::min_element(t.begin(), t.end()) + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<Face> faces(triangles_.size());
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
      const auto [low, middle, high] = sorted(triangles_[i]);
      faces[next[low]++] = {std::uint64_t{middle} << 32 | high, object(i), i};
    }
    for (std::size_t v = 0; v + 1 < first.size(); ++v)
      pair_up(std::span(faces).subspan(first[v], first[v + 1] - first[v]));
    std::sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) { return a.first < b.first; });
  }

  void pair_up(std::span<Face> faces) {
    std::sort(faces.begin(), faces.end());
    for (std::size_t i = 0, end = 0; i < faces.size(); i = end) {
      const auto is_alike = [&](const Face& face) {
        return face.corners == faces[i].corners && face.object == faces[i].object;
      };
      while (end < faces.size() && is_alike(faces[end])) ++end;
      if (end - i < 2) continue;
      std::vector<std::uint32_t> waiting;  // of one winding, without a partner yet
      for (const Face& face : faces.subspan(i, end - i)) {
        if (waiting.empty() || is_even(triangles_[waiting.back()]) == is_even(triangles_[face.number])) {
          waiting.push_back(face.number);
          continue;
        }
        pairs_.push_back({.first = waiting.back(), .second = face.number});
        waiting.pop_back();
      }
    }
  }

  void find_edges() {
    const auto edge = [&](std::uint32_t i, std::size_t c) {
      const std::uint32_t a = triangles_[i][c], b = triangles_[i][(c + 1) % 3];
      return Edge{std::min(a, b), std::max(a, b), object(i)};
    };
    std::vector<std::uint8_t> is_other(triangles_.size(), 1), is_near(positions_.size(), 0);
    for (const Pair& pair : pairs_) {
      const Triangle& t = triangles_[pair.first];
      is_other[pair.first] = is_other[pair.second] = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        is_near[t[c]] = 1;
        edges_.push_back(edge(pair.first, c));
      }
    }
    std::sort(edges_.begin(), edges_.end());
    edges_.erase(std::unique(edges_.begin(), edges_.end()), edges_.end());
    const auto place = [&](const Edge& e) { return std::lower_bound(edges_.begin(), edges_.end(), e); };
    pairs_at_.resize(edges_.size());
    turns_.assign(edges_.size(), 0);
    others_.assign(edges_.size(), 0);
    for (std::uint32_t p = 0; p < pairs_.size(); ++p) {
      const Triangle& t = triangles_[pairs_[p].first];
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t a = t[c], b = t[(c + 1) % 3];
        const auto e = static_cast<std::uint32_t>(place(edge(pairs_[p].first, c)) - edges_.begin());
        pairs_[p].sides[c] = {e, a < b ? 1 : -1};
        pairs_at_[e].push_back(p);
      }
    }
    for (std::uint32_t i = 0; i < triangles_.size(); ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t a = triangles_[i][c], b = triangles_[i][(c + 1) % 3];
        if (is_other[i] == 0 || is_near[a] == 0 || is_near[b] == 0) continue;
        const auto at = place(edge(i, c));
        if (at == edges_.end() || *at != edge(i, c)) continue;
        turns_[static_cast<std::size_t>(at - edges_.begin())] += a < b ? 1 : -1;
        ++others_[static_cast<std::size_t>(at - edges_.begin())];
      }
  }

  /// The change of the number of open edges if the pair's first face (1) or its second (-1) stays.
  int change(const Pair& pair, int face) const {
    int sum = 0;
    for (const Side& side : pair.sides)
      sum += static_cast<int>(turns_[side.edge] + face * side.turn != 0) -
             static_cast<int>(turns_[side.edge] != 0);
    return sum;
  }

  /// The pair's first face (1) or its second (-1) stays.
  void keep_one(Pair& pair, int face, CoincidentCounts& counts) {
    pair.is_settled = true;
    fates_[face > 0 ? pair.second : pair.first] = FaceFate::kGoes;
    ++counts.closing;
    turn(pair, face);
    for (const Side& side : pair.sides) ++others_[side.edge];
  }
  void turn(const Pair& pair, int face) {
    for (const Side& side : pair.sides) turns_[side.edge] += face * side.turn;
  }

  /// One by one, from edges where the surface is open.
  void close_from_edges(CoincidentCounts& counts) {
    std::deque<std::uint32_t> queue(pairs_.size());
    std::iota(queue.begin(), queue.end(), 0u);
    std::vector<std::uint8_t> is_queued(pairs_.size(), 1);
    while (!queue.empty()) {
      Pair& pair = pairs_[queue.front()];
      is_queued[queue.front()] = 0;
      queue.pop_front();
      if (pair.is_settled) continue;
      const int face = change(pair, 1) <= change(pair, -1) ? 1 : -1;
      if (change(pair, face) >= 0) continue;
      keep_one(pair, face, counts);
      for (const Side& side : pair.sides)
        for (const std::uint32_t p : pairs_at_[side.edge]) {
          if (pairs_[p].is_settled || is_queued[p] != 0) continue;
          is_queued[p] = 1;
          queue.push_back(p);
        }
    }
  }

  /// Whole patches, whose faces are wound alike.
  void close_by_patches(CoincidentCounts& counts) {
    std::vector<int> face_of(pairs_.size(), 0);
    for (std::uint32_t p = 0; p < pairs_.size(); ++p) {
      if (pairs_[p].is_settled || face_of[p] != 0) continue;
      const std::vector<std::uint32_t> patch = patch_from(p, face_of);
      const auto change_by = [&](int face) {
        int sum = 0;
        for (const std::uint32_t q : patch) {
          sum += change(pairs_[q], face * face_of[q]);
          turn(pairs_[q], face * face_of[q]);
        }
        for (const std::uint32_t q : patch) turn(pairs_[q], -face * face_of[q]);
        return sum;
      };
      const int face = change_by(1) <= change_by(-1) ? 1 : -1;
      if (change_by(face) >= 0) continue;
      for (const std::uint32_t q : patch) keep_one(pairs_[q], face * face_of[q], counts);
    }
  }

  /// What is reached over edges of two pairs and no other open face; `face_of`: which of their faces are
  /// wound as the seed's first is.
  std::vector<std::uint32_t> patch_from(std::uint32_t seed, std::vector<int>& face_of) const {
    std::vector<std::uint32_t> patch = {seed};
    face_of[seed] = 1;
    for (std::size_t i = 0; i < patch.size(); ++i)
      for (const Side& side : pairs_[patch[i]].sides) {
        const std::vector<std::uint32_t>& at = pairs_at_[side.edge];
        if (at.size() != 2 || turns_[side.edge] != 0) continue;
        const std::uint32_t next = at[0] == patch[i] ? at[1] : at[0];
        if (pairs_[next].is_settled || face_of[next] != 0) continue;
        for (const Side& other : pairs_[next].sides)
          if (other.edge == side.edge) face_of[next] = -face_of[patch[i]] * side.turn * other.turn;
        patch.push_back(next);
      }
    return patch;
  }

  void settle_rest(float largest_flap, CoincidentCounts& counts) {
    Sets groups(pairs_.size());
    for (std::vector<std::uint32_t>& at : pairs_at_) {
      std::erase_if(at, [&](std::uint32_t p) { return pairs_[p].is_settled; });
      for (const std::uint32_t p : at) groups.join(at.front(), p);
    }
    std::vector<Bounds3f> boxes(pairs_.size());
    std::vector<std::uint8_t> is_attached(pairs_.size(), 0);
    for (std::uint32_t p = 0; p < pairs_.size(); ++p) {
      const std::uint32_t group = groups.find(p);
      for (const std::uint32_t corner : triangles_[pairs_[p].first]) boxes[group].add(positions_[corner]);
      for (const Side& side : pairs_[p].sides)
        is_attached[group] |= static_cast<std::uint8_t>(others_[side.edge] > 0);
    }
    for (std::uint32_t p = 0; p < pairs_.size(); ++p) {
      const Pair& pair = pairs_[p];
      if (pair.is_settled) continue;
      const std::uint32_t group = groups.find(p);
      const bool is_sheet = is_attached[group] == 0 || boxes[group].diagonal() > largest_flap;
      fates_[pair.first] = is_sheet ? FaceFate::kSheet : FaceFate::kGoes;
      fates_[pair.second] = is_sheet ? FaceFate::kSheetsBack : FaceFate::kGoes;
      ++(is_sheet ? counts.sheets : counts.flaps);
    }
  }

  const std::vector<Triangle>& triangles_;
  const std::vector<Vec3f>& positions_;
  const std::vector<std::int32_t>& object_ids_;
  std::vector<Pair> pairs_;
  std::vector<Edge> edges_;                           ///< of all pairs
  std::vector<std::vector<std::uint32_t>> pairs_at_;  ///< each edge
  std::vector<int> turns_;                            ///< each edge, around all faces but the pairs' that go
  std::vector<int> others_;                           ///< faces at each edge, likewise
  std::vector<FaceFate> fates_;
};

}  // namespace

std::vector<FaceFate> settle_coincident(const std::vector<Triangle>& triangles,
                                        const std::vector<Vec3f>& positions,
                                        const std::vector<std::int32_t>& object_ids, float largest_flap,
                                        CoincidentCounts& counts) {
  return Coincident(triangles, positions, object_ids).settle(largest_flap, counts);
}

}  // namespace rbvh
