#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/update.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/update.h"

namespace rbvh {

UpdateReport update_pair(const Device& device, Asset& pair, const PairChange& change,
                         const Progress& progress) {
  Rbvh* const rbvh = pair.rbvh();
  if (rbvh == nullptr) throw Error(ErrorKind::kUsage, pair.path, "only a pair is updated, and this is none");
  PairChange inner = change;
  const Vec3d shift = rbvh->source.shift;
  if (inner.box) inner.box = Bounds3d{inner.box->lo - shift, inner.box->hi - shift};
  Scan moved;
  if (change.added != nullptr) {
    check_buildable(*change.added, "");
    if (change.added->shift != shift) {
      moved = *change.added;
      move_to_shift(moved, shift);
      inner.added = &moved;
    }
  }
  try {
    UpdateReport report = update_rbvh(device, *rbvh, inner, progress);
    pair.bounds = rbvh->source.bounds;
    return report;
  } catch (const Error& error) {
    if (!error.file().empty() || pair.path.empty()) throw;
    throw Error(error.kind(), pair.path, error.what(), error.remedy());
  }
}

}  // namespace rbvh
