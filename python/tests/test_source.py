# SPDX-License-Identifier: Apache-2.0
"""open(): the frames of the command line, without copies, and Ctrl-C."""
import gc
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import warnings

import dkb_slam
import numpy as np
import pytest


@pytest.fixture
def copy(sequence, tmp_path):
    """A sequence of one's own to spoil."""
    for name in ("rgb", "depth"):
        (tmp_path / name).mkdir()
    rows = (sequence / "associations.txt").read_text().splitlines()[:14]
    for row in rows:
        if not row.startswith("#"):
            for name in row.split()[1::2]:
                shutil.copy(sequence / name, tmp_path / name)
    (tmp_path / "associations.txt").write_text("\n".join(rows) + "\n")
    shutil.copy(sequence / "camera.yaml", tmp_path)
    return tmp_path


def images(folder):
    return sorted((folder / "rgb").iterdir())


def test_frames_come_with_their_arrays(sequence, camera):
    source = dkb_slam.open(sequence)
    assert source.size == len(source) == 40 and source and source.camera == camera and "associations.txt" in repr(source)
    frame = next(source)
    assert frame.rgb.shape == (480, 640, 3) and frame.rgb.dtype == np.uint8 and frame.grey.shape == (480, 640)
    assert frame.depth.dtype == np.float32 and 0 < np.median(frame.depth[frame.depth > 0]) < 10
    assert frame.stamp_ns == round(float(frame.stamp) * 1e9) and frame.index == 0
    assert next(source).index == 1 and len(list(source)) == 38 and list(source) == []


def test_arrays_are_views_that_keep_their_frame(sequence):
    source = dkb_slam.open(sequence, max_frames=6)
    frame = next(source)
    assert np.shares_memory(frame.rgb, frame.rgb) and not frame.rgb.flags.writeable
    rgb, depth = frame.rgb, frame.depth
    before = rgb.copy(), depth.copy()
    del frame
    list(source)
    source.close()
    gc.collect()
    assert (rgb == before[0]).all() and (depth == before[1]).all()


def test_stretches_are_those_of_the_command_line(sequence):
    whole = [frame.stamp_ns for frame in dkb_slam.open(sequence)]
    part = [f.stamp_ns for f in dkb_slam.open(sequence, start=0.2, end=0.5, max_frames=5, threaded=False)]
    assert part == [s for s in whole if 200_000_000 <= s - whole[0] <= 500_000_000][:5]


def test_a_file_may_tell_the_motion(sequence, tmp_path):
    frames = list(dkb_slam.open(sequence, max_frames=3, prior_file=sequence / "groundtruth.txt"))
    assert frames[0].prior is None and frames[2].prior.covariance[0, 0] > 0
    with pytest.raises(dkb_slam.InputError, match="prior_file: it takes the place of prior"):
        dkb_slam.open(sequence, prior="imu", prior_file=sequence / "groundtruth.txt")
    late = tmp_path / "late.txt"
    late.write_text("9000 0 0 0 0 0 0 1\n9001 0 0 0 0 0 0 1\n")
    with pytest.raises(dkb_slam.InputError, match="late.txt: its times"):
        dkb_slam.open(sequence, prior_file=late)


def test_a_camera_may_be_an_object_a_name_or_a_file(sequence):
    mine = dkb_slam.Camera(fx=500.25, fy=501, cx=320, cy=240, width=640, height=480, depth_factor=5000, fps=25)
    source = dkb_slam.open(sequence, camera=mine)
    assert source.camera == mine and "camera as given" in source.description
    assert dkb_slam.open(sequence, camera="fr2").camera.fx == 520.9
    assert dkb_slam.open(sequence, camera=sequence / "camera.yaml").camera == dkb_slam.open(sequence).camera


