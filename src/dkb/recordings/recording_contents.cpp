// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recording_contents.h"

#include <algorithm>

#include "dkb/dataset/camera_file.h"
#include "dkb/recordings/recorded_camera.h"
#include "dkb/recordings/recording_survey.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

std::string size_text(const RecordedImageTopic& topic) {
  return std::to_string(topic.width) + "x" + std::to_string(topic.height);
}

// "/a (rgb8), /b (16UC1)"
std::string listed(const std::vector<const RecordedImageTopic*>& topics) {
  std::string text;
  for (const RecordedImageTopic* t : topics) text += (text.empty() ? "" : ", ") + t->name + " (" + t->encoding + ")";
  return text;
}

std::string names_of(const std::map<std::string, std::string>& topics) {
  std::string text;
  for (const auto& [name, frame] : topics) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// A topic that nothing would be read from is refused.
void check_motion_topics(const SourceOptions& options) {
  const bool odom = !options.odom_topic.empty(), imu = !options.imu_topic.empty();
  const auto refuse = [](const std::string& option, const std::string& why) {
    throw InputError(option + ": " + why + "; leave one of them out");
  };
  if (odom && imu) refuse("--odom-topic " + options.odom_topic, "--imu-topic names another motion, and one is used");
  const std::string given = odom ? "--odom-topic " + options.odom_topic : "--imu-topic " + options.imu_topic;
  if (options.prior == PriorKind::none && (odom || imu)) refuse(given, "--prior none reads no topic");
  if (options.prior == PriorKind::odometry && imu) refuse(given, "--prior odom reads no inertial unit");
  if (options.prior == PriorKind::imu && odom) refuse(given, "--prior imu reads no odometry");
}

class Chooser {
 public:
  Chooser(const RecordingSurvey& survey, const SourceOptions& options, const std::string& name)
      : survey_(survey), options_(options), name_(name) {}

  RecordingContents choose() {
    made_.colour = images(ImageContent::colour, options_.colour_topic, "--colour-topic", "colour",
                          "rgb8, bgr8, rgba8, bgra8, mono8, bayer_*8, jpeg, png");
    made_.depth = images(ImageContent::depth, options_.depth_topic, "--depth-topic", "depth",
                         "16UC1, mono16, 32FC1, compressedDepth");
    choose_camera();
    choose_registration();
    choose_motion();
    made_.stamped = made_.colour.stamped && made_.depth.stamped;
    if (!made_.stamped)
      made_.warnings.push_back(name_ + ": its images carry no stamps; the time of their recording stands in");
    return std::move(made_);
  }

 private:
  RecordedImageTopic images(ImageContent content, const std::string& picked, const std::string& option,
                            const std::string& kind, const std::string& encodings) const {
    std::vector<const RecordedImageTopic*> all, fitting;
    for (const RecordedImageTopic& topic : survey_.images) {
      all.push_back(&topic);
      if (topic.content == content && (picked.empty() || topic.name == picked)) fitting.push_back(&topic);
    }
    // 8UC1 and the like do not say what they show, which may be infrared or a mask: only where nothing else is there.
    const auto untold = [](const RecordedImageTopic* topic) { return topic->encoding.starts_with("8UC"); };
    if (picked.empty() && !std::all_of(fitting.begin(), fitting.end(), untold)) std::erase_if(fitting, untold);
    const std::string there = all.empty() ? "no images at all" : "images on " + listed(all);
    if (!picked.empty() && fitting.empty())
      throw InputError(option + " " + picked + ": " + name_ + " has no " + kind + " images there; it has " + there);
    if (fitting.empty())
      throw InputError(name_ + ": has no " + kind + " images (" + encodings + "); it has " + there +
                       (survey_.first_failure.empty() ? "" : "; " + survey_.first_failure));
    if (fitting.size() > 1)
      throw InputError(name_ + ": has several topics of " + kind + " images: " + listed(fitting) + "; pick one with " +
                       option);
    return *fitting.front();
  }

  const CameraInfoMessage* info(const std::string& topic) const {
    const auto found = survey_.infos.find(topic);
    return found == survey_.infos.end() ? nullptr : &found->second;
  }

  // That of the colour images: by the option, the namespace, or the only one with their frame_id.
  std::string colour_info_topic() const {
    if (!options_.info_topic.empty()) {
      if (info(options_.info_topic) == nullptr)
        throw InputError("--info-topic " + options_.info_topic + ": " + name_ + " has no CameraInfo there" +
                         infos_there());
      return options_.info_topic;
    }
    if (const std::string near = info_topic_of(made_.colour.name); info(near) != nullptr) return near;
    std::vector<std::string> of_frame;
    for (const auto& [topic, message] : survey_.infos)
      if (!made_.colour.frame_id.empty() && frame_name(message.header.frame_id) == made_.colour.frame_id)
        of_frame.push_back(topic);
    if (of_frame.size() > 1)
      throw InputError(name_ + ": has several topics of CameraInfo for the frame " + made_.colour.frame_id +
                       infos_there() + "; pick one with --info-topic");
    return of_frame.empty() ? "" : of_frame.front();
  }

  std::string infos_there() const {
    std::string text;
    for (const auto& [topic, message] : survey_.infos) text += (text.empty() ? "; it has " : ", ") + topic;
    return text;
  }

  void choose_camera() {
    // What --camera says goes before all else, so that a wrong CameraInfo is no hindrance.
    if (!options_.camera.empty()) {
      const CameraChoice choice = dkb::choose_camera(options_.camera, "");
      made_.camera = choice.camera, made_.camera_origin = choice.origin;
      if (!options_.info_topic.empty()) colour_info_topic();  // depth is compared with it; it must be there
      if (!choice.doubt.empty()) made_.warnings.push_back(choice.doubt);
      return;
    }
    if (survey_.camera_file && options_.info_topic.empty()) {
      made_.camera_origin = "of " + survey_.camera_file_origin;
      made_.camera = parse_camera(*survey_.camera_file, name_ + ": " + survey_.camera_file_origin);
      return;
    }
    if (const std::string topic = colour_info_topic(); !topic.empty()) {
      made_.camera = camera_of(*info(topic), is_rectified(made_.colour.name), name_ + ": " + topic);
      made_.camera_origin = "of " + topic;
      return;
    }
    if (!options_.fallback_camera)
      throw InputError(name_ + ": the camera is not known: no CameraInfo belongs to " + made_.colour.name +
                       infos_there() +
                       (survey_.infos.empty() ? "; give --camera FILE, or fr1, fr2, fr3, bonn"
                                              : "; pick one with --info-topic, or give --camera FILE"));
    made_.camera = *options_.fallback_camera, made_.camera_origin = "of the map";
  }

  // What depth is to be compared with: as the recording itself speaks of the colour camera, where it does.
  Camera colour_view() const {
    const CameraInfoMessage* message =
        info(options_.info_topic.empty() ? info_topic_of(made_.colour.name) : options_.info_topic);
    if (message == nullptr || message->k[0] == 0) return made_.camera;
    try {
      return camera_of(*message, is_rectified(made_.colour.name), "");
    } catch (const InputError&) {
      return made_.camera;
    }
  }

  void choose_registration() {
    const RecordedImageTopic &colour = made_.colour, &depth = made_.depth;
    const std::string info_topic = info_topic_of(depth.name);
    const CameraInfoMessage* message = info(info_topic);
    if (message != nullptr && message->k[0] == 0 && message->p[0] == 0) message = nullptr;  // not calibrated
    std::optional<Camera> depth_camera;
    std::string why_not = message == nullptr ? "there is no CameraInfo on " + info_topic : "";
    if (message != nullptr) try {
        depth_camera = camera_of(*message, is_rectified(depth.name), info_topic);
      } catch (const InputError& e) {
        why_not = e.what();
      }
    const bool frames_differ = !colour.frame_id.empty() && !depth.frame_id.empty() && colour.frame_id != depth.frame_id;
    const std::optional<Rigid3> colour_from_depth = survey_.transforms.find(colour.frame_id, depth.frame_id);
    const bool moved = frames_differ && !(colour_from_depth && colour_from_depth->translation.norm() < 1e-9 &&
                                          colour_from_depth->rotation.vec().norm() < 1e-9);
    const bool other_view = depth_camera && !same_view(*depth_camera, colour_view());
    const bool other_size = depth.width != colour.width || depth.height != colour.height;
    if (!moved && !other_view && !other_size) return;
    if (why_not.empty() && !colour_from_depth)
      why_not = colour.frame_id.empty() || depth.frame_id.empty()
                    ? "their headers name no frames"
                    : "/tf_static does not link " + depth.frame_id + " with " + colour.frame_id;
    if (!why_not.empty())
      throw InputError(name_ + ": depth on " + depth.name + " (" + size_text(depth) +
                       ") is not registered to the colour images on " + colour.name + " (" + size_text(colour) +
                       "), and cannot be: " + why_not +
                       "; record registered depth (depth_registered, aligned_depth_to_color), or CameraInfo and "
                       "/tf_static as well");
    made_.depth_camera = {*depth_camera, *colour_from_depth};
  }

  // Empty: there is none, or none that could be chosen without being asked for.
  std::string motion_topic(const std::map<std::string, std::string>& topics, const std::string& picked,
                           const std::string& option, const std::string& kind, bool asked) {
    if (!picked.empty()) {
      if (!topics.contains(picked))
        throw InputError(option + " " + picked + ": " + name_ + " has no " + kind + " there" +
                         (topics.empty() ? "" : "; it has " + names_of(topics)));
      return picked;
    }
    if (topics.size() == 1) return topics.begin()->first;
    if (asked && topics.empty())
      throw InputError(name_ + ": has no " + kind + "; leave --prior out, or give --prior-file FILE");
    if (topics.empty()) return "";
    const std::string several =
        name_ + ": has several topics of " + kind + ": " + names_of(topics) + "; pick one with " + option;
    if (asked) throw InputError(several);
    made_.warnings.push_back(several);
    return "";
  }

  void choose_motion() {
    const PriorKind prior = options_.prior;
    if (prior == PriorKind::none) return;
    if (prior != PriorKind::imu && options_.imu_topic.empty())
      take_motion(motion_topic(survey_.odometries, options_.odom_topic, "--odom-topic", "nav_msgs/Odometry",
                               prior == PriorKind::odometry),
                  false);
    if (made_.motion || prior == PriorKind::odometry) return;
    if (survey_.without_rates.contains(options_.imu_topic))
      throw InputError("--imu-topic " + options_.imu_topic + ": tells no angular rates (covariance -1); pick another");
    take_motion(motion_topic(survey_.inertial, options_.imu_topic, "--imu-topic", "sensor_msgs/Imu with angular rates",
                             prior == PriorKind::imu),
                true);
  }

  // Unless it is not linked with the camera, and nobody asked for it.
  void take_motion(const std::string& topic, bool inertial) {
    if (topic.empty()) return;
    RecordedMotionTopic motion{topic, inertial, {}};
    const std::string body = frame_name((motion.inertial ? survey_.inertial : survey_.odometries).at(motion.name));
    const std::string unlinked = name_ + ": /tf_static does not link the frame of " + motion.name + " (" + body +
                                 ") with the camera's (" + made_.colour.frame_id + "); ";
    if (const auto body_from_cam = survey_.transforms.find(body, made_.colour.frame_id)) {
      motion.body_from_cam = *body_from_cam;
    } else if (options_.prior == PriorKind::automatic && options_.odom_topic.empty() && options_.imu_topic.empty()) {
      // A body's axes seldom are the camera's: such a prior would mislead.
      made_.warnings.push_back(unlinked + "the motion is left out; --prior " + (motion.inertial ? "imu" : "odom") +
                               " takes it for the camera's own");
      return;
    } else {
      made_.warnings.push_back(unlinked + "the motion is taken for the camera's own");
    }
    made_.motion = motion;
  }

  const RecordingSurvey& survey_;
  const SourceOptions& options_;
  const std::string& name_;
  RecordingContents made_;
};

}  // namespace

RecordingContents look_into(MessageStream& stream, const SourceOptions& options, const std::string& name) {
  check_motion_topics(options);
  RecordingSurvey survey;
  survey.read(stream, options);
  RecordingContents contents;
  try {
    contents = Chooser(survey, options, name).choose();
  } catch (const InputError& e) {  // damage may be why: a recording cut short shows less than it had
    const std::vector<std::string> warnings = stream.take_warnings();
    if (warnings.empty()) throw;
    throw InputError(std::string(e.what()) + " (" + warnings.front() + ")");
  }
  std::vector<std::string> names{contents.colour.name, contents.depth.name};
  if (contents.motion) names.push_back(contents.motion->name);
  stream.select(names);
  stream.rewind();
  return contents;
}

}  // namespace dkb
