# SPDX-License-Identifier: Apache-2.0
"""The short simulated sequence of the project's tests: 40 frames of a room, made by `dkb-slam simulate`."""
import os
import subprocess
from pathlib import Path

import pytest

PROGRAM = os.environ.get("DKB_SLAM_EXECUTABLE", "")


@pytest.fixture(scope="session")
def sequence(tmp_path_factory):
    made = os.environ.get("DKB_TEST_SEQUENCE", "")
    if made and Path(made, "rgb.txt").exists():
        return Path(made)
    if not PROGRAM:
        pytest.skip("skipped: DKB_SLAM_EXECUTABLE does not name the dkb-slam program")
    folder = tmp_path_factory.mktemp("sequence")
    subprocess.run([PROGRAM, "simulate", "--out", folder, "--scene", "room", "--people", "0", "--seed", "3",
                    "--frames", "40"], check=True, capture_output=True)
    return folder


@pytest.fixture(scope="session")
def command_line():
    """Runs the program: command_line("run", folder, ...) -> its output."""
    if not PROGRAM:
        pytest.skip("skipped: DKB_SLAM_EXECUTABLE does not name the dkb-slam program")

    def run(*arguments):
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def frames(sequence):
    import dkb_slam
    return list(dkb_slam.open(sequence, max_frames=12))


@pytest.fixture(scope="session")
def camera(sequence):
    import dkb_slam
    return dkb_slam.Camera.load(sequence / "camera.yaml")
