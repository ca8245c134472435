# SPDX-License-Identifier: Apache-2.0
"""RGB-D SLAM that withstands people in the picture.

    source = dkb_slam.open("rgbd_dataset_freiburg1_xyz")
    slam = dkb_slam.Slam(source.camera)
    for frame in source:
        result = slam.process(frame)
    slam.finish()
    stamps_ns, poses = slam.trajectory()

The same frames and options give the same poses and map to the last bit, and those of `dkb-slam run`; only
`Slam(realtime=True)` and detectors of one's own that are not repeatable end that. process(), finish(), load_map(),
save_map() and reading the next frame let other Python threads run. One thread feeds a Slam, any thread reads it.
Bad input raises InputError, a ValueError with one line; what is worth knowing is shown as a SlamWarning.
"""
from ._api import Plot, Slam, evaluate, open, plot_trajectory
from ._core import (FEATURE_REASONS, FEATURE_STATES, Camera, DenseMap, Detection, DetectorImage, Event, Frame,
                    FrameResult, InputError, InvalidOption, Keyframe, MapPoints, MapSnapshot, MotionPrior, Mover,
                    OccupancyGrid, SlamWarning, Source, __version__)

__all__ = [
    "FEATURE_REASONS", "FEATURE_STATES", "Camera", "DenseMap", "Detection", "DetectorImage", "Event", "Frame",
    "FrameResult", "InputError", "InvalidOption", "Keyframe", "MapPoints", "MapSnapshot", "MotionPrior", "Mover",
    "OccupancyGrid", "Plot", "Slam", "SlamWarning", "Source", "__version__", "evaluate", "open", "plot_trajectory",
]

for _type in (Camera, DenseMap, Detection, DetectorImage, Event, Frame, FrameResult, InputError, InvalidOption,
              Keyframe, MapPoints, MapSnapshot, MotionPrior, Mover, OccupancyGrid, Plot, Slam, SlamWarning, Source):
    _type.__module__ = __name__  # where users find them, in reprs, tracebacks and help()
del _type
