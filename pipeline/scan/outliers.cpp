// PCL's templates, compiled here: its library of filters takes as long to load as the tool to start.
#define PCL_NO_PRECOMPILE
#include "pipeline/scan/outliers.h"

#include <pcl/console/print.h>
#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <algorithm>

#include "pipeline/scan/compact.h"

namespace rbvh {

std::size_t remove_outliers(Scan& scan, std::size_t neighbors, double sigma) {
  const std::size_t count = scan.positions.size();
  if (count < 3) return 0;
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);  // it prints to stderr otherwise
  const auto cloud = pcl::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
  cloud->reserve(count);
  for (const Vec3f& p : scan.positions) cloud->emplace_back(p.x, p.y, p.z);
  pcl::StatisticalOutlierRemoval<pcl::PointXYZ> filter;
  filter.setInputCloud(cloud);
  filter.setMeanK(static_cast<int>(std::min(neighbors, count - 1)));
  filter.setStddevMulThresh(sigma);
  pcl::Indices kept;
  filter.filter(kept);
  std::vector<std::uint8_t> keep(count, 0);
  for (const auto index : kept) keep[static_cast<std::size_t>(index)] = 1;
  keep_vertices(scan, keep);
  return count - kept.size();
}

}  // namespace rbvh
