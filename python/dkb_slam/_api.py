# SPDX-License-Identifier: Apache-2.0
"""The part of the package that is Python: what has many keywords, and pictures for notebooks."""
from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any, Callable, Optional, Sequence, Tuple, Union

from . import _core

PathLike = Union[str, "os.PathLike[str]"]
Detector = Union[str, Callable[[_core.DetectorImage], Any]]


class Slam(_core.Slam):
    """RGB-D SLAM: frames in, one by one; poses, movers and a map out.

    The keywords are the options of `dkb-slam run`, with its defaults, and give the same bytes.

    camera: of the frames; that of a source is `source.camera`.
    preset: "default", "paper" or "orb": what the settings start from; None: what `config` names, else "default".
    detector: "auto" (yolo where there is a model, else motion), "yolo" (or "network"), "motion", "file", "none",
        "exec:COMMAND", several joined by "+"; or a function of one's own; or a list of both. A function is given a
        DetectorImage and returns None, a mask (bool or uint8 [H, W], not 0 = may move), a list of Detection, or
        (list, mask). What it raises becomes a SlamWarning; after ten times in a row it is not asked again.
    model, labels: ONNX file of the yolo detector (None: $DKB_SLAM_MODEL) and its class names.
    classes: those of them that may move, separated by commas or as a list (None: people, pets, and what people carry
        or ride).
    inference: what computes it: "onnxruntime", "opencv", or "auto" (ONNX Runtime where it is found, else OpenCV).
    boxes, masks: of the file detector, `stamp class x y w h [score]` per line; folder of STAMP.png, above 0 = mover.
    detect_every, detect_latency: [frames] from one image that the network is asked for to the next, and until its
        answer counts; 0 = by its size. Without a network: a function of one's own is asked every so many frames, on a
        thread of its own, in the place of every frame on the thread that calls process().
    filter: "default", "paper", "box", "epipolar", "multiview" or "none": which features are rejected. "default" alone
        tells of movers.
    disable: parts to switch off, by comma: dr, kf, ba, loop.
    settings: any setting of docs/settings.md by its key, {"features.count": 1200}.
    config: YAML file of settings, as `config_yaml()` gives it.
    seed: of the random draws in finding a lost camera, loops and the floor; results hardly ever depend on it.
    threads: 1 = everything on the thread that calls process(); the same bytes.
    realtime: never wait for mapping; results may differ from run to run.
    dense: keep what dense_map() needs.
    final_ba: adjust the whole map once more in finish().
    base_from_cam: float64 [4, 4], [m], the mount: the world is the robot's base at the first tracked frame. A map that
        is loaded keeps the world that it was made with.

    Raises InputError (a ValueError); InvalidOption names the setting, its value and its range.
    """

    def __init__(self, camera: _core.Camera, preset: Optional[str] = None, *,
                 detector: Union[Detector, Sequence[Detector]] = "auto", model: Optional[PathLike] = None,
                 labels: Optional[PathLike] = None, classes: Union[str, Sequence[str], None] = None,
                 boxes: Optional[PathLike] = None, masks: Optional[PathLike] = None,
                 inference: str = "auto", detect_every: int = 0, detect_latency: int = 0,
                 filter: Optional[str] = None, disable: str = "", settings: Optional[Mapping[str, Any]] = None,
                 config: Optional[PathLike] = None, seed: Optional[int] = None, threads: int = 0,
                 realtime: bool = False, dense: bool = False, final_ba: bool = False,
                 base_from_cam: Any = None) -> None:
        if not isinstance(camera, _core.Camera):
            raise TypeError(f"camera: must be a dkb_slam.Camera, not {type(camera).__name__}; "
                            "Camera.named(\"fr1\") and Camera.load(path) give one")
        if settings is not None and not isinstance(settings, Mapping):
            raise TypeError(f"settings: must be a dict, not {type(settings).__name__}")
        if classes is not None and not isinstance(classes, str):
            classes = ",".join(classes)
        super().__init__(camera, preset=preset, detector=detector, model=model, labels=labels, classes=classes or "",
                         boxes=boxes, masks=masks, inference=inference, detect_every=detect_every,
                         detect_latency=detect_latency,
                         filter=filter, disable=disable, settings=None if settings is None else dict(settings),
                         config=config, seed=seed, threads=threads, realtime=realtime, dense=dense,
                         final_ba=final_ba, base_from_cam=base_from_cam)

    def plot(self, truth: Optional[PathLike] = None, *, title: str = "Trajectory") -> Plot:
        """The trajectory so far as a picture; see plot_trajectory()."""
        return plot_trajectory(self, truth, title=title)


