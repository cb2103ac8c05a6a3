#include "pipeline/rbvh/update.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/rbvh/build_options.h"
#include "pipeline/rbvh/build_part.h"
#include "pipeline/rbvh/close_seam.h"
#include "pipeline/rbvh/join_levels.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_mesh.h"
#include "pipeline/rbvh/texture_layer.h"
#include "pipeline/scan/compact.h"

namespace rbvh {
namespace {

[[noreturn]] void refuse(ErrorKind kind, const std::string& what) { throw Error(kind, "", what); }

bool has_tiles(const Level& level) { return level.primitive_leaves.size() < level.leaves.size(); }

/// How far what comes goes on past the box, scan units: where a surface all but lies in a face of the box,
/// two levels of it end far apart. A cloud's levels and those by density have no error.
double overlap_of(const Rbvh& rbvh, const Level& level) {
  const double error = static_cast<double>(level.error) * static_cast<double>(rbvh.source.bounds.diagonal());
  return level.error > 0 && rbvh.source.triangles > 0 ? 2 * error : std::max(error, 1.5 * texel_side(level));
}

/// Borders at the box that are farther apart are those of other surfaces. Two levels that miss one scan by an
/// error, root mean square, are rarely so far.
double seam_width(const Rbvh& rbvh, const Level& level) {
  return 6 * static_cast<double>(level.error) * static_cast<double>(rbvh.source.bounds.diagonal());
}

/// Past the box: what is built, of which each level takes its overlap. Nearer to where the scan is cut off,
/// its levels are not as they are elsewhere.
double build_margin(const Rbvh& rbvh) {
  double margin = 0;
  for (const Level& level : rbvh.levels)
    margin = std::max(margin, overlap_of(rbvh, level) + seam_width(rbvh, level) +
                                  (has_tiles(level) ? 3 * texel_side(level) : 0));
  return margin;
}

std::string point_text(const Vec3d& p) {
  char text[96];
  std::snprintf(text, sizeof text, "%.9g,%.9g,%.9g", p.x, p.y, p.z);
  return text;
}

bool has_object(const Rbvh& rbvh, std::int32_t object) {
  return std::any_of(rbvh.levels.begin(), rbvh.levels.end(), [&](const Level& level) {
    const std::vector<std::uint32_t> ids = objects_of(level);
    return std::binary_search(ids.begin(), ids.end(), static_cast<std::uint32_t>(object));
  });
}

void check_change(const Rbvh& rbvh, const PairChange& change) {
  if (!change.box && !change.object && change.added == nullptr)
    refuse(ErrorKind::kUsage, "nothing is to be changed");
  if (change.box && change.object) refuse(ErrorKind::kUsage, "a box goes or an object, not both");
  const Bounds3d all = to_double(rbvh.levels.front().bounds);
  if (change.box && !overlap(*change.box, all))
    refuse(ErrorKind::kUsage, "the box lies beside the pair, which spans " +
                                  point_text(all.lo + rbvh.source.shift) + " to " +
                                  point_text(all.hi + rbvh.source.shift));
  if (change.object && !has_object(rbvh, *change.object))
    refuse(ErrorKind::kUsage,
           "the pair has no object " + std::to_string(*change.object) + "; it has " +
               counted(objects_of(rbvh.levels.front()).size(), "object") + ", numbered up to " +
               std::to_string(static_cast<std::int32_t>(objects_of(rbvh.levels.front()).back())));
  if (change.added != nullptr && change.added->is_cloud() != (rbvh.source.triangles == 0))
    refuse(ErrorKind::kInput, change.added->is_cloud()
                                  ? "what is to be added is a cloud, and the pair is of a mesh"
                                  : "what is to be added is a mesh, and the pair is of a cloud");
}

/// The object that most of the leaves in the box belong to.
std::int32_t object_in(const LooseLevel& level, const Bounds3d& box) {
  std::map<std::uint32_t, std::size_t> counts;
  for (std::size_t i = 0; i < level.boxes.size(); ++i)
    if (overlap(to_double(level.boxes[i]), box)) ++counts[level.level.leaves[i].object_id];
  const auto most = std::max_element(counts.begin(), counts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == counts.end() ? 0 : static_cast<std::int32_t>(most->first);
}

/// The mesh's triangles that may meet the box, and their vertices.
Scan triangles_near(const Scan& mesh, const Bounds3d& box) {
  constexpr std::uint32_t kNone = 0xffffffffu;
  Scan near;
  near.shift = mesh.shift;
  near.units = mesh.units;
  near.textures = mesh.textures;
  for (const ScalarProperty& property : mesh.properties) near.properties.push_back({property.name, {}});
  std::vector<std::uint32_t> numbers(mesh.positions.size(), kNone);
  const auto number = [&](std::uint32_t vertex) {
    if (numbers[vertex] != kNone) return numbers[vertex];
    near.positions.push_back(mesh.positions[vertex]);
    if (!mesh.normals.empty()) near.normals.push_back(mesh.normals[vertex]);
    if (!mesh.colors.empty()) near.colors.push_back(mesh.colors[vertex]);
    for (std::size_t i = 0; i < mesh.properties.size(); ++i)
      near.properties[i].values.push_back(mesh.properties[i].values[vertex]);
    return numbers[vertex] = static_cast<std::uint32_t>(near.positions.size() - 1);
  };
  const auto is_beside = [&](float p, float q, float r, int axis) {
    return static_cast<double>(std::max({p, q, r})) < box.lo[axis] ||
           static_cast<double>(std::min({p, q, r})) > box.hi[axis];
  };
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    Triangle t = mesh.triangles[i];
    const Vec3f &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    if (is_beside(a.x, b.x, c.x, 0) || is_beside(a.y, b.y, c.y, 1) || is_beside(a.z, b.z, c.z, 2)) continue;
    for (std::uint32_t& vertex : t) vertex = number(vertex);
    near.triangles.push_back(t);
    if (!mesh.object_ids.empty()) near.object_ids.push_back(mesh.object_ids[i]);
    if (!mesh.face_textures.empty()) near.face_textures.push_back(mesh.face_textures[i]);
  }
  return near;
}

/// How many of the scan's primitives have their centres in the box.
std::uint64_t count_within(const Scan& scan, const Bounds3d& box) {
  const auto center = [&](const Triangle& t) {
    return (Vec3d(scan.positions[t[0]]) + Vec3d(scan.positions[t[1]]) + Vec3d(scan.positions[t[2]])) *
           (1.0 / 3);
  };
  if (scan.is_cloud())
    return static_cast<std::uint64_t>(std::count_if(scan.positions.begin(), scan.positions.end(),
                                                    [&](Vec3f p) { return contains(box, Vec3d(p)); }));
  return static_cast<std::uint64_t>(
      std::count_if(scan.triangles.begin(), scan.triangles.end(),
                    [&](const Triangle& t) { return contains(box, center(t)); }));
}

/// The part of the scan in the box and `margin` past it. `count`: of its primitives in the box.
Scan part_within(const Scan& scan, const Bounds3d& box, double margin, std::uint64_t& count) {
  const Bounds3d wide = grown(box, margin);
  Scan part;
  bool is_empty = false;
  if (scan.is_cloud()) {
    std::vector<std::uint8_t> keep(scan.positions.size());
    for (std::size_t i = 0; i < keep.size(); ++i) keep[i] = contains(wide, Vec3d(scan.positions[i])) ? 1 : 0;
    part = scan;
    keep_vertices(part, keep);
    count = count_within(part, box);
    is_empty = count == 0;
  } else {
    part = triangles_near(scan, wide);
    count = count_within(part, box);
    clip_triangles(part, wide, BoxSide::kInside, {});
    part = triangles_near(part, wide);  // without the vertices that are left over
    Scan inside = part;
    clip_triangles(inside, box, BoxSide::kInside, {});
    is_empty = inside.triangles.empty();
  }
  if (is_empty) refuse(ErrorKind::kInput, "what is to be added has nothing within the box");
  return part;
}

/// What is built, with the objects that it has in the pair.
Scan scan_to_build(const Rbvh& rbvh, const PairChange& change, std::int32_t replaced,
                   std::uint64_t& primitives) {
  const Scan& added = *change.added;
  primitives = added.is_cloud() ? added.positions.size() : added.triangles.size();
  Scan scan = change.is_replacement && change.box
                  ? part_within(added, *change.box, build_margin(rbvh), primitives)
                  : added;
  const std::size_t count = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  if (change.is_replacement) {
    if (change.object || scan.object_ids.empty()) scan.object_ids.assign(count, replaced);
    return scan;
  }
  std::int64_t most = -1;
  for (const Level& level : rbvh.levels)
    for (const std::uint32_t id : objects_of(level))
      most = std::max<std::int64_t>(most, static_cast<std::int32_t>(id));
  scan.object_ids.resize(count);
  const auto [least, highest] = std::minmax_element(scan.object_ids.begin(), scan.object_ids.end());
  const std::int64_t by = most + 1 - *least;
  if (*highest + by > std::numeric_limits<std::int32_t>::max())
    refuse(ErrorKind::kInput, "there are no numbers left for more objects");
  for (std::int32_t& id : scan.object_ids) id = static_cast<std::int32_t>(id + by);
  return scan;
}

/// Layers of a user's as the pair's level has them, of the scan's textures, colours and properties.
void add_users_layers(const Level& before, float texel, const Scan& scan, LooseLevel& loose) {
  Level& added = loose.level;
  for (const RbvhPrimitiveLeaf& leaf : added.primitive_leaves)
    if (loose.is_new[leaf.leaf] != 0) fit_frame(added.primitives, leaf.first, texel, added.leaves[leaf.leaf]);
  for (const Layer& layer : before.layers) {
    if (layer_kind(layer.name) != LayerKind::kUser) continue;
    const double scale = mean_scale(before, layer);
    const bool is_property =
        std::any_of(scan.properties.begin(), scan.properties.end(),
                    [&](const ScalarProperty& property) { return property.name == layer.name; });
    if (&layer == texture_layer(before)) {
      if (!scan.textures.empty() || !scan.colors.empty()) add_texture_layers({&added, 1}, scan, scale);
    } else if (is_property && layer.channels == 1) {
      add_property_layers({&added, 1}, scan, {layer.name}, scale);
    }
  }
}

/// Of each vertex of a mesh that was cut at the box whether it lies there: levels keep these, as simplified
/// corners would be round.
std::vector<std::uint8_t> find_border(const Scan& mesh, const Bounds3d& box) {
  std::vector<std::uint8_t> is_border;
  const Vec3f lo(box.lo), hi(box.hi);
  for (const Vec3f& p : mesh.positions) {
    bool is_inside = true;
    for (int axis = 0; axis < 3; ++axis) is_inside = is_inside && p[axis] > lo[axis] && p[axis] < hi[axis];
    is_border.push_back(is_inside ? 0 : 1);
  }
  return is_border;
}

/// What comes, as levels in the lattices and grids of the pair's.
std::vector<Level> build_added(const Device& device, const Rbvh& rbvh, const Scan& scan,
                               std::vector<std::uint8_t>&& border, const Progress& progress,
                               std::vector<std::string>& notes) {
  bool lacks_focus = false;
  BuildConfig config = stored_config(rbvh.build_options, rbvh.source.shift, lacks_focus);
  if (lacks_focus)
    notes.push_back("what is added has no focus: that of a camera without a radius is not kept");
  config.levels.clear();
  config.area = rbvh.source.area;
  ScanPart part{.box = rbvh.source.bounds,
                .area = rbvh.source.area,
                .vertices = rbvh.source.vertices,
                .triangles = rbvh.source.triangles,
                .own_vertices = static_cast<std::uint32_t>(scan.positions.size()),
                .own_primitives = static_cast<std::uint32_t>(scan.is_cloud() ? scan.positions.size()
                                                                             : scan.triangles.size()),
                .stays = std::move(border)};
  for (const Level& level : rbvh.levels) {
    config.levels.push_back({level.name, level.rho, level.alpha, level.phi_degrees, level.error});
    part.joined.push_back({level.lattice, level.grid, !has_tiles(level)});
    part.one_sided = part.one_sided || texture_layer(level) != nullptr;
  }
  return build_part(device, scan.textures.empty() ? Scan(scan) : colored_by_textures(scan), part, config,
                    progress)
      .levels;
}

/// Another source area leaves texels as wide as they were, to the last bit: frames follow from them.
void scale_rho(Level& level, double area, double new_area) {
  const float texel = primitive_texel(area, level.rho);
  const auto rho = static_cast<float>(static_cast<double>(level.rho) * new_area / area);
  for (const int by : {0, 1, -1, 2, -2}) {
    level.rho = rho;
    for (int k = 0; k < std::abs(by); ++k) level.rho = std::nextafter(level.rho, by > 0 ? 2 * rho : 0.0f);
    if (primitive_texel(new_area, level.rho) == texel) return;
  }
  level.rho = rho;
}

/// Sides of the source's box go where those of the finest level went.
Bounds3f moved_bounds(const RbvhSource& source, const Bounds3f& before, const Bounds3f& now,
                      const Bounds3f& added) {
  Bounds3f most = source.bounds, box = source.bounds;
  if (!added.empty()) most.add(added);
  for (int axis = 0; axis < 3; ++axis) {
    if (now.lo[axis] != before.lo[axis]) box.lo[axis] = std::max(now.lo[axis], most.lo[axis]);
    if (now.hi[axis] != before.hi[axis]) box.hi[axis] = std::min(now.hi[axis], most.hi[axis]);
    if (box.lo[axis] > box.hi[axis]) box.hi[axis] = box.lo[axis];
  }
  return box;
}

/// An update in the making.
class Update {
 public:
  Update(const Device& device, const Rbvh& before, const PairChange& change, const Progress& progress)
      : device_(device), before_(before), change_(change), progress_(progress) {}

