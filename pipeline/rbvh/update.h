// Incremental maintenance (section 10 of the paper): leaves that a change meets are cut, what comes is built
// apart and joined to them, and the hierarchy over all leaves is made anew.
#pragma once

#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/update.h"

namespace rbvh {

/// update_pair() without an asset: the change's box is in stored coordinates, its scan in the pair's shift.
/// `rbvh` is as it was where an error is thrown.
UpdateReport update_rbvh(const Device& device, Rbvh& rbvh, const PairChange& change,
                         const Progress& progress = {});

}  // namespace rbvh
