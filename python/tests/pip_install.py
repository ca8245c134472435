# SPDX-License-Identifier: Apache-2.0
"""Installs the project by pip into a fresh environment that sees the system's numpy, and tries it there; no network.

    pip_install.py PROJECT WORK_FOLDER        DKB_TEST_SEQUENCE names the sequence to track
"""
import os
import shutil
import subprocess
import sys
from pathlib import Path

try:
    import ensurepip  # noqa: F401
    import numpy  # noqa: F401
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(0)

project, work = Path(sys.argv[1]), Path(sys.argv[2])
shutil.rmtree(work, ignore_errors=True)
work.mkdir(parents=True)
environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PIP_CONFIG_FILE")}
environment.update(PIP_NO_INDEX="1", PIP_DISABLE_PIP_VERSION_CHECK="1", PIP_NO_CACHE_DIR="1", DKB_SLAM_MODEL="",
                   CMAKE_ARGS="-DDKB_WERROR=ON")  # as the tests are built: the compiler's cache has it all


def run(*command):
    done = subprocess.run([str(word) for word in command], cwd=work, env=environment, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        sys.exit(f"failed ({done.returncode}): {' '.join(map(str, command))}\n{done.stdout}")
    return done.stdout


run(sys.executable, "-m", "venv", "--system-site-packages", work / "venv")
python = work / "venv" / "bin" / "python"
track = project / "examples" / "python" / "track_frames.py"
for install in (["--no-build-isolation", project], [project], ["--no-build-isolation", "-e", project]):
    run(python, "-m", "pip", "install", *install)
    print(run(python, track, environment["DKB_TEST_SEQUENCE"]).splitlines()[-1])
    place = run(python, "-c", "import dkb_slam; print(dkb_slam.__file__)").strip()
    assert place.startswith(str(work / "venv")) == ("-e" not in install), place
    files = run(python, "-m", "pip", "show", "-f", "dkb-slam")
    assert "dkb_slam/py.typed" in files or "-e" in install, files
    run(python, "-m", "pip", "uninstall", "-y", "dkb-slam")

# What an sdist holds is enough to build from.
run(python, "-c", f"import sys; sys.path.insert(0, {str(project / 'python/build_backend')!r}); "
                  f"import dkb_build; print(dkb_build.build_sdist({str(work)!r}))")
sdist, = work.glob("dkb_slam-*.tar.gz")
names = run("tar", "-tzf", sdist)
for name in ("pyproject.toml", "PKG-INFO", "python/src/slam.cpp", "include/dkb_slam/slam.h", "docs/python.md"):
    assert f"{sdist.name[:-7]}/{name}\n" in names, name