  Rbvh run() {
    check_change(before_, change_);
    report(progress_, "cut", 0);
    cut();
    report_.cut = watch_.lap();
    if (change_.added != nullptr) {
      const std::string &units = change_.added->units, &own = before_.source.units;
      if (!units.empty() && own != "unknown" && units != own)
        report_.notes.push_back("what is added is in " + units + " and the pair in " + own +
                                "; nothing is converted");
      scan_ = scan_to_build(before_, change_, change_.object.value_or(object_), primitives_);
      std::vector<std::uint8_t> border;
      if (change_.is_replacement && change_.box && !scan_.is_cloud())
        border = find_border(scan_, grown(*change_.box, build_margin(before_)));
      added_ = build_added(device_, before_, scan_, std::move(border), progress_, report_.notes);
    }
    report_.build = watch_.lap();
    report(progress_, "join", 0);
    join();
    settle();
    report_.join = watch_.lap();
    report(progress_, "join", 1);
    return std::move(after_);
  }

  UpdateReport&& take_report() { return std::move(report_); }

 private:
  void cut() {
    std::vector<std::future<CutCounts>> cuts;
    kept_.resize(before_.levels.size());
    untouched_.resize(kept_.size());
    reached_.resize(kept_.size());
    for (std::size_t i = 0; i < kept_.size(); ++i)
      cuts.push_back(std::async(std::launch::async, [this, i] { return cut(i); }));
    std::uint64_t touched = 0;
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      const CutCounts counts = cuts[i].get();
      touched += counts.removed + counts.cut;
      report_.levels.push_back({before_.levels[i].name, 0, counts.removed, counts.cut, 0});
    }
    if (change_.box && touched == 0) refuse(ErrorKind::kUsage, "nothing of the pair lies within the box");
  }

