#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Plays a bag to a running node and checks what it publishes: check_node.py FILE.bag FRAMES OUT_FOLDER

Writes OUT_FOLDER/odom.txt, the odometry in TUM format, and OUT_FOLDER/figures.txt, the last diagnostics.
"""
import json
import os
import sys
import threading
import time
import urllib.request

import rosbag
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from dkb_slam_ros.msg import Movers
from dkb_slam_ros.srv import MapFile
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from roslib.message import get_message_class
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

TYPES = {
    "odom": Odometry, "pose": PoseWithCovarianceStamped, "path": Path, "map_points": PointCloud2,
    "movers": MarkerArray, "movers_array": Movers, "features_image": Image, "grid": OccupancyGrid, "tf": TFMessage,
    "diagnostics": DiagnosticArray,
}
received = {topic: [] for topic in TYPES}
lock = threading.Lock()
failures = []


def keep(message, topic):
    with lock:
        received[topic].append(message)


def expect(condition, text):
    print(("ok: " if condition else "FAILED: ") + text)
    if not condition:
        failures.append(text)


def wait_for(condition, seconds=60):
    end = time.time() + seconds
    while time.time() < end:
        with lock:
            if condition():
                return True
        time.sleep(0.05)
    return False


def page_answers():
    address = f"http://127.0.0.1:{rospy.get_param('/dkb_slam/viewer_port')}/api/state"
    with urllib.request.urlopen(address, timeout=10) as answer:
        return json.load(answer)["frame"] >= 0


def call(name, kind, *arguments):
    rospy.wait_for_service("/dkb_slam/" + name, 30)
    answer = rospy.ServiceProxy("/dkb_slam/" + name, kind)(*arguments)
    print(f"{name}: {answer.success} {answer.message}")
    return answer.success


def play(path):
    """As `rosbag play --delay=1` does, whose own player now and then begins as if it were paused."""
    with rosbag.Bag(path) as bag:
        topics = bag.get_type_and_topic_info().topics
        publishers = {topic: rospy.Publisher(topic, get_message_class(info.msg_type), queue_size=100)
                      for topic, info in topics.items()}
        time.sleep(1)  # until the node has found them
        begin, first = time.monotonic(), bag.get_start_time()
        for topic, message, stamp in bag.read_messages():
            time.sleep(max(0, stamp.to_sec() - first - (time.monotonic() - begin)))
            publishers[topic].publish(message)
        time.sleep(1)  # until the last is sent
        for publisher in publishers.values():
            publisher.unregister()


def main():
    bag, frames, out = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    rospy.init_node("check_node", disable_signals=True)
    for topic, kind in TYPES.items():
        rospy.Subscriber("/" + topic, kind, keep, callback_args=topic)
    wait_for(lambda: received["diagnostics"])
    expect(received["diagnostics"][-1].status[0].level == 2, "no images is an error")
    play(bag)

    expect(wait_for(lambda: len(received["odom"]) >= 0.9 * frames), "odometry of nine frames in ten")
    expect(wait_for(lambda: received["map_points"] and received["path"]), "map and path")
    odometry = received["odom"]
    expect(all(m.header.frame_id == "odom" and m.child_frame_id == "base_link" for m in odometry), "its frames")
    expect(all(m.pose.covariance[0] > 0 and m.twist.covariance[35] > 0 for m in odometry), "its covariances")
    transforms = [t for m in received["tf"] for t in m.transforms]
    links = {(t.header.frame_id, t.child_frame_id) for t in transforms}
    expect(links == {("map", "odom"), ("odom", "base_link")}, "map -> odom -> base_link")
    stamps = {m.header.stamp for m in odometry}
    expect(stamps <= {t.header.stamp for t in transforms if t.child_frame_id == "base_link"}, "a transform per odometry")
    expect(received["map_points"][-1].width > 300, "map points")
    expect(received["map_points"][-1].header.frame_id == "map", "their frame")
    expect(len(received["path"][-1].poses) > 1, "path")
    expect(len(received["pose"]) >= 0.9 * frames and len(received["movers_array"]) >= 0.9 * frames, "poses and movers")
    expect(len(received["features_image"]) > 0.5 * frames, "images with features")
    if received["grid"]:  # it needs the floor in view
        expect(received["grid"][-1].header.frame_id == "map", "grid")
    with open(out + "/odom.txt", "w") as file:
        for m in odometry:
            p, q = m.pose.pose.position, m.pose.pose.orientation
            file.write(f"{m.header.stamp.to_sec():.6f} {p.x} {p.y} {p.z} {q.x} {q.y} {q.z} {q.w}\n")
    busy = [m.status[0] for m in received["diagnostics"] if any(v.key == "frames" and v.value != "0" for v in m.status[0].values)]
    with open(out + "/figures.txt", "w") as file:
        for status in busy:
            file.write("; ".join(f"{v.key} {v.value}" for v in status.values) + "\n")

    expect(page_answers(), "the live page answers")

    map_file = os.path.abspath(out + "/map.dkb")
    expect(call("save_map", MapFile, map_file) and os.path.getsize(map_file) > 1000, "save_map")
    expect(not call("load_map", MapFile, "/nowhere/map.dkb"), "load_map says what it cannot do")
    expect(call("load_map", MapFile, map_file), "load_map")
    expect(call("localize_only", SetBool, True), "localize_only")
    before = len(odometry)
    play(bag)
    expect(wait_for(lambda: len(received["odom"]) > before + 0.5 * frames), "found in the map that was loaded")
    expect(call("pause", SetBool, True) and call("pause", SetBool, False), "pause")
    expect(call("reset", Trigger), "reset")
    print("figures:", "; ".join(f"{v.key} {v.value}" for v in busy[-1].values))
    print(f"{len(failures)} failed")
    sys.exit(1 if failures else 0)


main()
