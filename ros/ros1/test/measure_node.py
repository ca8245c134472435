#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Plays a bag to a running node and says what it took: measure_node.py FILE.bag PID"""
import os
import subprocess
import sys

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../test"))
from figures import cpu_seconds, summary  # noqa: E402

statuses, poses = [], []
rospy.init_node("measure_node", disable_signals=True)
rospy.Subscriber("/odom", Odometry, poses.append)
rospy.Subscriber("/diagnostics", DiagnosticArray, lambda m: statuses.append(m.status[0]))
rospy.sleep(2)
before = cpu_seconds(sys.argv[2])
subprocess.run(["rosbag", "play", "--quiet", "--delay=1", sys.argv[1]], check=True, stdin=subprocess.DEVNULL,
               stdout=subprocess.DEVNULL)
rospy.sleep(1.5)
print(summary(statuses), "poses received", len(poses), "cpu [s]", round(cpu_seconds(sys.argv[2]) - before, 2))
