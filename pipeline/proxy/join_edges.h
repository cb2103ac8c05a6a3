// Makes patches that share an edge of the base bitwise equal there (see proxy.h).
#pragma once

#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// Along each edge of the base, all patches take the displacements of the first of them (by number), at the
/// texels of the coarsest; finer ones' texels in between move onto its chords. All patches' corners at a
/// vertex must hold the same displacement already. Updates the longest displacements.
void join_edges(Proxy& proxy);

}  // namespace rbvh
