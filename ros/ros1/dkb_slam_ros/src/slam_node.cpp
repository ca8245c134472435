// SPDX-License-Identifier: Apache-2.0
#include <malloc.h>

#include "slam_wrapper.h"

int main(int argc, char** argv) {
#ifdef __GLIBC__
  // Images come and go 30 times a second: their memory is kept, or half of what they cost would be page faults.
  mallopt(M_MMAP_THRESHOLD, 64 << 20);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
#endif
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
