// SPDX-License-Identifier: Apache-2.0
#include <nodelet/nodelet.h>
#include <pluginlib/class_list_macros.hpp>

#include "slam_wrapper.h"

namespace dkb_slam_ros {

class SlamNodelet final : public nodelet::Nodelet {
  void onInit() override {
    try {
      slam_.emplace(getNodeHandle(), getPrivateNodeHandle());
    } catch (const dkb::InputError& error) {
      NODELET_FATAL("%s", error.what());
    }
  }

  std::optional<SlamWrapper> slam_;
};

}  // namespace dkb_slam_ros

PLUGINLIB_EXPORT_CLASS(dkb_slam_ros::SlamNodelet, nodelet::Nodelet)
