// A level's layers: made, and filled from a scan's vertex properties.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/closest_point.h"
#include "rbvh/progress.h"
#include "rbvh/scan.h"

namespace rbvh {

/// A layer without values, with `scale` of its texels to one of the heights'. Throws Error(kBudget) where its
/// atlas would be over 65535 texels wide or high.
Layer make_layer(const Level& level, const std::string& name, std::uint32_t channels, double scale);

/// So many texels of the layer there are to one of the heights', in the mean.
double mean_scale(const Level& level, const Layer& layer);

/// The layer's texels that lie on the surface: their places in `texels` (by pixel, not channel) and their
/// points.
struct LayerPoints {
  std::vector<std::size_t> texels;
  std::vector<Vec3f> points;
};
LayerPoints layer_points(const Level& level, const Layer& layer);

/// The nearest places on a mesh's finite triangles, or a cloud's points.
class NearestPlaces {
 public:
  explicit NearestPlaces(const Scan& scan);

  struct Place {
    std::uint32_t element = 0;              ///< triangle, or point
    std::array<float, 3> weights{1, 0, 0};  ///< of its corners
  };
  std::optional<Place> find(Vec3f point) const;

 private:
  std::vector<std::uint32_t> elements_;  ///< of the soup
  std::optional<ClosestPoint> closest_;
  const Scan& scan_;
};

/// The property at the point of the scan that is nearest to each point: interpolated in a triangle, or that
/// of a cloud's point.
std::vector<float> property_at(const Scan& scan, const ScalarProperty& property,
                               std::span<const Vec3f> points);

/// Adds each property as a layer of each level (replacing one of that name). Throws Error(kUsage) for a name
/// that the scan does not have or that a user's layer cannot have.
void add_property_layers(std::span<Level> levels, const Scan& scan, const std::vector<std::string>& names,
                         double scale, const Progress& progress = {});

}  // namespace rbvh
