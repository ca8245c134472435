# SPDX-License-Identifier: Apache-2.0
"""Slam from Python: the same as the command line, by frames and by arrays, beside other threads."""
import gc
import os
import signal
import threading
import time
import warnings

import dkb_slam
import numpy as np
import pytest


def track(source, **options):
    slam = dkb_slam.Slam(source.camera, **options)
    results = [slam.process(frame) for frame in source]
    slam.finish()
    return slam, results


@pytest.fixture(scope="module")
def whole(sequence):
    return track(dkb_slam.open(sequence), detector="motion", seed=1)


@pytest.mark.parametrize("options, arguments", [
    ({}, []),
    ({"detector": "motion", "seed": 7, "settings": {"features.count": 800}},
     ["--detector", "motion", "--seed", 7, "--set", "features.count=800"]),
    ({"preset": "paper", "disable": "kf", "detector": "none", "threads": 1},
     ["--preset", "paper", "--disable", "kf", "--detector", "none", "--threads", 1]),
])
def test_a_run_writes_the_bytes_of_the_command_line(sequence, command_line, tmp_path, options, arguments):
    command_line("run", sequence, "--out", tmp_path / "cli", "--quiet", *arguments)
    slam, _ = track(dkb_slam.open(sequence), **options)
    slam.save_trajectory(tmp_path / "final.txt")
    slam.save_trajectory(tmp_path / "online.txt", online=True)
    slam.save_map(tmp_path / "map.dkb")
    for mine, theirs in (("final.txt", "trajectory.txt"), ("online.txt", "trajectory_online.txt"),
                         ("map.dkb", "map.dkb")):
        assert (tmp_path / mine).read_bytes() == (tmp_path / "cli" / theirs).read_bytes(), mine
    command_line("export", tmp_path / "cli", "--format", "euroc", "--out", tmp_path / "theirs.csv")
    slam.save_trajectory(tmp_path / "mine.csv", format="euroc")
    assert (tmp_path / "mine.csv").read_bytes() == (tmp_path / "theirs.csv").read_bytes()
    with pytest.raises(dkb_slam.InputError, match='format: there is no "tmu"'):
        slam.save_trajectory(tmp_path / "mine.csv", format="tmu")


def test_arrays_of_any_layout_give_the_bytes_of_frames(frames, camera):
    direct = dkb_slam.Slam(camera, threads=1)
    by_array = dkb_slam.Slam(camera, threads=1)
    for i, frame in enumerate(frames):
        rgb, depth = frame.rgb, frame.depth
        if i % 3 == 1:  # rows apart, blue first, and units
            rgb = np.dstack([rgb[..., ::-1], rgb[..., :1]])
            depth = np.pad(np.rint(depth * camera.depth_factor).astype(np.uint16), ((0, 0), (0, 5)))[:, :-5]
        a = direct.process(frame)
        b = by_array.process(np.int64(frame.stamp_ns), rgb, depth, depth_stamp_ns=frame.depth_stamp_ns, bgr=i % 3 == 1)
        assert (a.world_from_cam == b.world_from_cam).all()
        assert (a.features == b.features).all()


def test_a_result_has_shapes_units_and_none_for_what_is_missing(whole, frames, camera):
    slam, results = whole
    r = results[-1]
    assert r.tracked and r.state == "tracking" and r.inliers > 50 and r.frame == len(results) - 1
    for pose in (r.world_from_cam, r.odom_from_cam, r.world_from_odom):
        assert pose.shape == (4, 4) and pose.dtype == np.float64
    assert np.allclose(r.world_from_odom @ r.odom_from_cam, r.world_from_cam)
    assert r.covariance.shape == (6, 6) and (np.linalg.eigvalsh(r.covariance) > 0).all()
    assert r.mask.shape == frames[0].depth.shape and r.mask.dtype == bool
    assert r.features.dtype.names == ("x", "y", "state", "reason") and len(r.features) > 300
    used = r.features[r.features["state"] == dkb_slam.FEATURE_STATES.index("used")]
    assert len(used) > 50
    slam = dkb_slam.Slam(camera)
    blind = slam.process(1, np.zeros_like(frames[0].rgb), frames[0].depth)
    assert not blind.tracked and blind.state == "initialising"
    assert blind.world_from_cam is None and blind.odom_from_cam is None and blind.covariance is None


