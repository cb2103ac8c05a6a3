#include "python/arrays.h"

#include <algorithm>
#include <string>

#include "rbvh/error.h"

namespace rbvh_python {

std::size_t FloatArray::rows() const {
  const auto columns = array.shape(array.ndim() - 1);
  return static_cast<std::size_t>(array.size() / columns);
}

std::vector<py::ssize_t> FloatArray::leading() const {
  return {array.shape(), array.shape() + array.ndim() - 1};
}

double FloatArray::at(std::size_t i) const {
  return is_double ? static_cast<const double*>(data())[i]
                   : static_cast<double>(static_cast<const float*>(data())[i]);
}

FloatArray float_array(const py::handle& value, const char* name,
                       std::initializer_list<py::ssize_t> columns) {
  const py::array any = py::array::ensure(value);
  std::string wanted;
  for (const py::ssize_t each : columns) wanted += (wanted.empty() ? "" : " or ") + std::to_string(each);
  const bool fits = any && any.ndim() > 0 &&
                    std::string("fiub").find(any.dtype().kind()) != std::string::npos &&
                    std::find(columns.begin(), columns.end(), any.shape(any.ndim() - 1)) != columns.end();
  if (!fits)
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "",
                      std::string(name) + ": an array of numbers of shape (..., " + wanted + ") is wanted");
  if (any.dtype().kind() == 'f' && any.itemsize() <= 4)
    return {py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(any), false};
  return {py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(any), true};
}

std::vector<rbvh::Vec3f> points_of(const FloatArray& array, const rbvh::Vec3d& shift) {
  std::vector<rbvh::Vec3f> points(array.rows());
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i] = rbvh::Vec3f(rbvh::Vec3d{array.at(3 * i), array.at(3 * i + 1), array.at(3 * i + 2)} - shift);
  return points;
}

py::array_t<double> vector_array(const rbvh::Vec3d& v) {
  py::array_t<double> array(3);
  for (int axis = 0; axis < 3; ++axis) array.mutable_at(axis) = v[axis];
  return array;
}

}  // namespace rbvh_python
