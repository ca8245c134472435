# SPDX-License-Identifier: Apache-2.0
"""Whatever goes in wrong comes back as one line."""
import ast
import copy
import inspect
import pickle
import re
from pathlib import Path

import dkb_slam
import numpy as np
import pytest
from dkb_slam import _core

RGB, DEPTH = np.zeros((480, 640, 3), np.uint8), np.ones((480, 640), np.float32)


@pytest.fixture
def slam(camera):
    return dkb_slam.Slam(camera, threads=1)


@pytest.mark.parametrize("rgb, depth, says", [
    (RGB.astype(np.float32), DEPTH, "rgb: it is float32 [480, 640, 3]"),
    (RGB[..., :2], DEPTH, "rgb: it is uint8 [480, 640, 2]"),
    (RGB[..., ::-1], DEPTH, "rgb: its rows are not contiguous; give numpy.ascontiguousarray(rgb)"),
    (RGB[:, ::-1], DEPTH, "rgb: its rows are not contiguous"),
    (RGB[::-1], DEPTH, "rgb: its rows are not contiguous"),
    (np.broadcast_to(RGB[:1], RGB.shape), DEPTH, "rgb: its rows are not contiguous"),
    (np.zeros((640, 480, 3), np.uint8).transpose(1, 0, 2), DEPTH, "rgb: its rows are not contiguous"),
    (RGB[:, :320], DEPTH, "320 x 480 px, the camera of 640 x 480"),
    (np.zeros((0, 640, 3), np.uint8), DEPTH, "640 x 0 px"),
    (RGB, DEPTH.astype(np.float64), "depth: it is float64 [480, 640]"),
    (RGB, DEPTH.astype(np.float64), "depth.astype(numpy.float32)"),
    (RGB, DEPTH.astype(">f4"), "depth: it is >f4 [480, 640]"),
    (RGB, DEPTH[..., None], "depth: it is float32 [480, 640, 1]"),
    (RGB, DEPTH[:, ::2], "depth: its rows are not contiguous"),
    (RGB, None, "depth: it is of type NoneType; give a numpy array"),
    (RGB.tolist(), DEPTH, "rgb: it is of type list"),
])
def test_images_that_do_not_fit_are_named(slam, rgb, depth, says):
    with pytest.raises(dkb_slam.InputError) as error:
        slam.process(1, rgb, depth)
    assert says in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("call, kind, says", [
    (lambda c: dkb_slam.Slam(c, settings={"features.cuont": 3}), dkb_slam.InputError, 'did you mean "features.count"?'),
    (lambda c: dkb_slam.Slam(c, settings={"features.count": 0}), dkb_slam.InvalidOption, "features.count"),
    (lambda c: dkb_slam.Slam(c, "papr"), dkb_slam.InputError, "paper"),
    (lambda c: dkb_slam.Slam(c, detector="yol"), dkb_slam.InputError, "yolo"),
    (lambda c: dkb_slam.Slam(c, detector="yolo"), dkb_slam.InputError, "no model"),
    (lambda c: dkb_slam.Slam(c, detector=5), TypeError, "detector: must be"),
    (lambda c: dkb_slam.Slam("fr1"), TypeError, 'camera: must be a dkb_slam.Camera, not str; Camera.named("fr1")'),
    (lambda c: dkb_slam.Slam(c, "paper", settings={"preset": "orb"}), dkb_slam.InputError, "preset"),
    (lambda c: dkb_slam.Camera(640, 480, 525, 525, 319.5, 239.5, 1000), TypeError, "give every field by name"),
    (lambda c: dkb_slam.Frame(c, 1, RGB, DEPTH, None), TypeError, "5 arguments by their places, and 4 can be"),
    (lambda c: dkb_slam.Frame("fr1", 1, RGB, DEPTH), TypeError, "camera: must be a dkb_slam.Camera, not str"),
    (lambda c: dkb_slam.Frame(c, 1, RGB, DEPTH, rbg=True), TypeError, 'no argument "rbg" (did you mean "rgb"?)'),
    (lambda c: dkb_slam.MotionPrior(np.eye(4), np.eye(6), True), TypeError, "MotionPrior: 3 arguments by their places"),
    (lambda c: dkb_slam.Slam(c).process(1, RGB, DEPTH, None, 1), TypeError, "process: 5 arguments by their places"),
    (lambda c: dkb_slam.Slam(c).process(1, RGB, DEPTH, rgb=RGB), TypeError, "process: rgb is given twice"),
    (lambda c: dkb_slam.Slam(c).process(rgb=RGB, depth=DEPTH), TypeError, "give a frame, or stamp_ns, rgb and depth"),
    (lambda c: dkb_slam.Slam(c).process(1, stamp_ns=1), TypeError, "give a frame, or stamp_ns, rgb and depth"),
    (lambda c: dkb_slam.Slam(c).process(dkb_slam.Frame(c, 1, RGB, DEPTH), RGB), TypeError, "give a frame, or"),
    (lambda c: dkb_slam.Slam(c, seed="x"), dkb_slam.InputError, "seed"),
    (lambda c: dkb_slam.Slam(c, base_from_cam=np.ones((4, 4))), dkb_slam.InputError, "no rigid motion"),
    (lambda c: dkb_slam.Slam(c, base_from_cam=np.eye(3)), dkb_slam.InputError, "[3, 3]"),
    (lambda c: dkb_slam.MotionPrior("x"), dkb_slam.InputError, "no matrix"),
    (lambda c: dkb_slam.MotionPrior(np.eye(4), np.full((6, 6), np.nan)), dkb_slam.InputError, "covariance: it holds a"),
    (lambda c: dkb_slam.MotionPrior(np.eye(4), np.triu(np.ones((6, 6)))), dkb_slam.InputError, "not symmetric"),
    (lambda c: dkb_slam.MotionPrior(np.eye(4), -np.eye(6)), dkb_slam.InputError, "negative variance"),
    (lambda c: dkb_slam.Detection("", 0, 0, 1, 1), dkb_slam.InputError, "class_name is empty"),
    (lambda c: dkb_slam.Detection("cat", np.nan, 0, 1, 1), dkb_slam.InputError, "not all finite"),
    (lambda c: dkb_slam.Detection("cat", 50, 50, 40, -1), dkb_slam.InputError, "not the other corner"),
    (lambda c: dkb_slam.Detection("cat", 0, 0, 1, 1, 1.5), dkb_slam.InputError, "score=1.5"),
    (lambda c: dkb_slam.Slam(c, threads=-1), dkb_slam.InvalidOption, "threads: -1"),
    (lambda c: dkb_slam.Slam(c, detector=[]), dkb_slam.InputError, "detector: the list is empty"),
    (lambda c: dkb_slam.Slam(c, settings=[1]), TypeError, "settings: must be a dict, not list"),
    (lambda c: dkb_slam.Slam(c, disable="x"), dkb_slam.InputError, 'disable: there is no part "x"'),
    (lambda c: dkb_slam.Slam(c, model="a.onnx", detector="motion"), dkb_slam.InputError,
     'model: detector="motion" has no network'),
    (lambda c: dkb_slam.Slam(c, boxes="b.txt", detector="motion"), dkb_slam.InputError, 'add detector="file"'),
    (lambda c: dkb_slam.Slam(c).dense_map(), dkb_slam.InputError, "set dense=True"),
    (lambda c: dkb_slam.Slam(c, detector="file", masks="m"), dkb_slam.InputError, 'detector="none" too'),
    (lambda c: dkb_slam.Slam(c, disable="kf, bax"), dkb_slam.InputError, 'no part "bax"'),
    (lambda c: dkb_slam.Camera.named("fr4"), dkb_slam.InputError, "fr"),
    (lambda c: dkb_slam.Camera.load("/nothing.yaml"), dkb_slam.InputError, "/nothing.yaml"),
    (lambda c: dkb_slam.Camera(fx=1, fxx=2), dkb_slam.InputError, '"fxx" (did you mean "fx"?)'),
    (lambda c: dkb_slam.Camera(fx=1), dkb_slam.InputError, "missing: width"),
    (lambda c: dkb_slam.open("/no/such/folder"), dkb_slam.InputError, "/no/such/folder"),
    (lambda c: dkb_slam.open(5), TypeError, "source: must be a str or a path"),
    (lambda c: dkb_slam.evaluate("/nothing.txt", "/nothing.txt"), dkb_slam.InputError, "/nothing.txt"),
    (lambda c: dkb_slam.plot_trajectory((np.zeros(2, np.int64), np.zeros((3, 4, 4)))), dkb_slam.InputError, "[N, 4, 4]"),
    (lambda c: dkb_slam.plot_trajectory(dkb_slam.Slam(c)), dkb_slam.InputError, "no pose"),
])
def test_a_wrong_argument_is_one_line(camera, call, kind, says):
    with pytest.raises(kind) as error:
        call(camera)
    assert says in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("depth_stamp", [0, 1_700_000_000_300_000_000, 1_700_000_000_000_000])
