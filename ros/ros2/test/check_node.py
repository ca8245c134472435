#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Publishes a sequence in TUM layout to a running node, at its pace, and checks what the node publishes:

  check_node.py FOLDER FRAMES OUT_FOLDER FX FY CX CY

Writes OUT_FOLDER/odom.txt, the odometry in TUM format, and OUT_FOLDER/figures.txt, the diagnostics.
"""
import os
import sys
import threading
import time

import rclpy
from camera import Camera, seconds
from diagnostic_msgs.msg import DiagnosticArray
from dkb_slam_ros.msg import Movers
from dkb_slam_ros.srv import MapFile
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TYPES = {
    "odom": Odometry, "pose": PoseWithCovarianceStamped, "path": Path, "map_points": PointCloud2,
    "movers": MarkerArray, "movers_array": Movers, "features_image": Image, "grid": OccupancyGrid, "tf": TFMessage,
    "diagnostics": DiagnosticArray,
}
received = {topic: [] for topic in TYPES}
failures = []


def expect(condition, text):
    print(("ok: " if condition else "FAILED: ") + text, flush=True)
    if not condition:
        failures.append(text)


def wait_for(condition, seconds=60):
    end = time.time() + seconds
    while time.time() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


def call(node, name, kind, **fields):
    client = node.create_client(kind, "/dkb_slam/" + name)
    if not client.wait_for_service(30):
        return False
    future = client.call_async(kind.Request(**fields))
    wait_for(future.done, 30)
    print(f"{name}: {future.result().success} {future.result().message}", flush=True)
    return future.result().success


def main():
    folder, frames, out = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    rclpy.init()
    node = rclpy.create_node("check_node")
    camera = Camera(node, folder, frames, [float(a) for a in sys.argv[4:8]])
    for topic, kind in TYPES.items():
        node.create_subscription(kind, "/" + topic, received[topic].append, LATCHED if topic == "grid" else 100)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()

    expect(wait_for(lambda: received["diagnostics"]), "diagnostics")
    expect(received["diagnostics"][-1].status[0].level == b"\x02", "no images is an error")
    expect(wait_for(lambda: all(p.get_subscription_count() for p in camera.publishers.values())), "the node listens")
    camera.play()

    expect(wait_for(lambda: len(received["odom"]) >= 0.9 * frames), "odometry of nine frames in ten")
    expect(wait_for(lambda: received["map_points"] and received["path"]), "map and path")
    odometry = list(received["odom"])
    expect(all(m.header.frame_id == "odom" and m.child_frame_id == "base_link" for m in odometry), "its frames")
    expect(all(m.pose.covariance[0] > 0 and m.twist.covariance[35] > 0 for m in odometry), "its covariances")
    transforms = [t for m in received["tf"] for t in m.transforms]
    links = {(t.header.frame_id, t.child_frame_id) for t in transforms}
    expect(links == {("map", "odom"), ("odom", "base_link")}, "map -> odom -> base_link")
    placed = {seconds(t.header.stamp) for t in transforms if t.child_frame_id == "base_link"}
    expect({seconds(m.header.stamp) for m in odometry} <= placed, "a transform per odometry")
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
            file.write(f"{seconds(m.header.stamp):.6f} {p.x} {p.y} {p.z} {q.x} {q.y} {q.z} {q.w}\n")
    busy = [m.status[0] for m in received["diagnostics"]
            if any(v.key == "frames" and v.value != "0" for v in m.status[0].values)]
    with open(out + "/figures.txt", "w") as file:
        for status in busy:
            file.write("; ".join(f"{v.key} {v.value}" for v in status.values) + "\n")

    map_file = os.path.abspath(out + "/map.dkb")
    expect(call(node, "save_map", MapFile, path=map_file) and os.path.getsize(map_file) > 1000, "save_map")
    expect(not call(node, "load_map", MapFile, path="/nowhere/map.dkb"), "load_map says what it cannot do")
    expect(call(node, "load_map", MapFile, path=map_file), "load_map")
    expect(call(node, "localize_only", SetBool, data=True), "localize_only")
    before = len(received["odom"])
    camera.play()
    expect(wait_for(lambda: len(received["odom"]) > before + 0.5 * frames), "found in the map that was loaded")
    expect(call(node, "pause", SetBool, data=True) and call(node, "pause", SetBool, data=False), "pause")
    expect(call(node, "reset", Trigger), "reset")
    print("figures:", "; ".join(f"{v.key} {v.value}" for v in busy[-1].values))
    print(f"{len(failures)} failed", flush=True)
    executor.shutdown()
    os._exit(1 if failures else 0)  # the thread that spins may be anywhere


main()
