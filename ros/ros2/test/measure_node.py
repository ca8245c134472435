#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Plays a sequence to a running node and says what it took: measure_node.py FOLDER FRAMES PID FX FY CX CY"""
import os
import sys
import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor

here = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [here, os.path.join(here, "../../test")]
from camera import Camera  # noqa: E402
from figures import cpu_seconds, summary  # noqa: E402

folder, frames, pid = sys.argv[1], int(sys.argv[2]), sys.argv[3]
rclpy.init()
node = rclpy.create_node("measure_node")
camera = Camera(node, folder, frames, [float(a) for a in sys.argv[4:8]])
statuses, poses = [], []
node.create_subscription(Odometry, "/odom", poses.append, 100)
node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: statuses.append(m.status[0]), 10)
executor = SingleThreadedExecutor()
executor.add_node(node)
threading.Thread(target=executor.spin, daemon=True).start()
while not all(p.get_subscription_count() for p in camera.publishers.values()):
    time.sleep(0.1)
before = cpu_seconds(pid)
camera.play()
time.sleep(1.5)
print(summary(statuses), "poses received", len(poses), "cpu [s]", round(cpu_seconds(pid) - before, 2), flush=True)
os._exit(0)  # the thread that spins may be anywhere