def test_a_depth_image_of_another_time_is_refused(slam, camera, depth_stamp):
    stamp = 1_700_000_000_000_000_000
    for call in (slam.process, lambda *a, **k: dkb_slam.Frame(camera, *a, **k)):
        with pytest.raises(dkb_slam.InputError, match="depth_stamp_ns"):
            call(stamp, RGB, DEPTH, depth_stamp_ns=depth_stamp)


def test_stamps_are_whole_and_rise(slam):
    with pytest.raises(TypeError, match="stamp_ns: must be an int"):
        slam.process(1.5, RGB, DEPTH)
    with pytest.raises(dkb_slam.InputError, match="64 bits"):
        slam.process(2**70, RGB, DEPTH)
    slam.process(10, RGB, DEPTH)
    with pytest.raises(dkb_slam.InputError) as error:
        slam.process(10, RGB, DEPTH)
    assert "\n" not in str(error.value)
    assert slam.process(11, RGB, DEPTH).frame == 1


def test_a_frame_may_be_given_by_its_names(slam):
    assert slam.process(stamp_ns=10, rgb=RGB, depth=DEPTH).stamp_ns == 10
    assert slam.process(frame=20, rgb=RGB, depth=DEPTH, bgr=True).stamp_ns == 20
    assert slam.process(frame=dkb_slam.Frame(slam.camera, 30, RGB, DEPTH)).stamp_ns == 30


