// A surface that is seen from its front alone.
#pragma once

#include <memory>

#include "rbvh/tracer.h"

namespace rbvh {

/// `of`, through whose back faces rays go on, up to 64 of them.
std::unique_ptr<Tracer> make_front_tracer(std::unique_ptr<Tracer> of);

}  // namespace rbvh