  CutCounts cut(std::size_t i) {
    const Level& level = before_.levels[i];
    const std::vector<Bounds3f> boxes = leaf_boxes(level);
    const auto goes = [&](std::uint32_t leaf) {
      if (change_.box) return overlap(to_double(boxes[leaf]), *change_.box);
      return change_.object && level.leaves[leaf].object_id == static_cast<std::uint32_t>(*change_.object);
    };
    std::vector<std::uint32_t> touched;
    for (std::uint32_t leaf = 0; leaf < boxes.size(); ++leaf)
      (goes(leaf) ? touched : untouched_[i]).push_back(leaf);
    LooseLevel& kept = kept_[i] = take_leaves(level, boxes, touched);
    if (i == 0) area_before_ = surface_area(level, boxes);
    if (i == 0) area_kept_ = area_before_ - surface_area(kept);
    if (i == 0 && change_.box) object_ = object_in(kept, *change_.box);
    CutCounts counts;
    if (change_.box) {
      counts = cut_level(kept, *change_.box, BoxSide::kOutside);
    } else {
      counts.removed = touched.size();
      kept = {};
    }
    if (i == 0) area_kept_ += surface_area(kept);
    return counts;
  }

  void join() {
    after_.source = before_.source;
    after_.build_options = count_update(before_.build_options);
    std::vector<std::future<std::pair<Level, JoinCounts>>> joins;
    for (std::size_t i = 0; i < kept_.size(); ++i)
      joins.push_back(std::async(std::launch::async, [this, i] { return join(i); }));
    for (auto& join : joins) join.wait();  // they use what an error would take away
    JoinCounts lacks;
    for (auto& join : joins) {
      auto [level, counts] = join.get();
      after_.levels.push_back(std::move(level));
      lacks.lacks_colors = lacks.lacks_colors || counts.lacks_colors;
      lacks.drops_colors = lacks.drops_colors || counts.drops_colors;
      lacks.lacking.insert(lacks.lacking.end(), counts.lacking.begin(), counts.lacking.end());
    }
    say_lacks(lacks);
  }

