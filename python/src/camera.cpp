// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "bindings.h"
#include "dkb/dataset/camera_file.h"
#include "dkb/util/settings.h"

namespace dkb::python {
namespace {

struct Field {
  const char* name;
  double Camera::*real;
  int Camera::*whole;
  bool required;
};
constexpr Field kFields[] = {
    {"width", nullptr, &Camera::width, true},
    {"height", nullptr, &Camera::height, true},
    {"fx", &Camera::fx, nullptr, true},
    {"fy", &Camera::fy, nullptr, true},
    {"cx", &Camera::cx, nullptr, true},
    {"cy", &Camera::cy, nullptr, true},
    {"depth_factor", &Camera::depth_factor, nullptr, true},
    {"k1", &Camera::k1, nullptr, false},
    {"k2", &Camera::k2, nullptr, false},
    {"p1", &Camera::p1, nullptr, false},
    {"p2", &Camera::p2, nullptr, false},
    {"k3", &Camera::k3, nullptr, false},
    {"k4", &Camera::k4, nullptr, false},
    {"k5", &Camera::k5, nullptr, false},
    {"k6", &Camera::k6, nullptr, false},
    {"fps", &Camera::fps, nullptr, false},
    {"readout", &Camera::readout, nullptr, false},
    {"depth_time_offset", &Camera::depth_time_offset, nullptr, false},
    {"depth_min", &Camera::depth_min, nullptr, false},
    {"depth_max", &Camera::depth_max, nullptr, false},
};

// Where the images show no world: true or above 0.
std::shared_ptr<const Image<uint8_t>> mask_from(const py::handle& value) {
  if (value.is_none()) return nullptr;
  const auto array = py::array_t<bool, py::array::c_style | py::array::forcecast>::ensure(value);
  if (!array || array.ndim() != 2) {
    PyErr_Clear();
    throw InputError("mask: it must be an array (height, width) of bool or numbers, or None");
  }
  auto mask = std::make_shared<Image<uint8_t>>(static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)));
  std::transform(array.data(), array.data() + array.size(), mask->data(), [](bool m) { return uint8_t{m} * 255; });
  return mask;
}

py::object mask_array(const Camera& camera) {
  if (!camera.mask) return py::none();
  py::array_t<bool> array({camera.mask->height(), camera.mask->width()});
  std::transform(camera.mask->data(), camera.mask->data() + camera.mask->size(), array.mutable_data(),
                 [](uint8_t m) { return m != 0; });
  return array;
}

bool same_mask(const Camera& a, const Camera& b) {
  if (a.mask == b.mask) return true;
  if (!a.mask || !b.mask || a.mask->size() != b.mask->size()) return false;
  return std::equal(a.mask->data(), a.mask->data() + a.mask->size(), b.mask->data(),
                    [](uint8_t m, uint8_t n) { return (m != 0) == (n != 0); });
}

Camera camera_from_fields(const py::kwargs& given) {
  std::vector<std::string> names = {"mask"};
  for (const Field& field : kFields) names.emplace_back(field.name);
  for (const auto& item : given) {
    const auto name = item.first.cast<std::string>();
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw InputError("Camera: there is no field \"" + name + "\"" + did_you_mean(name, names));
  }
  Camera camera;
  std::string missing;
  for (const Field& field : kFields) {
    if (!given.contains(field.name)) {
      if (field.required) missing += (missing.empty() ? "" : ", ") + std::string(field.name);
      continue;
    }
    const py::object value = given[field.name];
    if (field.real != nullptr)
      camera.*field.real = argument<double>(value, field.name, "a number");
    else
      camera.*field.whole = argument<int>(value, field.name, "a whole number");
  }
  if (!missing.empty()) throw InputError("Camera: missing: " + missing);
  if (given.contains("mask")) camera.mask = mask_from(given["mask"]);
  camera.check();
  return camera;
}

std::string camera_repr(const Camera& camera) {
  const Camera usual;
  std::string text = "Camera(";
  for (const Field& field : kFields) {
    if (!field.required && camera.*field.real == usual.*field.real) continue;
    if (text.back() != '(') text += ", ";
    text += field.real != nullptr ? fmt::format("{}={}", field.name, camera.*field.real)
                                  : fmt::format("{}={}", field.name, camera.*field.whole);
  }
  return text + (camera.mask ? ", mask=...)" : ")");
}

}  // namespace

