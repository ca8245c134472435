#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Both launch files give the node the same parameters and topics for the same arguments."""

import os
import sys

from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "dkb_slam_ros", "launch")
ARGUMENTS = ["camera:=/c", "handheld:=true", "base_frame:=robot", "publish_odom_tf:=false", "odom_prior:=/wheels",
             "imu:=/gyro", "rviz:=true"]


def node_of(name):
    config = ROSLaunchConfig()
    XmlLoader().load(os.path.join(FOLDER, name), config, argv=ARGUMENTS, verbose=False)
    parameters = {key: parameter.value for key, parameter in config.params.items()}
    topics = sorted(tuple(pair) for node in config.nodes if node.name == "dkb_slam" for pair in node.remap_args)
    return parameters, topics, any(node.name == "rviz" for node in config.nodes)


process, nodelet = node_of("rgbd.launch"), node_of("nodelet.launch")
if process != nodelet:
    sys.exit(f"FAILED: rgbd.launch and nodelet.launch differ:\n{process}\n{nodelet}")
