// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "bindings.h"

namespace dkb::python {
namespace {

std::string shape_text(const py::array& array) {
  std::string text = "[";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text += (i > 0 ? ", " : "") + std::to_string(array.shape(i));
  return text + "]";
}

// "uint8 [480, 640, 3]"
std::string described(const py::array& array) {
  return py::str(array.dtype()).cast<std::string>() + " " + shape_text(array);
}

py::array array_of(const py::handle& object, const std::string& name, const char* expected) {
  if (!py::isinstance<py::array>(object))
    throw InputError(
        fmt::format("{}: it is of type {}; give a numpy array, {}", name, Py_TYPE(object.ptr())->tp_name, expected));
  return py::reinterpret_borrow<py::array>(object);
}

ImageView view_of(const py::array& array, PixelFormat format, const std::string& name) {
  const auto width = array.shape(1), height = array.shape(0);
  if (std::max(width, height) > 1 << 20) throw InputError(name + ": " + shape_text(array) + " is too large an image");
  ImageView view{array.data(), static_cast<int>(width), static_cast<int>(height), 0, format};
  view.stride = view.row_bytes();
  if (array.size() == 0) return view;
  // Within a row pixels must lie side by side; rows may be apart, but not upside down or on top of each other.
  const bool packed_channels = array.ndim() == 2 || array.strides(2) == array.itemsize();
  const bool packed_pixels = width == 1 || array.strides(1) == bytes_per_pixel(format);
  const bool rows_apart = height == 1 || array.strides(0) >= static_cast<py::ssize_t>(view.row_bytes());
  if (!packed_channels || !packed_pixels || !rows_apart)
    throw InputError(name + ": its rows are not contiguous; give numpy.ascontiguousarray(" + name + ")");
  if (height > 1) view.stride = static_cast<size_t>(array.strides(0));
  return view;
}

py::array_t<double> numbers_of(const py::handle& object, py::ssize_t side, const std::string& name) {
  auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw InputError(fmt::format("{}: it is no matrix of numbers; give {} x {}", name, side, side));
  }
  if (array.ndim() != 2 || array.shape(0) != side || array.shape(1) != side)
    throw InputError(fmt::format("{}: its shape is {}; it must be [{}, {}]", name, shape_text(array), side, side));
  return array;
}

}  // namespace

py::array_t<double> matrix_array(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  py::array_t<double> array({matrix.rows(), matrix.cols()});
  auto out = array.mutable_unchecked<2>();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) out(i, j) = matrix(i, j);
  return array;
}

py::array_t<double> vector_array(const Eigen::Vector3d& vector) {
  return py::array_t<double>(3, vector.data());
}

py::array_t<double> pose_array(const Rigid3& b_from_a) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = b_from_a.matrix3();
  m.topRightCorner<3, 1>() = b_from_a.translation;
  return matrix_array(m);
}

Rigid3 pose_of(const py::handle& matrix, const std::string& name) {
  const py::array_t<double> array = numbers_of(matrix, 4, name);
  const auto in = array.unchecked<2>();
  Eigen::Matrix4d m;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) m(i, j) = in(i, j);
  const Eigen::Matrix3d r = m.topLeftCorner<3, 3>();
  const Eigen::Vector3d t = m.topRightCorner<3, 1>();
  const bool rotation = (r.transpose() * r - Eigen::Matrix3d::Identity()).norm() < 1e-3 && r.determinant() > 0;
  const bool last_row = (m.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() < 1e-9;
  if (!rotation || !last_row || !t.allFinite())
    throw InputError(name + ": it is no rigid motion; give [R t; 0 0 0 1] with a rotation matrix R and t in metres");
  return {Eigen::Quaterniond(r).normalized(), t};
}

Matrix6d covariance_of(const py::handle& matrix, const std::string& name) {
  const py::array_t<double> array = numbers_of(matrix, 6, name);
  const auto in = array.unchecked<2>();
  Matrix6d m;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) m(i, j) = in(i, j);
  if (!m.allFinite()) throw InputError(name + ": it holds a number that is not finite; give variances of [m, rad]");
  // As far as sums in single precision tell.
  if ((m - m.transpose()).cwiseAbs().maxCoeff() > 1e-6 * m.cwiseAbs().maxCoeff())
    throw InputError(name + ": it is not symmetric; give a covariance matrix");
  return m;
}

ImageView colour_view(const py::handle& object, bool bgr) {
  static constexpr const char* kExpected = "uint8 of shape [H, W, 3], [H, W, 4] or, grey, [H, W]";
  const py::array array = array_of(object, "rgb", kExpected);
  const bool grey = array.ndim() == 2, colour = array.ndim() == 3 && (array.shape(2) == 3 || array.shape(2) == 4);
  if (!py::isinstance<py::array_t<uint8_t>>(array) || (!grey && !colour))
    throw InputError(fmt::format("rgb: it is {}; it must be {}", described(array), kExpected));
  if (grey) return view_of(array, PixelFormat::grey8, "rgb");
  const bool alpha = array.shape(2) == 4;
  const PixelFormat format =
      bgr ? (alpha ? PixelFormat::bgra8 : PixelFormat::bgr8) : (alpha ? PixelFormat::rgba8 : PixelFormat::rgb8);
  return view_of(array, format, "rgb");
}

ImageView depth_view(const py::handle& object) {
  static constexpr const char* kExpected = "uint16 (units of 1 / depth_factor m) or float32 (m) of shape [H, W]";
  const py::array array = array_of(object, "depth", kExpected);
  const bool units = py::isinstance<py::array_t<uint16_t>>(array), metres = py::isinstance<py::array_t<float>>(array);
  if ((!units && !metres) || array.ndim() != 2)
    throw InputError(fmt::format("depth: it is {}; it must be {}{}", described(array), kExpected,
                                 array.dtype().kind() == 'f' ? ": give depth.astype(numpy.float32)" : ""));
  return view_of(array, units ? PixelFormat::depth_u16 : PixelFormat::depth_f32, "depth");
}

py::array array_over(const py::dtype& type, const std::vector<py::ssize_t>& shape, const void* data,
                     const py::handle& owner) {
  py::array array(type, shape, data, owner);
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

py::object image_array(const ImageView& view, const py::handle& owner) {
  if (view.empty()) return py::none();
  std::vector<py::ssize_t> shape = {view.height, view.width};
  if (view.format == PixelFormat::rgb8) shape.push_back(3);
  const py::dtype type = view.format == PixelFormat::depth_f32 ? py::dtype::of<float>() : py::dtype::of<uint8_t>();
  return array_over(type, shape, view.data, owner);
}

GreyImage mask_of(const py::handle& object) {
  static constexpr const char* kExpected = "bool or uint8 of shape [H, W]";
  const py::array array = array_of(object, "mask", kExpected);
  const bool fits = py::isinstance<py::array_t<bool>>(array) || py::isinstance<py::array_t<uint8_t>>(array);
  if (!fits || array.ndim() != 2)
    throw InputError(fmt::format("mask: it is {}; it must be {}", described(array), kExpected));
  const py::array_t<uint8_t, py::array::c_style | py::array::forcecast> packed(array);
  GreyImage mask(static_cast<int>(packed.shape(1)), static_cast<int>(packed.shape(0)));
  std::transform(packed.data(), packed.data() + packed.size(), mask.data(), [](uint8_t v) { return v != 0 ? 255 : 0; });
  return mask;
}

}  // namespace dkb::python
