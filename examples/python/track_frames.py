# SPDX-License-Identifier: Apache-2.0
"""A camera loop of one's own: prints the pose of every frame.

    track_frames.py FOLDER      in TUM layout with a camera.yaml
"""
import sys

import dkb_slam


def main(folder: str) -> int:
    source = dkb_slam.open(folder)  # in the place of a camera's driver
    slam = dkb_slam.Slam(source.camera)
    for frame in source:
        # Arrays of any driver: rgb uint8 [H, W, 3], depth uint16 or float32 [H, W], registered to it.
        result = slam.process(frame.stamp_ns, frame.grey if frame.rgb is None else frame.rgb, frame.depth,
                              depth_stamp_ns=frame.depth_stamp_ns)
        if result.tracked:
            x, y, z = result.world_from_cam[:3, 3]  # [m] in the world: the first camera's axes
            print(f"{1e-9 * result.stamp_ns:.3f} s: {x:+.3f} {y:+.3f} {z:+.3f} m, {result.inliers} points")
    slam.finish()  # what mapping still has to do
    done = slam.statistics()
    print(f"tracked {done['tracked']} of {done['frames']} frames, {done['map_points']} map points")
    return 0 if done["frames"] > 0 and done["tracked"] == done["frames"] else 1


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print("error: usage: track_frames.py FOLDER", file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(main(sys.argv[1]))
    except dkb_slam.InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
