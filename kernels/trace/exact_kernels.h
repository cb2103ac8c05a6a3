// The kernels of an exact traversal. The file that includes this has included exact_tree.h, and has defined
// what ray_kernels.h asks for and  float3 unit_normal(primitives, at).
#include "kernels/common/no_hit.h"

static ALWAYS_INLINE Hit make_hit(const Tree* tree, const Found* found, const Ray* ray) {
  Hit hit = no_hit();
  if (found->id != RBVH_NO_LEAF) {
    const float3 n = unit_normal(tree->primitives, found->at);
    hit.t = found->t;
    hit.normal[0] = n.x;
    hit.normal[1] = n.y;
    hit.normal[2] = n.z;
    hit.u = found->u;
    hit.v = found->v;
    hit.leaf = found->id;
    const float along = n.x * ray->direction[0] + n.y * ray->direction[1] + n.z * ray->direction[2];
    hit.flags = RBVH_HIT_ON_PRIMITIVE | (along > 0.0f ? RBVH_HIT_BACK_FACE : 0u);
  }
  return hit;
}

#include "kernels/trace/ray_kernels.h"
