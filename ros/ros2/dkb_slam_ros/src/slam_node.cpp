// SPDX-License-Identifier: Apache-2.0
#include "slam_component.h"

int main(int argc, char** argv) {
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
