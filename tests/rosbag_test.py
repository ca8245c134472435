# SPDX-License-Identifier: Apache-2.0
"""Bags beside ROS' own library: rosbag_test.py DKB_SLAM. Says "skipped: ..." without python3-rosbag.

What it writes is read to the same bytes of messages, and what we write it reads: index, checksums of types, definitions.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import genpy.dynamic
    import rosbag
    import rospy
    from sensor_msgs.msg import CameraInfo, Image, Imu
    from nav_msgs.msg import Odometry
    from std_msgs.msg import String
    from tf2_msgs.msg import TFMessage
    from geometry_msgs.msg import TransformStamped
except ImportError as error:
    print(f"skipped: {error}; apt-get install python3-rosbag python3-sensor-msgs python3-nav-msgs python3-tf2-msgs")
    sys.exit(0)


def write_messages(path, compression):
    with rosbag.Bag(str(path), "w", compression=compression) as bag:
        for i in range(20):
            time = rospy.Time(1305031102 + i, 7)
            image = Image(height=120, width=160, encoding="rgb8", step=480, data=bytes((i + k) % 251 for k in range(57600)))
            image.header.stamp = time
            info = CameraInfo(height=120, width=160, distortion_model="plumb_bob", D=[1, 2, 3, 4, 5], K=[100, 0, 80, 0, 100, 60, 0, 0, 1])
            imu, odometry = Imu(), Odometry(child_frame_id="base")
            imu.angular_velocity.x, odometry.pose.pose.position.y = i, -i
            transforms = TFMessage([TransformStamped(child_frame_id=f"f{i}")])
            for topic, message in (("/image", image), ("/info", info), ("/imu", imu), ("/odom", odometry), ("/tf", transforms), ("/text", String(f"text {i}"))):
                bag.write(topic, message, time)


def contents(path):
    """Every message as its topic, type, time and raw bytes, by the index."""
    with rosbag.Bag(str(path)) as bag:
        for topic, (kind, data, md5sum, _, _), time in bag.read_messages(raw=True):
            yield topic, kind, md5sum, time.to_nsec(), data


def check_definitions(path):
    """The definitions that stand in the bag are those of the checksums, and describe the bytes."""
    with rosbag.Bag(str(path)) as bag:
        for connection in bag._get_connections():
            types = genpy.dynamic.generate_dynamic(connection.datatype, connection.msg_def)
            assert types[connection.datatype]._md5sum == connection.md5sum, connection.datatype


with tempfile.TemporaryDirectory() as folder:
    for compression in ("none", "bz2", "lz4"):
        theirs, between, ours = (Path(folder) / f"{compression}-{name}" for name in ("theirs.bag", "between.mcap", "ours.bag"))
        write_messages(theirs, compression)
        for source, target in ((theirs, between), (between, ours)):
            extra = ["--compression", compression] if target is ours else []
            subprocess.run([sys.argv[1], "convert", source, "--out", target, *extra], check=True)
        check_definitions(ours)
        by_time = lambda m: (m[3], m[0])
        assert sorted(contents(theirs), key=by_time) == sorted(contents(ours), key=by_time), compression
        with rosbag.Bag(str(ours)) as bag:
            assert bag.get_message_count() == 120 and bag.get_compression_info().compression == compression
print("bags of ROS' own library and ours hold the same messages, read both ways")
