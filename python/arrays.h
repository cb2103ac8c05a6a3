// NumPy's arrays and the library's vectors.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <initializer_list>
#include <vector>

#include "rbvh/geometry.h"

namespace rbvh_python {

namespace py = pybind11;

/// An array of float32 or float64 in C order: the caller's own where it is one, else a copy.
struct FloatArray {
  py::array array;
  bool is_double = false;

  const void* data() const { return array.data(); }
  std::size_t rows() const;                  ///< of the last axis
  std::vector<py::ssize_t> leading() const;  ///< the shape without the last axis
  double at(std::size_t i) const;
};

/// Throws rbvh::Error(kUsage) for what is no array of numbers whose last axis has one of these lengths.
FloatArray float_array(const py::handle& value, const char* name, std::initializer_list<py::ssize_t> columns);

/// The rows of an array (..., 3), less `shift`.
std::vector<rbvh::Vec3f> points_of(const FloatArray& array, const rbvh::Vec3d& shift);

/// A new array whose last axes are `more`.
template <class T>
py::array_t<T> make_array(std::vector<py::ssize_t> shape, std::initializer_list<py::ssize_t> more = {}) {
  shape.insert(shape.end(), more);
  return py::array_t<T>(shape);
}

/// A read-only view of memory that `owner` keeps.
template <class T>
py::array view_of(const T* data, std::vector<py::ssize_t> shape, const py::object& owner) {
  py::array_t<T> view(std::move(shape), data, owner);
  view.attr("flags").attr("writeable") = false;
  return view;
}

py::array_t<double> vector_array(const rbvh::Vec3d& v);

}  // namespace rbvh_python
