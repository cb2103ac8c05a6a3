#include "broken_include.h"
__kernel void broken(__global uint* out) { out[0] = 1; }