def test_pairs_that_cannot_be_read_are_left_out_with_a_warning(copy):
    images(copy)[7].write_bytes(b"no image")
    source = dkb_slam.open(copy)
    with pytest.warns(dkb_slam.SlamWarning, match="^frame 7: .*frame skipped$") as shown:
        indices = [frame.index for frame in source]
    assert len(shown) == 1 and 7 not in indices and len(indices) == source.size - 1 and source.skipped == 1
    assert source.counts == {"dropped": 0, "unpaired": 0, "late": 0}
    with warnings.catch_warnings():  # as an error it loses the pair and nothing else
        warnings.simplefilter("error")
        source = dkb_slam.open(copy)
        with pytest.raises(dkb_slam.SlamWarning):
            list(source)
        assert next(source).index == 8


def test_pairs_that_are_skipped_for_one_reason_are_one_warning_and_a_count(copy):
    for image in images(copy)[7:]:
        image.write_bytes(b"no image")
    with pytest.warns(dkb_slam.SlamWarning) as shown:
        assert len(list(dkb_slam.open(copy))) == 7
    texts = [str(warning.message) for warning in shown]
    assert len(texts) == 2 and texts[0].startswith("frame 7: ") and "more frames skipped: is not an image" in texts[1]


def test_a_closed_source_keeps_what_it_was_and_gives_no_frames(sequence, camera):
    with dkb_slam.open(sequence) as source:
        next(source)
    assert source.camera == camera and source.size == 40 and source.skipped == 0 and source.counts["late"] == 0
    assert repr(source).startswith("Source(closed: 40 pairs by associations.txt")
    with pytest.raises(dkb_slam.InputError, match="it is closed; open it again"):
        next(source)


def run_script(script, *arguments):
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path))
    return subprocess.Popen([sys.executable, "-c", textwrap.dedent(script), *map(str, arguments)], env=environment,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_ctrl_c_works_while_a_frame_is_waited_for(copy):
    blocked = images(copy)[7]  # reading a pipe waits for somebody to write
    blocked.unlink()
    os.mkfifo(blocked)
    child = run_script("""
        import sys, dkb_slam
        source = dkb_slam.open(sys.argv[1])
        try:
            for frame in source:
                if frame.index == 6: print("waiting", flush=True)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
            open(sys.argv[2], "wb").close()
        """, copy, blocked)
    try:
        assert child.stdout.readline() == "waiting\n"
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=20)
    finally:
        child.kill()
    assert out == "interrupted\n" and child.returncode == 0, err


@pytest.mark.parametrize("work", ["process", "process with a detector", "read", "convert"])
def test_a_program_ends_in_peace_while_a_daemon_thread_is_in_a_call(sequence, work):
    child = run_script("""
        import sys, threading, time, dkb_slam
        path, work = sys.argv[1:]
        source = dkb_slam.open(path)
        frames = list(source)
        slam = dkb_slam.Slam(source.camera, detector="motion" if work == "process" else lambda image: time.sleep(0.02))
        begun = threading.Event()
        def feed(k):
            for frame in dkb_slam.open(path) if work == "read" else frames:
                begun.set()
                if work == "convert": dkb_slam.Frame(source.camera, 1, frame.rgb, frame.depth)
                elif work != "read": slam.process(k * 10**10 + frame.stamp_ns, frame.rgb, frame.depth)
        def go():
            for k in range(10000): feed(k)
        threading.Thread(target=go, daemon=True).start()
        begun.wait()
        time.sleep(0.1)
        print("end", flush=True)
        """, sequence, work)
    out, err = child.communicate(timeout=60)
    assert (out, err, child.returncode) == ("end\n", "", 0)


def test_a_program_ends_in_peace_while_threads_are_at_work(sequence):
    child = run_script("""
        import sys, time, dkb_slam
        def detector(image):
            time.sleep(0.2)
        source = dkb_slam.open(sys.argv[1])
        slam = dkb_slam.Slam(source.camera, detector=detector, detect_every=2, realtime=True)
        for frame in source:
            slam.process(frame)
            if frame.index == 8: break
        slam.me = slam    # a cycle, which is collected late or never
        another = dkb_slam.open(sys.argv[1])
        print("end", flush=True)
        """, sequence)
    out, err = child.communicate(timeout=60)
    assert (out, child.returncode) == ("end\n", 0), err
