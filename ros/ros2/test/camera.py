# SPDX-License-Identifier: Apache-2.0
"""A sequence in TUM layout as a camera's driver would send it."""
import array
import time

from PIL import Image as Picture
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image


def message(stamp, path, encoding):
    picture = Picture.open(path)
    m = Image(encoding=encoding, width=picture.size[0], height=picture.size[1])
    seconds, _, fraction = stamp.partition(".")
    m.header.stamp.sec, m.header.stamp.nanosec = int(seconds), int((fraction + "0" * 9)[:9])
    m.header.frame_id = "camera_color_optical_frame"
    if encoding == "rgb8":
        m.data = array.array("B", picture.convert("RGB").tobytes())
        m.step = 3 * m.width
        return m
    wide = picture.convert("I").tobytes()  # 32 bits a pixel, of which the lower 16 are the depth
    data = bytearray(len(wide) // 2)
    data[0::2], data[1::2] = wide[0::4], wide[1::4]
    m.data = array.array("B", bytes(data))
    m.step = 2 * m.width
    return m


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


class Camera:
    """Plays the frames as a driver would send them."""

    def __init__(self, node, folder, frames, intrinsics):
        rows = [line.split() for line in open(folder + "/associations.txt") if not line.startswith("#")][:frames]
        topics = {"rgb8": "/camera/color/image_raw", "16UC1": "/camera/aligned_depth_to_color/image_raw"}
        self.images = []
        for row in rows:
            self.images += [(topics["rgb8"], message(row[0], f"{folder}/{row[1]}", "rgb8")),
                            (topics["16UC1"], message(row[2], f"{folder}/{row[3]}", "16UC1"))]
        self.images.sort(key=lambda image: seconds(image[1].header.stamp))
        self.publishers = {t: node.create_publisher(Image, t, qos_profile_sensor_data) for t in topics.values()}
        fx, fy, cx, cy = intrinsics
        first = self.images[0][1]
        self.info = CameraInfo(width=first.width, height=first.height, distortion_model="plumb_bob", d=[0.0] * 5,
                               k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
        self.info_publisher = node.create_publisher(CameraInfo, "/camera/color/camera_info", qos_profile_sensor_data)

    def play(self):
        # Calibrations begin before the images, as a driver's do: a node that starts between both misses no frame.
        for _ in range(5):
            self.info_publisher.publish(self.info)
            time.sleep(0.1)
        begin = time.time() - seconds(self.images[0][1].header.stamp)
        for topic, image in self.images:
            time.sleep(max(0.0, begin + seconds(image.header.stamp) - time.time()))
            self.publishers[topic].publish(image)