def test_features_outlive_their_result(whole):
    features = whole[1][3].features
    before = features.copy()
    gc.collect()
    assert (features == before).all()
    assert not features.flags.writeable


def test_trajectory_keyframes_and_map_are_arrays(whole):
    slam, results = whole
    stamps, poses = slam.trajectory()
    assert stamps.dtype == np.int64 and poses.shape == (len(stamps), 4, 4) and len(stamps) == 40
    assert (np.diff(stamps) > 0).all() and stamps[0] == results[0].stamp_ns
    stamps, poses = slam.keyframes()
    assert 0 < len(stamps) < 40 and poses.shape[1:] == (4, 4)
    for call in (slam.trajectory, slam.keyframes, lambda map: slam.save_trajectory("/dev/null", map=map)):
        for wrong in (5, -1):
            with pytest.raises(dkb_slam.InputError, match=f"^map: there is no map {wrong}; there is 0$"):
                call(map=wrong)
    xyz, rgb = slam.map_points()
    assert xyz.shape == rgb.shape and xyz.shape[1] == 3 and rgb.dtype == np.uint8 and len(xyz) > 100
    snapshot = slam.map()
    points = snapshot.points()
    assert snapshot.point_count == len(points.ids) == len(xyz) and (np.diff(points.ids.astype(int)) > 0).all()
    assert points.maps.dtype == np.int32 and points.maps.shape == points.ids.shape and (points.maps == 0).all()
    keyframes = snapshot.keyframes()
    assert len(keyframes) == snapshot.keyframe_count and keyframes[1].world_from_cam.shape == (4, 4)
    assert snapshot.loops() == []
    assert {e.kind for e in slam.events()} >= {"new_map", "keyframe"} and slam.events() == []
    statistics = slam.statistics()
    assert statistics["tracked"] == 40 and statistics["detector"] == "motion"
    assert statistics["stages"]["tracking"]["count"] == 40


def test_a_saved_map_serves_again(whole, frames, camera, tmp_path):
    whole[0].save_map(tmp_path / "map.dkb")
    slam = dkb_slam.Slam(camera)
    slam.load_map(tmp_path / "map.dkb")
    slam.localize_only()
    points = slam.map().point_count
    assert any(slam.process(frame).tracked for frame in frames)
    assert slam.map().point_count == points
    slam.reset()
    assert slam.map().point_count == 0
    with pytest.raises(dkb_slam.InputError, match="nothing.dkb"):
        slam.load_map(tmp_path / "nothing.dkb")


def test_a_map_of_another_camera_is_refused_by_the_field_that_differs(whole, camera, tmp_path):
    whole[0].save_map(tmp_path / "map.dkb")
    fields = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy", "depth_factor")}
    with pytest.raises(dkb_slam.InputError, match=r"another camera \(k1 0\) than this one \(k1 0.01\)"):
        dkb_slam.Slam(dkb_slam.Camera(**fields, k1=0.01)).load_map(tmp_path / "map.dkb")


def test_a_suggested_pose_is_where_a_map_begins(frames, camera):
    slam = dkb_slam.Slam(camera)
    place = np.eye(4)
    place[:3, 3] = [1, 2, 3]
    slam.suggest_pose(place, 1e-4 * np.eye(6))
    assert np.abs(slam.process(frames[0]).world_from_cam - place).max() < 1e-6
    with pytest.raises(dkb_slam.InputError, match="covariance"):
        slam.suggest_pose(place, np.zeros((6, 6)))
    with pytest.raises(dkb_slam.InputError, match="world_from_cam"):
        slam.suggest_pose(2 * place, np.eye(6))


