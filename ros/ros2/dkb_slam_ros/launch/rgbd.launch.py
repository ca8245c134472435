# SPDX-License-Identifier: Apache-2.0
"""A camera on a robot whose mount is in TF:  ros2 launch dkb_slam_ros rgbd.launch.py camera:=/camera/camera
A camera in the hand, without TF:          ros2 launch dkb_slam_ros rgbd.launch.py handheld:=true
In the camera's container, without copies: ros2 launch dkb_slam_ros rgbd.launch.py container:=/camera_container
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LoadComposableNodes, Node
from launch_ros.descriptions import ComposableNode
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = {
    "camera": ("/camera/camera", "namespace of the camera's topics"),
    "rgb": ("color/image_raw", "colour image, under `camera` unless it begins with /"),
    "depth": ("aligned_depth_to_color/image_raw", "depth image, registered to the colour image"),
    "info": ("color/camera_info", "the colour camera's calibration"),
    "odom_prior": ("odom_prior", "wheel odometry"),
    "imu": ("imu", "gyroscope"),
    "base_frame": ("base_link", "frame of the robot"),
    "handheld": ("false", "no TF: the base is the camera, x forward, y left, z up"),
    "publish_odom_tf": ("true", "false where the robot sends odom -> base"),
    "use_sim_time": ("false", "take the time from /clock"),
    "params": ("", "parameter file; empty = the one that comes with the package"),
    "container": ("", "component container to be loaded into; empty = a process of its own"),
    "rviz": ("false", "show it"),
}


def truth(text):
    return text.lower() in ("true", "1")


def start(context):
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    share = FindPackageShare("dkb_slam_ros")

    def topic(name):
        return value[name] if value[name].startswith("/") else value["camera"].rstrip("/") + "/" + value[name]

    parameters = [value["params"] or PathJoinSubstitution([share, "launch", "params.yaml"]).perform(context)]
    parameters.append({
        "base_frame": value["base_frame"],
        "publish_odom_tf": truth(value["publish_odom_tf"]),
        "use_sim_time": truth(value["use_sim_time"]),
    })
    if truth(value["handheld"]):
        parameters.append({"base_from_cam": [0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5]})
    remappings = [("rgb/image", topic("rgb")), ("depth/image", topic("depth")), ("rgb/camera_info", topic("info")),
                  ("odom_prior", value["odom_prior"]), ("imu", value["imu"])]
    common = {"package": "dkb_slam_ros", "name": "dkb_slam", "parameters": parameters, "remappings": remappings}
    if value["container"]:
        node = ComposableNode(plugin="dkb_slam_ros::SlamComponent",
                              extra_arguments=[{"use_intra_process_comms": True}], **common)
        actions = [LoadComposableNodes(target_container=value["container"], composable_node_descriptions=[node])]
    else:
        actions = [Node(executable="dkb_slam_node", output="screen", **common)]
    if truth(value["rviz"]):
        config = PathJoinSubstitution([share, "rviz", "dkb_slam.rviz"])
        actions.append(Node(package="rviz2", executable="rviz2", arguments=["-d", config]))
    return actions


def generate_launch_description():
    declared = [DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
