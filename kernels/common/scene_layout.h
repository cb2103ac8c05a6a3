// Where an object stands among others; shared with the host.
#ifndef RBVH_SCENE_LAYOUT_H
#define RBVH_SCENE_LAYOUT_H

#include "kernels/common/layout.h"

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

// How far a ray has come among instances or patches, nearest first: those that it enters up to (t, id) are
// done with; it enters the next one at next_t.
typedef struct RayProgress {
  float t;
  rbvh_u32 id;
  float next_t;
} RayProgress;
RBVH_LAYOUT_SIZE(RayProgress, 12);

#ifndef __OPENCL_VERSION__
}  // namespace rbvh
#endif
#endif