def test_pause_answers_without_looking(frames, camera):
    slam = dkb_slam.Slam(camera, threads=1)
    slam.process(frames[0])
    slam.pause()
    assert slam.process(frames[1]).state == "paused"
    slam.pause(False)
    assert slam.process(frames[2]).frame == 1
    slam.save_trajectory("/dev/null")


def test_other_threads_run_and_read_while_a_frame_is_tracked(sequence):
    ticks, reads, done = [], [], threading.Event()
    source = dkb_slam.open(sequence)
    slam = dkb_slam.Slam(source.camera)

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.0005)

    def read():
        while not done.is_set():
            reads.append((slam.map().points().xyz.shape, len(slam.trajectory()[0]), repr(slam)))

    threads = [threading.Thread(target=f) for f in (tick, read)]
    for thread in threads:
        thread.start()
    spans = []
    for frame in source:
        begin = time.perf_counter()
        slam.process(frame)
        spans.append((begin, time.perf_counter()))
    done.set()
    for thread in threads:
        thread.join()
    assert reads and any(b < t < e for b, e in spans for t in ticks), "the GIL was held"


def test_a_second_feeding_thread_is_refused(frames, camera):
    inside, go = threading.Event(), threading.Event()

    def detector(image):
        inside.set()
        assert go.wait(20)

    slam = dkb_slam.Slam(camera, detector=detector)
    thread = threading.Thread(target=slam.process, args=(frames[0],))
    thread.start()
    assert inside.wait(20)
    with pytest.raises(dkb_slam.InputError, match="another thread"):
        slam.process(frames[1])
    go.set()
    thread.join()
    assert slam.process(frames[1]).frame == 1


@pytest.mark.parametrize("save", [lambda slam, path: slam.save_map(path), lambda slam, path: slam.dense_map(),
                                  lambda slam, path: slam.save_trajectory(path)])
def test_no_frame_is_refused_while_another_thread_saves(sequence, tmp_path, save):
    source = dkb_slam.open(sequence)
    slam = dkb_slam.Slam(source.camera, realtime=True, dense=True)
    done, saved, wrong = threading.Event(), [], []

    def keep_saving():
        while not done.is_set():
            try:
                save(slam, tmp_path / "saved")
                saved.append(True)
            except BaseException as error:
                wrong.append(error)

    before = 0
    while slam.map().keyframe_count == 0:  # a map without one is not saved
        slam.process(next(source))
        before += 1
    thread = threading.Thread(target=keep_saving)
    thread.start()
    try:
        results = [slam.process(frame) for frame in source]
    finally:
        done.set()
        thread.join()
    assert len(results) == 40 - before > 20 and saved and not wrong


def test_a_trajectory_is_saved_while_a_frame_is_tracked(frames, camera, tmp_path):
    inside, go = threading.Event(), threading.Event()

    def detector(image):
        inside.set()
        assert go.wait(20)

    slam = dkb_slam.Slam(camera, detector=detector)
    go.set()
    slam.process(frames[0])
    go.clear()
    inside.clear()
    thread = threading.Thread(target=slam.process, args=(frames[1],))
    thread.start()
    assert inside.wait(20)
    slam.save_trajectory(tmp_path / "online.txt", online=True)
    go.set()
    thread.join()
    rows = [row for row in (tmp_path / "online.txt").read_text().splitlines() if not row.startswith("#")]
    assert len(rows) == 1


def test_a_detector_that_calls_its_slam_is_told_so(frames, camera, tmp_path):
    def detector(image):
        for call in (lambda: slam.save_map(tmp_path / "map.dkb"), slam.finish, slam.dense_map):
            try:
                call()
            except dkb_slam.InputError as error:
                told.append(str(error))

    for options in ({}, {"detect_every": 1}):
        told = []
        slam = dkb_slam.Slam(camera, detector=detector, **options)
        for frame in frames[:3]:
            slam.process(frame)
        slam.close()
        assert set(told) == {"slam: its detector calls it; call it between the frames"}


