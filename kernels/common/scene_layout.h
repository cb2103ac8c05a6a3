// Instances of a scene; shared with the host.
#ifndef RBVH_SCENE_LAYOUT_H
#define RBVH_SCENE_LAYOUT_H

#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/ray_queue_layout.h"

#ifndef __OPENCL_VERSION__
namespace rbvh {
#endif

typedef struct ScenePlacement {
  float to_object[12];  // rows of an affine map
  float lo[3];          // the object's box in the world
  rbvh_u32 first_leaf;  // of its own leaf 0 among all
  float hi[3];
  rbvh_u32 tracer;  // of its object
} ScenePlacement;
RBVH_LAYOUT_SIZE(ScenePlacement, 80);

// Scalars of a round of intersect_instances().
typedef struct SceneSearch {
  BvhRoot top;  // over the instances
  RayRange range;
  rbvh_u32 most_rays;   // at most so many go on, or begin
  rbvh_u32 most_items;  // a ray
} SceneSearch;
RBVH_LAYOUT_SIZE(SceneSearch, 60);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