def test_a_frame_of_another_camera_is_refused_by_the_field_that_differs(slam, camera):
    fields = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy", "depth_factor")}
    frame = dkb_slam.Frame(dkb_slam.Camera(**dict(fields, fx=100)), 1, RGB, DEPTH)
    with pytest.raises(dkb_slam.InputError, match=r"another camera \(fx 100\) than the Slam \(fx 525\)"):
        slam.process(frame)
    assert slam.process(dkb_slam.Frame(dkb_slam.Camera(**dict(fields, depth_factor=7)), 1, RGB, DEPTH)).frame == 0


def test_a_preset_beside_a_config_of_another_is_refused(camera, tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text("preset: paper\n")
    with pytest.raises(dkb_slam.InputError, match='preset: "default", but the settings say `preset: paper`'):
        dkb_slam.Slam(camera, "default", config=config)
    for slam in (dkb_slam.Slam(camera, "paper", config=config), dkb_slam.Slam(camera, config=config)):
        assert "preset: paper" in slam.config_yaml()


def test_errors_are_of_pythons_kinds():
    assert issubclass(dkb_slam.InputError, ValueError) and issubclass(dkb_slam.InvalidOption, dkb_slam.InputError)
    assert issubclass(dkb_slam.SlamWarning, UserWarning)


def test_cameras_keep_their_fields():
    fields = dict(fx=525.5, fy=526.25, cx=319.5, cy=239.5, width=640, height=480, depth_factor=1000.0, k1=0.1)
    camera = dkb_slam.Camera(**fields)
    assert {name: getattr(camera, name) for name in fields} == fields
    assert camera == dkb_slam.Camera(**fields) and camera != dkb_slam.Camera.named("fr1")
    assert eval(repr(camera), {"Camera": dkb_slam.Camera}) == camera
    with pytest.raises(AttributeError):
        camera.fx = 1
    assert pickle.loads(pickle.dumps(camera)) == copy.copy(camera) == camera
    assert {camera: 1}[dkb_slam.Camera(**fields)] == 1 and hash(camera) != hash(dkb_slam.Camera.named("fr1"))


def test_a_cameras_mask_takes_the_depth_and_the_features():
    fields = dict(fx=525, fy=525, cx=319.5, cy=239.5, width=640, height=480, depth_factor=1000)
    mask = np.zeros((480, 640), np.uint8)
    mask[300:] = 7
    masked, plain = dkb_slam.Camera(**fields, mask=mask), dkb_slam.Camera(**fields)
    assert plain.mask is None and masked.mask.dtype == bool and (masked.mask == (mask > 0)).all()
    assert masked != plain and masked == dkb_slam.Camera(**fields, mask=mask > 0) and "mask=..." in repr(masked)
    assert pickle.loads(pickle.dumps(masked)) == masked and dkb_slam.Camera(**fields, mask=None) == plain
    assert not dkb_slam.Frame(masked, 1, RGB, DEPTH).depth[mask > 0].any()
    for wrong in (mask[1:], np.ones((480, 640)), np.zeros((480, 640, 3)), "body.png"):
        with pytest.raises(dkb_slam.InputError, match="mask"):
            dkb_slam.Camera(**fields, mask=wrong)


def test_reprs_say_what_it_is(slam):
    motion = np.eye(4)
    motion[:3, 3] = [0.5, 0, 0]
    prior = dkb_slam.MotionPrior(motion, np.eye(6) * 1e-4)
    assert repr(prior) == "MotionPrior((0.5000, 0.0000, 0.0000) m, 0.0000 rad, sd 0.01 m and 0.01 rad)"
    assert repr(dkb_slam.MotionPrior(motion, rotation_only=True)) == "MotionPrior(0.0000 rad, sd 1 rad)"
    assert repr(slam.map().points()) == "MapPoints(0 points)"


def test_the_stubs_name_what_there_is():
    stub = ast.parse(Path(_core.__file__).with_name("_core.pyi").read_text())

    def names(body):
        found = {n.name for n in body if isinstance(n, (ast.FunctionDef, ast.ClassDef))}
        found |= {n.target.id for n in body if isinstance(n, ast.AnnAssign)}
        return {n for n in found if not re.fullmatch("__(init|iter|next|enter|exit|len|bool)__", n)}

    public = {n for n in dir(_core) if not re.fullmatch("__(?!version).*__", n)}
    assert names(stub.body) == public
    for declared in stub.body:
        if isinstance(declared, ast.ClassDef) and not issubclass(getattr(_core, declared.name), Exception):
            here = {n for n in vars(getattr(_core, declared.name)) if not n.startswith("_")}
            assert names(declared.body) == here, declared.name


def test_everything_public_says_what_it_is():
    for name in dkb_slam.__all__:
        thing = getattr(dkb_slam, name)
        if name.startswith("FEATURE") or name == "__version__":
            continue
        assert inspect.getdoc(thing), name
        if inspect.isclass(thing):
            assert thing.__module__ == "dkb_slam"
    for name, method in vars(_core.Slam).items():
        assert name.startswith("_") or inspect.getdoc(method), name