def test_a_forked_process_is_told_to_make_its_own(sequence):
    source = dkb_slam.open(sequence)
    slam = dkb_slam.Slam(source.camera)
    slam.process(next(source))
    child = os.fork()
    if child == 0:
        try:
            for call in (lambda: slam.process(next(source)), slam.finish, slam.map, lambda: next(source)):
                with pytest.raises(dkb_slam.InputError, match="another process"):
                    call()
            assert repr(slam) == "Slam(of another process)"
            slam.close()
            source.close()
            with dkb_slam.open(sequence, max_frames=3) as mine:
                with dkb_slam.Slam(mine.camera) as another:
                    assert [another.process(frame).frame for frame in mine] == [0, 1, 2]
            os._exit(0)
        finally:
            os._exit(1)
    deadline = time.monotonic() + 60
    done, status = os.waitpid(child, os.WNOHANG)
    while done == 0 and time.monotonic() < deadline:
        time.sleep(0.05)
        done, status = os.waitpid(child, os.WNOHANG)
    if done == 0:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert done == child and status == 0
    assert slam.process(next(source)).frame == 1


def test_stamps_in_microseconds_are_told_once(frames, camera):
    slam = dkb_slam.Slam(camera, threads=1)
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        for i in range(36):
            slam.process(1_700_000_000_000_000 + i * 33_333, frames[0].rgb, frames[0].depth)
    assert ["nanoseconds" in str(w.message) for w in shown].count(True) == 1


def test_a_prior_is_taken_as_matrix_or_object(frames, camera):
    slam = dkb_slam.Slam(camera)
    slam.process(frames[0])
    assert slam.process(frames[1], prior=np.eye(4)).tracked
    prior = dkb_slam.MotionPrior(np.eye(4), np.eye(6) * 1e-3, rotation_only=True)
    assert prior.rotation_only and prior.covariance[5, 5] == 1e-3
    frame = dkb_slam.Frame(camera, frames[2].stamp_ns, frames[2].rgb, frames[2].depth, prior=prior)
    assert frame.prior.rotation_only and slam.process(frame).tracked


def test_dense_map_has_the_still_world(sequence, tmp_path):
    slam, _ = track(dkb_slam.open(sequence, max_frames=40), dense=True, settings={"dense.voxel": 0.05,
                                                                                  "dense.truncation": 0.15,
                                                                                  "dense.grid_cell": 0.1})
    dense = slam.dense_map()
    assert dense.vertices.shape == dense.colours.shape and len(dense.vertices) > 100
    assert dense.triangles.max() < len(dense.vertices) and dense.to_ply().startswith(b"ply")
    dense.save(tmp_path / "dense.ply")
    assert (tmp_path / "dense.ply").read_bytes() == dense.to_ply()
    with pytest.raises(dkb_slam.InputError, match="dense.obj: the mesh is a PLY file; give a name that ends in .ply"):
        dense.save(tmp_path / "dense.obj")
    if dense.grid is not None:
        dense.grid.save(tmp_path / "floor")
        assert (tmp_path / "floor.pgm").read_bytes().endswith(dense.grid.cells.tobytes())
        assert "image: floor.pgm" in (tmp_path / "floor.yaml").read_text()
        assert repr(dense.grid) == "OccupancyGrid({1} x {0} cells of 0.1 m)".format(*dense.grid.cells.shape)
        assert dense.grid.cells.dtype == np.uint8 and dense.grid.floor_from_world.shape == (4, 4)
    with pytest.raises(dkb_slam.InputError):
        dkb_slam.Slam(slam.camera).dense_map()


def test_a_closed_slam_says_so(frames, camera):
    with dkb_slam.Slam(camera) as slam:
        slam.process(frames[0])
    assert repr(slam) == "Slam(closed)"
    for call in (lambda: slam.process(frames[1]), slam.map, slam.trajectory, slam.finish):
        with pytest.raises(dkb_slam.InputError, match="closed"):
            call()