def open(source: PathLike, camera: Union[_core.Camera, PathLike, None] = None, *, start: float = 0,
         end: Optional[float] = None, max_frames: Optional[int] = None, skip_pairs: int = 0,
         colour_topic: Optional[str] = None, depth_topic: Optional[str] = None, info_topic: Optional[str] = None,
         odom_topic: Optional[str] = None, imu_topic: Optional[str] = None, prior: str = "auto",
         prior_file: Optional[PathLike] = None, threaded: bool = True) -> _core.Source:
    """Opens a recording or a device: an iterator over its frames, the same as `dkb-slam run` reads.

    source: what the command line takes, e.g. a folder in TUM layout.
    camera: a Camera, a camera file or a name (fr1, fr2, fr3, bonn); None = what the recording says.
    start, end: [s] after the first pair's colour stamp, inclusive; max_frames: pairs counted from start; skip_pairs:
        left out at the beginning, before all else.
    ..._topic: of recordings with several topics of a kind; None = the only one there is.
    prior: which prior of the motion the frames of a recording carry: "none", "odom", "imu" or "auto".
    prior_file: a trajectory in TUM format whose motions they carry, in the place of `prior`: in the axes of the camera,
        of the images' time. A first line `# drift 0.01` says by which share of its way it is off.
    threaded: decode ahead on a thread; the frames are the same.

    Pairs that cannot be read are left out, with a SlamWarning. Ctrl-C works while a frame is waited for. Raises
    InputError saying what is wrong and what to do.
    """
    return _core._open(source, camera, start=start, end=end, max_frames=max_frames, skip_pairs=skip_pairs,
                       colour_topic=colour_topic, depth_topic=depth_topic, info_topic=info_topic,
                       odom_topic=odom_topic, imu_topic=imu_topic, prior=prior, prior_file=prior_file,
                       threaded=threaded)


TrajectoryLike = Union[_core.Slam, PathLike, Tuple[Any, Any]]


def _trajectory(given: Optional[TrajectoryLike], name: str) -> Any:
    if not isinstance(given, _core.Slam):
        return given
    stamps_ns, poses = given.trajectory()
    if len(stamps_ns) == 0:
        frames = given.statistics()["frames"]
        raise _core.InputError(f"{name}: it has no poses (" + ("none of its %d frames was tracked" % frames
                               if frames else "no frame was processed") + ")")
    return stamps_ns, poses


def evaluate(truth: TrajectoryLike, estimate: TrajectoryLike, *, max_diff: float = 0.02, rpe_delta: str = "1f",
             rpe_all_pairs: bool = False, time_offset: float = 0.0, scale: bool = False,
             align: Optional[str] = None) -> dict[str, Any]:
    """Scores a trajectory against the truth: the dict of `dkb-slam eval --json`.

    truth, estimate: files in TUM format, (stamps_ns, poses) with rising stamps, or a Slam. max_diff: [s] between
    matched stamps. rpe_delta: "N" and f, m or s: stretch of the relative error in frames, metres or seconds, from
    every pose on with rpe_all_pairs. time_offset: [s] added to the stamps of the estimate. align: what brings the
    estimate into the world of the truth, "se3", the default, "sim3", which scale=True is short for, "origin" (by the
    first pose alone) or "none".

    Keys: matched, ape.translation_m.{rmse, mean, median, std, min, max}, ape.rotation_deg, and rpe likewise, defined as
    in evo. ape.rotation_determined is false, and ape.rotation_deg None, where a path on a line or in one place leaves
    the rotation of the alignment free; ape.rotation_sd_deg is that rotation's standard error. wrong_scale is there where
    the estimate is of another size than the truth. Rows of a file of the truth with nan are left out. Raises InputError
    when a file is wrong, there is no pose, or fewer than two stamps match.
    """
    if align is not None and scale and align != "sim3":
        raise _core.InputError(f'scale: align="{align}" does not scale; leave one of them out')
    return json.loads(_core._evaluate_json(_trajectory(truth, "truth"), _trajectory(estimate, "estimate"), max_diff,
                                           rpe_delta, rpe_all_pairs, time_offset,
                                           align or ("sim3" if scale else "se3")))


class Plot:
    """A picture: notebooks show it by itself, save() writes it as SVG."""

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: PathLike) -> None:
        """Writes it; the name must end in .svg. Raises InputError when it cannot."""
        _core._save_svg(path, self.svg)

    def __repr__(self) -> str:
        return f"Plot({len(self.svg)} bytes of SVG; save(path) writes it)"


def plot_trajectory(trajectory: TrajectoryLike, truth: Optional[TrajectoryLike] = None, *,
                    title: str = "Trajectory") -> Plot:
    """The path in its two widest projections [m]; beside the truth, where it is given, aligned and with its error.

    trajectory, truth: files in TUM format, (stamps_ns, poses) or a Slam. Raises InputError when there is no pose.
    """
    return Plot(_core._plot_svg(_trajectory(trajectory, "trajectory"), _trajectory(truth, "truth"), title))
