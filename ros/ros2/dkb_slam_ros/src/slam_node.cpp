// SPDX-License-Identifier: Apache-2.0
#include <malloc.h>

#include "slam_component.h"

int main(int argc, char** argv) {
#ifdef __GLIBC__
  // Images come and go 30 times a second: their memory is kept, or half of what they cost would be page faults.
  mallopt(M_MMAP_THRESHOLD, 64 << 20);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
#endif
  rclcpp::init(argc, argv);
  int code = 0;
  try {
    rclcpp::spin(std::make_shared<dkb_slam_ros::SlamComponent>(rclcpp::NodeOptions()));
  } catch (const std::exception& error) {  // of bad parameters: dkb::InputError and several of rclcpp's
    RCLCPP_FATAL(rclcpp::get_logger("dkb_slam"), "%s", error.what());
    code = 2;
  }
  rclcpp::shutdown();
  return code;
}
