#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes a sequence in TUM layout as a bag: make_bag.py FOLDER FILE.bag FRAMES FX FY CX CY

Topics as a camera's driver has them; depth is 16UC1 in the folder's units (the node's parameter depth_factor).
"""
import sys

import rosbag
import rospy
from PIL import Image as Picture
from sensor_msgs.msg import CameraInfo, Image


def message(stamp, path, encoding):
    picture = Picture.open(path)
    m = Image()
    m.header.stamp = rospy.Time.from_sec(0) + rospy.Duration(*map(int, split(stamp)))
    m.header.frame_id = "camera_color_optical_frame"
    m.width, m.height = picture.size
    m.encoding = encoding
    if encoding == "rgb8":
        m.data = picture.convert("RGB").tobytes()
        m.step = 3 * m.width
        return m
    wide = picture.convert("I").tobytes()  # 32 bits a pixel, of which the lower 16 are the depth
    data = bytearray(len(wide) // 2)
    data[0::2], data[1::2] = wide[0::4], wide[1::4]
    m.data = bytes(data)
    m.step = 2 * m.width
    return m


def split(stamp):
    seconds, _, fraction = stamp.partition(".")
    return seconds, (fraction + "0" * 9)[:9]


def main():
    folder, file, frames = sys.argv[1], sys.argv[2], int(sys.argv[3])
    fx, fy, cx, cy = map(float, sys.argv[4:8])
    rows = [line.split() for line in open(folder + "/associations.txt") if not line.startswith("#")][:frames]
    with rosbag.Bag(file, "w") as bag:
        for i, (stamp, rgb, depth_stamp, depth) in enumerate(rows):
            colour = message(stamp, f"{folder}/{rgb}", "rgb8")
            info = CameraInfo(header=colour.header, width=colour.width, height=colour.height)
            info.distortion_model = "plumb_bob"
            info.D = [0.0] * 5
            info.K = [fx, 0, cx, 0, fy, cy, 0, 0, 1]
            for topic, m in (("/camera/color/image_raw", colour), ("/camera/color/camera_info", info),
                             ("/camera/aligned_depth_to_color/image_raw", message(depth_stamp, f"{folder}/{depth}", "16UC1"))):
                bag.write(topic, m, m.header.stamp)
    print(f"{file}: {len(rows)} frames")


main()
