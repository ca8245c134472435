// SPDX-License-Identifier: Apache-2.0
#include "slam_wrapper.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "dkb_slam");
  const ros::NodeHandle nh;  // outlives the message about a bad parameter, which is not shown otherwise
  try {
    const dkb_slam_ros::SlamWrapper slam(nh, ros::NodeHandle("~"));
    ros::waitForShutdown();
  } catch (const dkb::InputError& error) {
    ROS_FATAL("%s", error.what());
    return 2;
  }
  return 0;
}
