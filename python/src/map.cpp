// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <filesystem>

#include "bindings.h"
#include "dkb/util/files.h"

namespace dkb::python {
namespace {

// The points of a snapshot as columns.
struct Points {
  explicit Points(const MapSnapshot& map) {
    std::vector<PointInfo> points;
    {
      const Unlocked released;
      points = map.points();
    }
    const auto n = static_cast<py::ssize_t>(points.size());
    xyz = py::array_t<double>({n, py::ssize_t{3}});
    rgb = py::array_t<uint8_t>({n, py::ssize_t{3}});
    ids = py::array_t<uint32_t>(n);
    observations = py::array_t<int32_t>(n);
    maps = py::array_t<int32_t>(n);
    double* position = xyz.mutable_data();
    uint8_t* colour = rgb.mutable_data();
    for (py::ssize_t i = 0; i < n; ++i) {
      const PointInfo& point = points[static_cast<size_t>(i)];
      for (int axis = 0; axis < 3; ++axis) *position++ = point.position_in_world[axis];
      for (const uint8_t channel : {point.colour.r, point.colour.g, point.colour.b}) *colour++ = channel;
      ids.mutable_at(i) = point.id;
      observations.mutable_at(i) = point.observations;
      maps.mutable_at(i) = point.map;
    }
  }
  py::array_t<double> xyz;
  py::array_t<uint8_t> rgb;
  py::array_t<uint32_t> ids;
  py::array_t<int32_t> observations, maps;
};

py::tuple keyframe_neighbours(const KeyframeInfo& keyframe) {
  py::tuple neighbours(keyframe.covisible.size());
  for (size_t i = 0; i < keyframe.covisible.size(); ++i)
    neighbours[i] = py::make_tuple(keyframe.covisible[i].id, keyframe.covisible[i].shared_points);
  return neighbours;
}

// A mesh's vectors as arrays without copies.
template <class Scalar, class Row>
py::array rows_array(const std::vector<Row>& rows, const py::handle& owner) {
  static_assert(sizeof(Row) == 3 * sizeof(Scalar));
  return array_over(py::dtype::of<Scalar>(), {static_cast<py::ssize_t>(rows.size()), 3}, rows.data(), owner);
}

void bind_dense(py::module_& module) {
  py::class_<OccupancyGrid>(module, "OccupancyGrid", "Where a robot can drive: cells of the floor, seen from above.")
      .def_property_readonly(
          "cells",
          [](const py::object& self) {
            const GreyImage& cells = self.cast<const OccupancyGrid&>().cells;
            return array_over(py::dtype::of<uint8_t>(), {cells.height(), cells.width()}, cells.data(), self);
          },
          "uint8 [H, W]: 0 occupied, 205 unknown, 254 free; row 0 is the top, the largest y.")
      .def_readonly("cell", &OccupancyGrid::cell, "[m] side of a cell.")
      .def_property_readonly(
          "origin", [](const OccupancyGrid& g) { return py::make_tuple(g.origin_x, g.origin_y); },
          "(x, y) [m] of the lower left corner of the lower left cell, on the floor.")
      .def_property_readonly(
          "floor_from_world", [](const OccupancyGrid& g) { return pose_array(g.floor_from_world); },
          "float64 [4, 4]: z = 0 is the floor, z up.")
      .def(
          "save",
          [](const OccupancyGrid& grid, const py::object& path) {
            std::filesystem::path image = path_of(path, "path");
            if (image.extension() == ".yaml" || image.extension() == ".pgm") image.replace_extension();
            std::filesystem::path yaml = image;
            image += ".pgm", yaml += ".yaml";
            write_file_atomically(image, occupancy_pgm(grid));
            write_file_atomically(yaml, occupancy_yaml(grid, image.filename().string()));
          },
          py::arg("path"),
          "save(path)\n\nWrites path.pgm and path.yaml, which ROS' map_server reads, as `dkb-slam run --dense` does. "
          "Raises InputError when it cannot.")
      .def("__repr__", [](const OccupancyGrid& g) {
        return fmt::format("OccupancyGrid({} x {} cells of {:g} m)", g.cells.width(), g.cells.height(), g.cell);
      });
  py::class_<DenseMap>(module, "DenseMap", "The dense map of the still world: people and what they moved are left out.")
      .def_property_readonly(
          "vertices",
          [](const py::object& self) { return rows_array<float>(self.cast<const DenseMap&>().mesh.vertices, self); },
          "float32 [N, 3], [m] in the world.")
      .def_property_readonly(
          "colours",
          [](const py::object& self) { return rows_array<uint8_t>(self.cast<const DenseMap&>().mesh.colours, self); },
          "uint8 [N, 3], of the vertices.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) { return rows_array<int32_t>(self.cast<const DenseMap&>().mesh.triangles, self); },
          "int32 [M, 3], indices of vertices; seen from outside, corners run counter-clockwise.")
      .def_property_readonly(
          "grid", [](const DenseMap& map) { return map.grid; }, "OccupancyGrid, or None when no floor was found.")
      .def_readonly("views", &DenseMap::views, "int: keyframes that were fused.")
      .def(
          "to_ply", [](const DenseMap& map) { return py::bytes(mesh_ply(map.mesh)); },
          "to_ply() -> bytes\n\nThe mesh as a Stanford PLY file.")
      .def(
          "save",
          [](const DenseMap& map, const py::object& path) {
            const std::filesystem::path file = path_of(path, "path");
            if (file.extension() != ".ply")
              throw InputError(file.string() + ": the mesh is a PLY file; give a name that ends in .ply");
            const Unlocked released;
            write_file_atomically(file, mesh_ply(map.mesh));
          },
          py::arg("path"),
          "save(path)\n\nWrites to_ply(), as `dkb-slam run --dense` does; the name must end in .ply. Raises InputError "
          "when it cannot.")
      .def("__repr__", [](const DenseMap& map) {
        return fmt::format("DenseMap({} vertices, {} triangles, {})", map.mesh.vertices.size(),
                           map.mesh.triangles.size(), map.grid ? "with a grid" : "no grid");
      });
}

}  // namespace

void bind_map(py::module_& module) {
  py::class_<KeyframeInfo>(module, "Keyframe", "A frame that the map rests on.")
      .def_readonly("id", &KeyframeInfo::id, "In order of insertion, from 0.")
      .def_readonly("stamp_ns", &KeyframeInfo::stamp_ns, "[ns] of its colour image, to the microsecond.")
      .def_readonly("frame", &KeyframeInfo::frame, "Index of its frame; below 0 for a map that was loaded.")
      .def_readonly("map", &KeyframeInfo::map, "0 = the first map; maps that were not joined have worlds of their own.")
      .def_property_readonly(
          "world_from_cam", [](const KeyframeInfo& k) { return pose_array(k.world_from_cam); }, "float64 [4, 4], [m].")
      .def_property_readonly("covisible", &keyframe_neighbours,
                             "Tuple of (keyframe id, map points that both see), the most first.")
      .def("__repr__", [](const KeyframeInfo& k) {
        return fmt::format("Keyframe({}, frame {}, {} neighbours)", k.id, k.frame, k.covisible.size());
      });
  py::class_<Points>(module, "MapPoints", "The points of the still world, by id, as columns.")
      .def_readonly("xyz", &Points::xyz, "float64 [M, 3], [m] in the world.")
      .def_readonly("rgb", &Points::rgb, "uint8 [M, 3], as the keyframe that made the point sees it.")
      .def_readonly("ids", &Points::ids, "uint32 [M], lasting.")
      .def_readonly("observations", &Points::observations, "int32 [M]: keyframes that see the point.")
      .def_readonly("maps", &Points::maps, "int32 [M], as Keyframe.map: in whose world its position is.")
      .def("__repr__", [](const Points& points) { return fmt::format("MapPoints({} points)", points.ids.size()); });
  py::class_<MapSnapshot>(module, "MapSnapshot",
                          "The map at one moment, unchanged from then on however tracking goes on.")
      .def_property_readonly("point_count", &MapSnapshot::point_count)
      .def_property_readonly("keyframe_count", &MapSnapshot::keyframe_count)
      .def(
          "points", [](const MapSnapshot& map) { return Points(map); }, "points() -> MapPoints\n\nCopies.")
      .def("keyframes", &MapSnapshot::keyframes, py::call_guard<Unlocked>(), "keyframes() -> list[Keyframe]\n\nBy id.")
      .def(
          "loops",
          [](const MapSnapshot& map) {
            py::list loops;
            for (const LoopInfo& l : map.loops()) loops.append(py::make_tuple(l.keyframe, l.earlier_keyframe, l.merge));
            return loops;
          },
          "loops() -> list[tuple[int, int, bool]]\n\nKeyframes that were found to show the same place: (keyframe, "
          "earlier keyframe, whether it joined two maps), in order.")
      .def("__repr__", [](const MapSnapshot& map) {
        return fmt::format("MapSnapshot({} keyframes, {} points)", map.keyframe_count(), map.point_count());
      });
  bind_dense(module);
}

}  // namespace dkb::python
