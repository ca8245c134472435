# SPDX-License-Identifier: Apache-2.0
"""Detectors of one's own: functions of an image."""
import threading
import warnings

import dkb_slam
import numpy as np
import pytest


def run(camera, frames, detector, **options):
    slam = dkb_slam.Slam(camera, detector=detector, **options)
    results = [slam.process(frame) for frame in frames]
    slam.finish()
    return slam, results


def left_half(image):
    mask = np.zeros(image.grey.shape, bool)
    mask[:, :320] = True
    return mask


def share_on_the_left(result):
    dynamic = result.features[result.features["state"] == dkb_slam.FEATURE_STATES.index("dynamic")]
    return np.mean(dynamic["x"] < 325) if len(dynamic) else 0.0


@pytest.mark.parametrize("answer", [
    left_half,
    lambda image: left_half(image).astype(np.uint8) * 255,
    lambda image: ([dkb_slam.Detection("wall", 0, 0, 320, 480)], left_half(image)),
    lambda image: (None, left_half(image)),
])
def test_masks_keep_features_out(camera, frames, answer):
    _, results = run(camera, frames[:4], answer)
    assert share_on_the_left(results[-1]) == 1 and results[-1].tracked
    assert results[-1].mask[:, :300].any() and not results[-1].mask[:, 340:].any()


def test_boxes_are_carried_to_the_result(camera, frames):
    slam, results = run(camera, frames[:3], lambda image: [dkb_slam.Detection("chair", 10, 20, 100, 50, 0.5)])
    box, = results[-1].detections
    assert (box.class_name, box.box, box.score) == ("chair", (10, 20, 100, 50), 0.5)
    assert slam.statistics()["detector"] == "<lambda>"


def test_the_image_is_the_frames(camera, frames):
    seen = []

    def detector(image):
        seen.append((image, image.stamp_ns, image.rgb, image.depth, threading.get_ident()))

    run(camera, frames[:2], detector)
    assert len(seen) == 2
    image, stamp, rgb, depth, thread = seen[1]
    assert stamp == frames[1].stamp_ns and (rgb == frames[1].rgb).all() and (depth == frames[1].depth).all()
    assert thread == threading.get_ident()
    assert image.rgb is rgb
    with pytest.raises(dkb_slam.InputError, match="during the detector's call"):
        image.grey


def test_a_slow_detector_has_a_thread_of_its_own(camera, frames):
    threads = []

    def detector(image):
        threads.append((image.stamp_ns, threading.get_ident()))
        return left_half(image)

    results = [run(camera, frames, detector, detect_every=3, detect_latency=2)[1] for _ in range(2)]
    stamps = [stamp for stamp, _ in threads]
    assert stamps[0] == frames[0].stamp_ns and len(stamps) == 2 * len(range(0, len(frames), 3))
    assert all(thread != threading.get_ident() for _, thread in threads)
    for a, b in zip(*results):  # the same every time, whatever the threads do
        assert (a.world_from_cam == b.world_from_cam).all() and (a.features == b.features).all()


def test_kinds_and_functions_join(camera, frames):
    slam, _ = run(camera, frames[:2], ["motion", left_half])
    assert slam.statistics()["detector"] in ("left_half+motion", "motion+left_half")
    assert run(camera, frames[:2], left_half, filter="none")[0].statistics()["detector"] == "none"
    with pytest.raises(dkb_slam.InputError, match="one detector may be slow"):
        dkb_slam.Slam(camera, detector=[left_half, left_half], detect_every=3)


class WithState:
    def __init__(self):
        self.resets = 0

    def __call__(self, image):
        return None

    def reset(self):
        self.resets += 1


def test_objects_are_told_when_a_new_world_begins(camera, frames):
    detector = WithState()
    slam, _ = run(camera, frames[:2], detector)
    before = detector.resets
    slam.reset()
    assert detector.resets == before + 1 and slam.statistics()["detector"] == "WithState"


@pytest.mark.parametrize("answer, says", [
    (lambda image: 1 / 0, "ZeroDivisionError: division by zero"),
    (lambda image: 5, "it returned a int"),
    (lambda image: [5], "its boxes hold a int"),
    (lambda image: np.zeros((480, 640)), "mask: it is float64"),
    (lambda image: np.zeros((48, 64), bool), "failed: a mask is of 64 x 48 px, the images of 640 x 480; scale it"),
    (lambda image: [dkb_slam.Detection("cat", 900, 0, 9, 9)], "failed: a box lies outside the image"),
])
def test_a_failing_detector_is_a_warning_and_tracking_goes_on(camera, frames, answer, says):
    with pytest.warns(dkb_slam.SlamWarning) as shown:
        slam, results = run(camera, frames[:2], answer)
    assert says in str(shown[0].message) and "\n" not in str(shown[0].message)
    assert results[-1].tracked
    assert any(event.kind == "warning" and says in event.text for event in slam.events())


@pytest.mark.parametrize("options", [{}, {"detect_every": 1, "detect_latency": 1}])
def test_a_detector_that_fails_once_is_asked_again_and_ten_times_in_a_row_not(camera, sequence, options):
    asked = []

    def detector(image):
        asked.append(image.stamp_ns)
        if len(asked) in failing:
            raise RuntimeError("no memory left")

    for failing, calls in (({4}, 20), (range(4, 100), 3 + 10)):
        asked.clear()
        with warnings.catch_warnings(record=True) as shown:
            warnings.simplefilter("always")
            slam, _ = run(camera, list(dkb_slam.open(sequence, max_frames=20)), detector, **options)
        late = 1 if options and calls == 20 else 0  # the last image of a slow one may be dropped in finish()
        assert calls - late <= len(asked) <= calls
        assert slam.statistics()["detector_failed"] == (calls == 13)
        assert ("motion" in slam.statistics()["detector"]) == (calls == 13)
        assert len(shown) == (2 if calls == 13 else 1), [str(w.message) for w in shown]


def test_ctrl_c_in_a_detector_reaches_the_caller(camera, frames):
    def detector(image):
        raise KeyboardInterrupt

    slam = dkb_slam.Slam(camera, detector=detector)
    with pytest.raises(KeyboardInterrupt), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        slam.process(frames[0])


def test_ctrl_c_in_a_reset_reaches_the_caller_though_the_reset_fails(camera, frames):
    detector = WithState()
    slam = dkb_slam.Slam(camera, detector=detector)
    slam.process(frames[0])

    def interrupted():
        raise KeyboardInterrupt

    detector.reset = interrupted
    with pytest.raises(KeyboardInterrupt):
        slam.reset()
    del detector.reset
    slam.reset()
    assert slam.process(frames[0]).tracked