  std::pair<Level, JoinCounts> join(std::size_t i) {
    const Level& before = before_.levels[i];
    LooseLevel added;
    if (!added_.empty()) added = loosen(std::move(added_[i]));
    if (!added_.empty() && change_.box && change_.is_replacement) {
      cut_level(added, grown(*change_.box, overlap_of(before_, before)), BoxSide::kInside);
      cut_level(added, *change_.box, BoxSide::kBoth);
      close_seam(kept_[i], added, seam_width(before_, before));
    }
    const std::size_t leaves = untouched_[i].size() + kept_[i].boxes.size() + added.boxes.size();
    if (leaves == 0) refuse(ErrorKind::kUsage, "nothing would be left of level " + before.name);
    if (i == 0) area_added_ = surface_area(added);
    report_.levels[i].added = added.boxes.size();
    report_.levels[i].leaves = leaves;
    const float texel = primitive_texel(before_.source.area, before.rho);
    if (!added.boxes.empty()) add_users_layers(before, texel, scan_, added);
    reached_[i] = added.level.reached;
    JoinCounts counts;
    Level level = join_levels(before, untouched_[i], std::move(kept_[i]), std::move(added), texel, counts);
    return {std::move(level), std::move(counts)};
  }

  /// Errors count by area, taken for evenly spread over what was there.
  float reached_by(std::size_t i) const {
    const auto old_error = static_cast<double>(before_.levels[i].reached),
               new_error = static_cast<double>(reached_[i]);
    const double all = area_kept_ + area_added_;
    if (!(old_error > 0) || !(area_added_ > 0) || !(all > 0)) return before_.levels[i].reached;
    return static_cast<float>(
        std::sqrt((area_kept_ * old_error * old_error + area_added_ * new_error * new_error) / all));
  }