void check_same_view(const Camera& of_frame, const Camera& wanted) {
  if (&of_frame == &wanted) return;
  std::string of, here;
  for (const Field& field : kFields) {
    const std::string name = field.name;
    if (name == "depth_factor" || name == "depth_min" || name == "depth_max" || name == "fps" || name == "readout" ||
        name == "depth_time_offset")
      continue;  // its depth is in metres already
    const auto value = [&field](const Camera& c) { return field.real != nullptr ? c.*field.real : c.*field.whole; };
    if (value(of_frame) == value(wanted)) continue;
    of += fmt::format("{}{} {}", of.empty() ? "" : ", ", name, value(of_frame));
    here += fmt::format("{}{} {}", here.empty() ? "" : ", ", name, value(wanted));
  }
  if (!of.empty())
    throw InputError(
        fmt::format("frame: was made with another camera ({}) than the Slam ({}); make both with one", of, here));
}

void bind_camera(py::module_& module) {
  py::class_<Camera> camera(module, "Camera", R"(Camera(*, width, height, fx, fy, cx, cy, depth_factor, **optional)

Pinhole camera with distortion (Brown-Conrady, or OpenCV's rational model), and the depth format that comes with it.
Immutable.

Axes: x right, y down, z forward. The centre of the top-left pixel is (0, 0). Depth is registered to the colour camera.

width, height: [px]; fx, fy, cx, cy: [px]; depth_factor: [units per metre] of integer depth images.
Optional: k1, k2, p1, p2, k3, k4, k5, k6 (distortion, in OpenCV's order), fps [1/s] (0 = as the first five stamps say),
readout [s] of a rolling shutter, from the first row's exposure to the last row's (below 0 where the image is upside down;
0 = unknown or none), depth_time_offset [s] (added to a depth image's stamp: when the colour camera saw the same),
depth_min, depth_max [m] (depth outside is taken for missing), mask: array (height, width), true or above 0 where every
image shows the robot itself, dirt on the lens or writing: no features and no depth are taken from there.

Raises InputError naming the field that is missing, unknown or out of range.)");
  camera
      .def(py::init([](const py::args& args, const py::kwargs& given) {
        if (!args.empty())
          throw py::type_error("Camera: give every field by name: Camera(width=640, height=480, fx=...)");
        return camera_from_fields(given);
      }))
      .def_static("named", &Camera::named, py::arg("name"),
                  "named(name: str) -> Camera\n\nA camera that is known by name: fr1, fr2, fr3 (TUM RGB-D), bonn. "
                  "Raises InputError naming the nearest one.")
      .def_static(
          "load", [](const py::object& path) { return Camera::load(path_of(path, "path")); }, py::arg("path"),
          "load(path) -> Camera\n\nReads a camera file (YAML). Raises InputError with file and line.")
      .def("to_yaml", &Camera::to_yaml, "to_yaml() -> str\n\nThe camera file's text, every field with its unit.")
      .def("__repr__", &camera_repr)
      .def("__eq__",
           [](const Camera& a, const py::object& other) {
             if (!py::isinstance<Camera>(other)) return false;
             const auto& b = other.cast<const Camera&>();
             return a.to_yaml() == b.to_yaml() && same_mask(a, b);
           })
      .def("__hash__", [](const Camera& c) { return py::hash(py::str(c.to_yaml())); })
      .def(py::pickle([](const Camera& c) { return py::make_tuple(c.to_yaml(), mask_array(c)); },
                      [](const py::tuple& state) {
                        Camera c = parse_camera(state[0].cast<std::string>(), "Camera");
                        c.mask = mask_from(state[1]);
                        return c;
                      }))
      .def_property_readonly("mask", &mask_array);
  for (const Field& field : kFields)
    camera.def_property_readonly(field.name, [field](const Camera& c) {
      return field.real != nullptr ? py::object(py::float_(c.*field.real)) : py::object(py::int_(c.*field.whole));
    });
}

}  // namespace dkb::python
