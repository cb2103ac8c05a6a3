// Scans: from arrays and files, and as arrays.
#include <pybind11/stl.h>

#include <array>
#include <cstring>
#include <limits>

#include "python/arrays.h"
#include "python/asset.h"
#include "rbvh/complete_scan.h"
#include "rbvh/error.h"
#include "rbvh/io.h"
#include "rbvh/scan.h"

namespace rbvh_python {
namespace {

/// Rows of an array (count, columns) of any type that T can hold.
template <class T, class Row>
void copy_rows(const py::object& value, const char* name, py::ssize_t columns, std::vector<Row>& to,
               std::size_t count = 0) {
  static_assert(sizeof(Row) % sizeof(T) == 0);
  if (value.is_none()) return;
  const auto rows = py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(value);
  const bool fits = rows &&
                    (columns == 1 ? rows.ndim() == 1 : rows.ndim() == 2 && rows.shape(1) == columns) &&
                    (count == 0 || static_cast<std::size_t>(rows.shape(0)) == count);
  if (!fits)
    throw rbvh::Error(rbvh::ErrorKind::kUsage, "",
                      std::string(name) + ": an array of shape (" + (count ? std::to_string(count) : "N") +
                          (columns == 1 ? ",)" : ", " + std::to_string(columns) + ")") + " is wanted");
  to.resize(static_cast<std::size_t>(rows.shape(0)));
  if (!to.empty()) std::memcpy(static_cast<void*>(to.data()), rows.data(), to.size() * sizeof(Row));
}

void copy_triangles(const py::object& value, std::vector<rbvh::Triangle>& to) {
  std::vector<std::array<std::int64_t, 3>> rows;
  copy_rows<std::int64_t>(value, "triangles", 3, rows);
  to.reserve(rows.size());
  for (const auto& row : rows) {
    for (const std::int64_t corner : row)
      if (corner < 0 || corner >= std::numeric_limits<std::uint32_t>::max())
        throw rbvh::Error(rbvh::ErrorKind::kUsage, "",
                          "triangles: " + std::to_string(corner) + " is no vertex");
    to.push_back({static_cast<std::uint32_t>(row[0]), static_cast<std::uint32_t>(row[1]),
                  static_cast<std::uint32_t>(row[2])});
  }
}

/// Bytes as they are; floats in [0, 1].
void copy_colors(const py::object& value, std::size_t count, std::vector<rbvh::Color8>& to) {
  if (value.is_none()) return;
  const py::array any = py::array::ensure(value);
  if (!any || any.dtype().kind() != 'f') return copy_rows<std::uint8_t>(value, "colors", 3, to, count);
  const auto scaled =
      py::module_::import("numpy").attr("clip")(any, 0, 1) * py::float_(255.0) + py::float_(0.5);
  copy_rows<std::uint8_t>(scaled, "colors", 3, to, count);
}

std::shared_ptr<PyScan> held(rbvh::Scan&& scan, const std::string& name) {
  return std::make_shared<PyScan>(rbvh::make_asset(std::move(scan), name));
}

std::shared_ptr<PyScan> scan_of(const py::object& vertices, const py::object& triangles,
                                const py::object& normals, const py::object& colors, const py::object& radii,
                                const py::object& object_ids,
                                const std::map<std::string, py::object>& properties,
                                const std::string& units) {
  rbvh::RawScan raw;
  copy_rows<double>(vertices, "vertices", 3, raw.positions);
  const std::size_t count = raw.positions.size();
  copy_triangles(triangles, raw.triangles);
  copy_rows<float>(normals, "normals", 3, raw.normals, count);
  copy_colors(colors, count, raw.colors);
  copy_rows<float>(radii, "radii", 1, raw.radii, count);
  copy_rows<std::int32_t>(object_ids, "object_ids", 1, raw.object_ids,
                          raw.triangles.empty() ? count : raw.triangles.size());
  for (const auto& [name, values] : properties) {
    raw.properties.push_back({name, {}});
    copy_rows<float>(values, name.c_str(), 1, raw.properties.back().values, count);
  }
  raw.units = units;
  const py::gil_scoped_release released;
  rbvh::Scan scan = rbvh::shift_to_float(std::move(raw));
  rbvh::complete_scan(scan, check_signals());
  return held(std::move(scan), "scan");
}

py::object rows_view(const PyScan& self, const auto& rows, py::ssize_t columns) {
  if (rows.empty()) return py::none();
  using T = std::remove_cvref_t<decltype(rows[0][0])>;
  return view_of<T>(reinterpret_cast<const T*>(rows.data()), {static_cast<py::ssize_t>(rows.size()), columns},
                    py::cast(&self, py::return_value_policy::reference));
}

template <class T>
py::object values_view(const PyScan& self, const std::vector<T>& values) {
  if (values.empty()) return py::none();
  return view_of<T>(values.data(), {static_cast<py::ssize_t>(values.size())},
                    py::cast(&self, py::return_value_policy::reference));
}

/// A view where nothing is shifted, else sums in double.
py::object vertices(PyScan& self) {
  const rbvh::Scan& scan = self.scan();
  if (scan.shift == rbvh::Vec3d{}) return rows_view(self, scan.positions, 3);
  py::array_t<double> all({static_cast<py::ssize_t>(scan.positions.size()), py::ssize_t{3}});
  double* to = all.mutable_data();
  for (const rbvh::Vec3f& p : scan.positions)
    for (int axis = 0; axis < 3; ++axis) *to++ = static_cast<double>(p[axis]) + scan.shift[axis];
  return all;
}

py::dict properties(PyScan& self) {
  py::dict all;
  for (const rbvh::ScalarProperty& each : self.scan().properties)
    all[py::str(each.name)] = values_view(self, each.values);
  return all;
}

void save_scan(PyScan& self, const std::string& path, bool overwrite) {
  const py::gil_scoped_release released;
  if (path.ends_with(".glb"))
    rbvh::write_glb(path, self.scan(), self.asset.up_axis(), overwrite);
  else
    rbvh::write_ply(path, self.scan(), overwrite);
}

std::shared_ptr<PyScan> read(const std::string& path) {
  const py::gil_scoped_release released;
  return held(rbvh::load_scan(path, {}, check_signals()), path);
}

}  // namespace

void add_scan(py::module_& module, ScanClass& scan) {
  scan.def(py::init(&scan_of), py::arg("vertices"), py::arg("triangles") = py::none(),
           py::arg("normals") = py::none(), py::arg("colors") = py::none(), py::kw_only(),
           py::arg("radii") = py::none(), py::arg("object_ids") = py::none(),
           py::arg("properties") = std::map<std::string, py::object>{}, py::arg("units") = "",
           R"(A mesh or, without triangles, a cloud, which gets the normals and radii that it lacks.

vertices: (N, 3) float32 or float64, in whatever coordinates: large ones are shifted inside (see shift).
triangles: (M, 3) integers; corners counterclockwise, seen from the front.
normals: (N, 3). colors: (N, 3) uint8 (sRGB), or floats in [0, 1].
radii: (N,), of a cloud's discs, in units of the vertices. object_ids: (M,), or (N,) of a cloud.
properties: name: (N,), such as {"intensity": values}. units: "mm", "cm", "m", "km", "in", "ft" or "".
The arrays are copied.)");
  scan.def_property_readonly("vertices", &vertices,
                             "(N, 3): a float32 view, or float64 where coordinates are shifted inside");
  scan.def_property_readonly(
      "triangles", [](PyScan& self) { return rows_view(self, self.scan().triangles, 3); },
      "(M, 3) uint32, a view; None of a cloud");
  scan.def_property_readonly(
      "normals", [](PyScan& self) { return rows_view(self, self.scan().normals, 3); },
      "(N, 3) float32, a view; or None");
  scan.def_property_readonly(
      "colors", [](PyScan& self) { return rows_view(self, self.scan().colors, 3); },
      "(N, 3) uint8, sRGB, a view; or None");
  scan.def_property_readonly(
      "radii", [](PyScan& self) { return values_view(self, self.scan().radii); },
      "(N,) float32, a view; or None");
  scan.def_property_readonly(
      "object_ids", [](PyScan& self) { return values_view(self, self.scan().object_ids); },
      "(M,) int32, or (N,) of a cloud, a view; None: one object");
  scan.def_property_readonly("properties", &properties, "dict of (N,) float32, views");
  scan.def_property_readonly(
      "units", [](PyScan& self) { return self.scan().units; }, "as the file states them, or ''");
  scan.def("save", &save_scan, py::arg("path"), py::kw_only(), py::arg("overwrite") = false,
           "Writes binary PLY or, where the name ends in .glb, binary glTF.");
  module.def("read", &read, py::arg("path"),
             "Reads a scan of any format (PLY, OBJ, STL, OFF, PCD, PTX, LAS, glTF, XYZ) as it is: nothing is "
             "cleaned.");
}

}  // namespace rbvh_python