  void say_lacks(const JoinCounts& lacks) {
    if (lacks.lacks_colors) report_.notes.push_back("what is added has no colours, and is white");
    if (lacks.drops_colors)
      report_.notes.push_back("the colours of what is added are left out, as the pair has none");
    std::vector<std::string> names = lacks.lacking;
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    for (const std::string& name : names)
      report_.notes.push_back("what is added has no values for layer " + name);
  }

  /// The figures of the source, and of the levels where these are parts of it.
  void settle() {
    RbvhSource& source = after_.source;
    const double kept = area_before_ > 0 ? area_kept_ / area_before_ : 1,
                 all = area_before_ > 0 ? (area_kept_ + area_added_) / area_before_ : 1;
    report_.removed_area = 1 - kept;
    report_.added_area = all - kept;
    const Bounds3f added_box = change_.added != nullptr ? bounds(scan_) : Bounds3f();
    source.bounds =
        moved_bounds(source, before_.levels.front().bounds, after_.levels.front().bounds, added_box);
    source.hash = 0;
    source.area = before_.source.area * all;
    count_primitives(kept);
    const float scale =
        source.bounds.diagonal() > 0 ? before_.source.bounds.diagonal() / source.bounds.diagonal() : 1;
    for (std::size_t i = 0; i < after_.levels.size(); ++i) {
      Level& level = after_.levels[i];
      scale_rho(level, before_.source.area, source.area);
      level.error *= scale;
      level.reached = reached_by(i) * scale;
      level.fidelity = {};
    }
  }

  /// `kept`: of the area. Vertices as many to a primitive as what comes has.
  void count_primitives(double kept) {
    const auto left = [&](std::uint64_t before) {
      return std::max<std::uint64_t>(
          static_cast<std::uint64_t>(std::llround(static_cast<double>(before) * kept)), 1);
    };
    RbvhSource& source = after_.source;
    std::uint64_t vertices = 0;
    if (const Scan* added = change_.added; added != nullptr) {
      const std::size_t all = added->is_cloud() ? added->positions.size() : added->triangles.size();
      vertices = added->positions.size() * primitives_ / all;
    }
    source.vertices = left(source.vertices) + vertices;
    if (source.triangles > 0) source.triangles = left(source.triangles) + primitives_;
  }

  const Device& device_;
  const Rbvh& before_;
  const PairChange& change_;
  const Progress& progress_;
  Stopwatch watch_;
  UpdateReport report_;
  Rbvh after_;
  std::vector<std::vector<std::uint32_t>> untouched_;  // leaves of each level
  std::vector<LooseLevel> kept_;                       // what is left of the others
  std::vector<Level> added_;
  Scan scan_;                     // what was built of it
  std::uint64_t primitives_ = 0;  // of these those that are counted
  std::int32_t object_ = 0;       // that the box is in
  std::vector<float> reached_;    // by what is added
  double area_before_ = 0, area_kept_ = 0, area_added_ = 0;
};

}  // namespace

UpdateReport update_rbvh(const Device& device, Rbvh& rbvh, const PairChange& change,
                         const Progress& progress) {
  Update update(device, rbvh, change, progress);
  rbvh = update.run();
  return update.take_report();
}

}  // namespace rbvh
