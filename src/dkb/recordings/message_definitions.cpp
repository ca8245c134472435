// SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include "dkb/recordings/ros_messages.h"

namespace dkb {
namespace {

struct Definition {
  const char* md5sum;  // of the types that stand on a topic of ours
  const char* fields;
};

const std::map<std::string, Definition>& definitions() {
  static const std::map<std::string, Definition> all = {
      {"std_msgs/Header", {"", "uint32 seq\ntime stamp\nstring frame_id\n"}},
      {"std_msgs/String", {"992ce8a1687cec8c8bd883ec73ca41d1", "string data\n"}},
      {"geometry_msgs/Point", {"", "float64 x\nfloat64 y\nfloat64 z\n"}},
      {"geometry_msgs/Vector3", {"", "float64 x\nfloat64 y\nfloat64 z\n"}},
      {"geometry_msgs/Quaternion", {"", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"}},
      {"geometry_msgs/Pose", {"", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"}},
      {"geometry_msgs/PoseWithCovariance", {"", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"}},
      {"geometry_msgs/Twist", {"", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"}},
      {"geometry_msgs/TwistWithCovariance", {"", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"}},
      {"geometry_msgs/Transform", {"", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"}},
      {"geometry_msgs/TransformStamped",
       {"", "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"}},
      {"geometry_msgs/PoseStamped",
       {"d3812c3cbc69362b77dc0b19b345f8f5", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"}},
      {"nav_msgs/Path",
       {"6227e2b7e9cce15051f669a5e197bbf7", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"}},
      {"nav_msgs/Odometry",
       {"cd5e73d190d741a2f92e81eda573aca7",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist\n"}},
      {"tf2_msgs/TFMessage", {"94810edda583a504dfda3829e70d7eec", "geometry_msgs/TransformStamped[] transforms\n"}},
      {"sensor_msgs/Image",
       {"060021388200f6f0f447d0fcd9c64743",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
        "uint8[] data\n"}},
      {"sensor_msgs/CompressedImage",
       {"8f7a12909da2c9d3332d540a0977563f", "std_msgs/Header header\nstring format\nuint8[] data\n"}},
      {"sensor_msgs/RegionOfInterest",
       {"", "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"}},
      {"sensor_msgs/CameraInfo",
       {"c9a58c1b0b154e0e6da7578cb991d214",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] D\nfloat64[9] K\n"
        "float64[9] R\nfloat64[12] P\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"}},
      {"sensor_msgs/Imu",
       {"6a62c6daae103f4ff57a132d6f95cec2",
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"}},
      {"sensor_msgs/PointField",
       {"",
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n"
        "uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"}},
      {"sensor_msgs/PointCloud2",
       {"1158d486dd51d683ce2f1be655c3c181",
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
        "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"}},
  };
  return all;
}

}  // namespace

bool has_definition(const std::string& type) {
  const auto found = definitions().find(type);
  return found != definitions().end() && *found->second.md5sum != '\0';
}

MessageDefinition message_definition(const std::string& type) {
  const auto& all = definitions();
  MessageDefinition definition{all.at(type).md5sum, all.at(type).fields};
  std::set<std::string> told = {type};
  const std::function<void(const std::string&)> add_types_in = [&](const std::string& fields) {
    std::istringstream lines(fields);
    for (std::string line; std::getline(lines, line);) {
      const std::string used = line.substr(0, line.find_first_of("[ "));
      const auto found = all.find(used);
      if (found == all.end() || !told.insert(used).second) continue;
      definition.text += std::string(80, '=') + "\nMSG: " + used + "\n" + found->second.fields;
      add_types_in(found->second.fields);
    }
  };
  add_types_in(all.at(type).fields);
  return definition;
}

}  // namespace dkb
