// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <cmath>

#include "bindings.h"
#include "dkb/dataset/movers_file.h"

namespace dkb::python {
namespace {

py::tuple box_tuple(const Box& box) {
  return py::make_tuple(box.x, box.y, box.w, box.h);
}

std::string repr_of(const Detection& d) {
  return fmt::format("Detection(\"{}\", x={:.1f}, y={:.1f}, w={:.1f}, h={:.1f}, score={:.2f})", d.class_name, d.box.x,
                     d.box.y, d.box.w, d.box.h, d.score);
}

Detection detection_of(const std::string& class_name, float x, float y, float w, float h, float score) {
  if (class_name.empty()) throw InputError("Detection: class_name is empty; name what it is");
  for (const float number : {x, y, w, h})
    if (!std::isfinite(number))
      throw InputError(fmt::format("Detection: x={}, y={}, w={}, h={} are not all finite", x, y, w, h));
  if (!(w > 0 && h > 0))
    throw InputError(fmt::format("Detection: w={}, h={}; give the size, above 0, not the other corner", w, h));
  if (!(score >= 0 && score <= 1)) throw InputError(fmt::format("Detection: score={}; it must be 0 ... 1", score));
  return {class_name, {x, y, w, h}, score};
}

std::string at_text(const Eigen::Vector3d& p) {
  return fmt::format("({:.3f}, {:.3f}, {:.3f}) m", p.x(), p.y(), p.z());
}

std::string repr_of(const PyResult& result) {
  const FrameResult& r = result.r;
  std::string text = fmt::format("FrameResult(frame {}, {}", r.frame, name_of(r.state));
  if (r.world_from_cam) text += fmt::format(" at {}, {} inliers", at_text(r.world_from_cam->translation), r.inliers);
  if (r.keyframe) text += ", keyframe";
  if (!r.movers.empty()) text += fmt::format(", {} movers", r.movers.size());
  return text + ")";
}

// The mask's cells as pixels of the image.
py::array_t<bool> mover_mask_array(const PyResult& result) {
  py::array_t<bool> array({result.height, result.width});
  bool* out = array.mutable_data();
  const MoverMask& mask = result.r.mask;
  std::fill(out, out + array.size(), false);
  for (int y = 0; y < result.height && !mask.empty(); ++y) {
    const int row = y / mask.cell;
    if (row >= mask.cells.height()) break;
    for (int x = 0; x < result.width && x / mask.cell < mask.cells.width(); ++x)
      out[static_cast<size_t>(y) * static_cast<size_t>(result.width) + static_cast<size_t>(x)] =
          mask.cells(x / mask.cell, row) != 0;
  }
  return array;
}

void bind_parts(py::module_& module) {
  py::class_<Detection>(module, "Detection", R"(Detection(class_name, x, y, w, h, score=1.0)

One object that may move. x, y: top-left corner; w, h: size above 0, all in [px] of the original image. score: 0 ... 1.
Raises InputError for what is no box.)")
      .def(py::init(&detection_of), py::arg("class_name"), py::arg("x"), py::arg("y"), py::arg("w"), py::arg("h"),
           py::arg("score") = 1.0F)
      .def_readonly("class_name", &Detection::class_name)
      .def_readonly("score", &Detection::score)
      .def_property_readonly(
          "box", [](const Detection& d) { return box_tuple(d.box); }, "(x, y, w, h) [px]")
      .def("__repr__", [](const Detection& d) { return repr_of(d); });

  py::class_<Mover>(module, "Mover", "Something that moves by itself, as seen in one frame.")
      .def_readonly("id", &Mover::id, "The same in all frames of one run, from 1.")
      .def_readonly("class_name", &Mover::class_name, "The detector's; \"object\" when no detector knows it.")
      .def_property_readonly(
          "position_in_world", [](const Mover& m) { return vector_array(m.position_in_world); },
          "float64 [3], [m]: median of its visible surface.")
      .def_property_readonly(
          "velocity_in_world", [](const Mover& m) { return vector_array(m.velocity_in_world); }, "float64 [3], [m/s].")
      .def_readonly("position_sd", &Mover::position_sd, "[m] standard deviation of each coordinate of the position.")
      .def_property_readonly("velocity_sd", &velocity_sd,
                             "[m/s] standard deviation of each coordinate of the velocity, as movers.csv has it.")
      .def_property_readonly(
          "covariance", [](const Mover& m) { return matrix_array(m.covariance); },
          "float64 [6, 6] of [position m, velocity m/s] in the world.")
      .def_property_readonly(
          "size", [](const Mover& m) { return vector_array(m.size); },
          "float64 [3], [m]: visible width, height, depth, along the camera's axes.")
      .def_property_readonly(
          "box", [](const Mover& m) { return box_tuple(m.box); }, "(x, y, w, h) [px]")
      .def("__repr__", [](const Mover& m) {
        return fmt::format("Mover({}, \"{}\" at {}, {:.2f} m/s)", m.id, m.class_name, at_text(m.position_in_world),
                           m.velocity_in_world.norm());
      });

  py::class_<Event>(module, "Event", "Something that happened.")
      .def_property_readonly(
          "kind", [](const Event& e) { return name_of(e.kind); },
          "\"keyframe\", \"loop\", \"merge\", \"lost\", \"found\", \"new_map\" or \"warning\".")
      .def_readonly("frame", &Event::frame, "Index of the frame it came with.")
      .def_readonly("stamp_ns", &Event::stamp_ns, "[ns] of that frame.")
      .def_readonly("keyframe", &Event::keyframe, "Of keyframe, loop and merge; else -1.")
      .def_readonly("text", &Event::text, "One line for people, may be empty.")
      .def("__repr__", [](const Event& e) {
        return fmt::format("Event({}, frame {}{})", name_of(e.kind), e.frame, e.text.empty() ? "" : ": " + e.text);
      });
}

}  // namespace

void bind_results(py::module_& module) {
  bind_parts(module);
  PYBIND11_NUMPY_DTYPE_EX(FeatureReport, image_x, "x", image_y, "y", state, "state", reason, "reason");
  py::tuple states(4), reasons(4);
  for (size_t i = 0; i < 4; ++i) {
    states[i] = name_of(static_cast<FeatureState>(i));
    reasons[i] = name_of(static_cast<FeatureReason>(i));
  }
  module.attr("FEATURE_STATES") = states;
  module.attr("FEATURE_REASONS") = reasons;

  const auto pose = [](std::optional<Rigid3> FrameResult::*member) {
    return [member](const PyResult& p) { return array_or_none(p.r.*member, pose_array); };
  };
  py::class_<PyResult>(module, "FrameResult", R"(Everything of one frame, as Slam.process() returns it.

Poses are float64 [4, 4] matrices [R t; 0 0 0 1], t in [m], or None where there is none: b_from_a maps a point given in
frame a to frame b. Camera axes: x right, y down, z forward. World: the first tracked camera.)")
      .def_property_readonly(
          "frame", [](const PyResult& p) { return p.r.frame; }, "int: counts the frames that were accepted, from 0.")
      .def_property_readonly(
          "stamp_ns", [](const PyResult& p) { return p.r.stamp_ns; }, "int: the input's, [ns].")
      .def_property_readonly(
          "state", [](const PyResult& p) { return name_of(p.r.state); },
          "\"initialising\", \"tracking\", \"lost\", \"relocalised\", \"paused\" or "
          "\"predicted\" (by a motion prior or by depth alone).")
      .def_property_readonly(
          "tracked", [](const PyResult& p) { return p.r.tracked(); }, "bool: there is a pose.")
      .def_property_readonly("world_from_cam", pose(&FrameResult::world_from_cam), "float64 [4, 4] or None: the pose.")
      .def_property_readonly("odom_from_cam", pose(&FrameResult::odom_from_cam),
                             "float64 [4, 4] or None: smooth, does not jump when the map is corrected; steer by this.")
      .def_property_readonly(
          "ambiguous", [](const PyResult& p) { return p.r.ambiguous; },
          "bool: lost, though the map has a place that looks like this one: it may be another. More views decide.")
      .def_property_readonly(
          "world_from_odom", [](const PyResult& p) { return pose_array(p.r.world_from_odom); },
          "float64 [4, 4]: takes the jumps; world_from_cam = world_from_odom @ odom_from_cam.")
      .def_property_readonly(
          "covariance", [](const PyResult& p) { return array_or_none(p.r.covariance, matrix_array); },
          "float64 [6, 6] or None: right perturbation of world_from_cam, [translation m, rotation rad], camera axes.")
      .def_property_readonly(
          "inliers", [](const PyResult& p) { return p.r.inliers; }, "int: map points that the pose rests on.")
      .def_property_readonly(
          "refused_inliers", [](const PyResult& p) { return p.r.refused_inliers; },
          "int: without a pose by the images, map points that agree with the best one that was found and refused.")
      .def_property_readonly(
          "with_depth", [](const PyResult& p) { return p.r.with_depth; },
          "int: features with depth, those on movers left out: a map begins with them.")
      .def_property_readonly(
          "reference_keyframe", [](const PyResult& p) { return p.r.reference_keyframe; },
          "int: the keyframe that shows most of them; -1 = none.")
      .def_property_readonly(
          "map", [](const PyResult& p) { return p.r.map; },
          "int: 0 = the first map. Another one that was never joined with it has a world of its own.")
      .def_property_readonly(
          "movers", [](const PyResult& p) { return p.r.movers; },
          "list of Mover: what moves by itself in this frame, by id.")
      .def_property_readonly(
          "detections", [](const PyResult& p) { return p.r.detections; },
          "list of Detection: boxes of the detectors, carried to this image.")
      .def_property_readonly("mask", &mover_mask_array,
                             "bool [H, W], pixels of the image: True where movers are. Made at each access.")
      .def_property_readonly(
          "features",
          [](const py::object& self) {
            const std::vector<FeatureReport>& features = self.cast<const PyResult&>().r.features;
            return array_over(py::dtype::of<FeatureReport>(), {static_cast<py::ssize_t>(features.size())},
                              features.data(), self);
          },
          R"(Structured array [N] without a copy, read-only: every feature that was extracted.

Fields: x, y (float32, [px] of the original image), state (uint8, index into FEATURE_STATES), reason (uint8, index into
FEATURE_REASONS: why it was rejected).)")
      .def_property_readonly(
          "keyframe", [](const PyResult& p) { return p.r.keyframe; }, "bool: the frame became a keyframe.")
      .def_property_readonly(
          "keyframe_explanation", [](const PyResult& p) { return p.r.keyframe_explanation; },
          "str: why, or why not; empty unless Slam.explain_keyframes(True).")
      .def_property_readonly(
          "tracking_ms", [](const PyResult& p) { return p.r.tracking_ms; },
          "float: [ms] steady clock, own work on this frame.")
      .def_property_readonly(
          "waiting_ms", [](const PyResult& p) { return p.r.waiting_ms; }, "float: [ms] for mapping and the detector.")
      .def("__repr__", [](const PyResult& p) { return repr_of(p); });
}

}  // namespace dkb::python
