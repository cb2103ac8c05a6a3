// Patches that share an edge of the base come to share one surface there, bit by bit (see proxy.h).
#pragma once

#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// Along each edge of the base, all patches take what the first of them (by number) holds there, at the
/// texels of the coarsest; in between, finer ones are put on its chords. All patches' corners at a vertex
/// must hold the same displacement already. The longest displacements are measured anew.
void join_edges(Proxy& proxy);

}  // namespace rbvh
