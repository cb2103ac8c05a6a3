// OpenCL's C++ bindings, whose calls throw cl::Error. Only this folder includes them.
#pragma once

#define CL_HPP_ENABLE_EXCEPTIONS
#include <CL/opencl.hpp>
