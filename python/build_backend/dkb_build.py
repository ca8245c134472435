# SPDX-License-Identifier: Apache-2.0
"""Build backend (PEP 517 and 660): runs CMake and packs wheel and sdist with nothing but the standard library.

Needs cmake, a C++20 compiler, pybind11 and the library's own packages from the distribution; scripts/deps.sh python
installs them. Builds in build-TAG, which the next build goes on with; the environment's CMAKE_ARGS go to CMake.
"""
import base64
import gzip
import hashlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NAME = "dkb_slam"


def _version():
    return re.search(r'define DKB_SLAM_VERSION "([^"]+)"', (ROOT / "include/dkb_slam/version.h").read_text()).group(1)


def _metadata():
    return f"""Metadata-Version: 2.1
Name: {NAME.replace("_", "-")}
Version: {_version()}
Summary: Real-time RGB-D SLAM that withstands people in the picture
License: Apache-2.0
Requires-Python: >=3.8
Requires-Dist: numpy
Description-Content-Type: text/markdown

{(ROOT / "docs/python.md").read_text(encoding="utf-8")}"""


def _tag():
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{re.sub('[-.]', '_', sysconfig.get_platform())}"


def _dist_info(wheel_tag):
    """Files of the wheel's .dist-info but RECORD, by name."""
    wheel = f"Wheel-Version: 1.0\nGenerator: dkb_build\nRoot-Is-Purelib: false\nTag: {wheel_tag}\n"
    return {"METADATA": _metadata().encode(), "WHEEL": wheel.encode(), "LICENSE": (ROOT / "LICENSE").read_bytes()}


def _run(*command):
    try:
        subprocess.run([str(word) for word in command], check=True)
    except FileNotFoundError:
        sys.exit(f"error: {command[0]} is missing; `bash scripts/deps.sh python` installs what the build needs")
    except subprocess.CalledProcessError as failed:
        sys.exit(f"error: `{' '.join(map(str, command))}` failed ({failed.returncode}); if a package is missing, "
                 "`bash scripts/deps.sh python` installs it")


def _build():
    """Builds the extension for this Python and returns the build folder."""
    folder = ROOT / f"build-{_tag()}"
    generator = ["-G", "Ninja"] if shutil.which("ninja") else []
    _run("cmake", "-S", ROOT, "-B", folder, *generator, "-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF",
         "-DCMAKE_UNITY_BUILD=ON", "-DCMAKE_UNITY_BUILD_BATCH_SIZE=6",
         "-DDKB_PYTHON=ON", f"-DPython_EXECUTABLE={sys.executable}", *shlex.split(os.environ.get("CMAKE_ARGS", "")))
    _run("cmake", "--build", folder, "--target", "dkb_python", "-j", os.cpu_count() or 1)
    return folder


def _pack(wheel_directory, files):
    """A wheel of the files (name: bytes), each with its checksum in RECORD. Same files, same bytes."""
    info = f"{NAME}-{_version()}.dist-info"
    files = {**files, **{f"{info}/{name}": data for name, data in _dist_info(_tag()).items()}}
    record = ""
    wheel = f"{NAME}-{_version()}-{_tag()}.whl"
    with zipfile.ZipFile(Path(wheel_directory, wheel), "w", zipfile.ZIP_DEFLATED) as archive:
        def add(name, data):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.external_attr = (0o755 if ".so" in name else 0o644) << 16
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED)

        for name in sorted(files):
            digest = base64.urlsafe_b64encode(hashlib.sha256(files[name]).digest()).rstrip(b"=").decode()
            record += f"{name},sha256={digest},{len(files[name])}\n"
            add(name, files[name])
        add(f"{info}/RECORD", (record + f"{info}/RECORD,,\n").encode())
    return wheel


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    info = Path(metadata_directory, f"{NAME}-{_version()}.dist-info")
    info.mkdir()
    for name, data in _dist_info(_tag()).items():
        (info / name).write_bytes(data)
    return info.name


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    build = _build()
    with tempfile.TemporaryDirectory() as staged:
        _run("cmake", "--install", build, "--component", "python", "--prefix", staged)
        files = {str(p.relative_to(staged)): p.read_bytes() for p in Path(staged).rglob("*") if p.is_file()}
    return _pack(wheel_directory, files)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """The package stays in the build folder, whose Python files are links to the tree."""
    return _pack(wheel_directory, {f"__editable__.{NAME}.pth": f"{_build() / 'python'}\n".encode()})


def build_sdist(sdist_directory, config_settings=None):
    """Every file of the repository's list or, in an unpacked sdist, of the folder."""
    if (ROOT / ".git").exists():
        listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-z"], check=True, capture_output=True, text=True)
        names = [name for name in listed.stdout.split("\0") if name]
    else:
        top = [p for p in ROOT.iterdir() if not p.name.startswith("build") and p.name != "PKG-INFO"]
        names = [str(f.relative_to(ROOT)) for p in top for f in ([p] if p.is_file() else p.rglob("*")) if f.is_file()]
    base = f"{NAME}-{_version()}"
    path = Path(sdist_directory, base + ".tar.gz")
    with open(path, "wb") as raw, gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as packed, \
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive:
        def add(name, data, executable=False):
            entry = tarfile.TarInfo(f"{base}/{name}")
            entry.size, entry.mode = len(data), 0o755 if executable else 0o644
            archive.addfile(entry, io.BytesIO(data))

        add("PKG-INFO", _metadata().encode())
        for name in sorted(names):
            if (ROOT / name).is_file():
                add(name, (ROOT / name).read_bytes(), os.access(ROOT / name, os.X_OK))
    return path.name
